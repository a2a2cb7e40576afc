"""Campbell diagram of the linearised stage: natural frequencies over speed with mesh orders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gearfmu.modes.linear import GROUPS, StageModes
from gearfmu.report.style import COLOURS, INK, MUTED, WIDTH, styled, written
from gearfmu.stage import StageModel
from gearfmu.stage.run.limits import engagements_per_turn
from gearfmu.stagefile.forms.shapes import mesh_shape

ORDERS = 8
RPM = 30 / np.pi
LOUD = 0.05  # of the largest mesh force: modes above it are drawn strong and their crossings marked


@dataclass(frozen=True)
class Family:
    """Equal meshes. meshes: their numbers; cycles: tooth engagements in one revolution of the input."""

    name: str
    meshes: tuple[int, ...]
    cycles: float


@dataclass(frozen=True)
class Crossing:
    """Order `order` of equal meshes meets mode `mode` (from 1) at `speed` (rad/s) of the input."""

    family: Family
    order: int
    mode: int
    speed: float


def mesh_families(model: StageModel) -> list[Family]:
    """The meshes of a stage that turn with its input; those whose teeth, carrier and place in the train are equal, as
    the planets' meshes with one gear, together."""
    stage, found = model.stage, dict[Any, list[int]]()
    cycles = engagements_per_turn(model)
    for e, mesh in enumerate(stage.engagements):
        teeth = tuple(gear.z for gear in mesh_shape(stage, mesh).gears)
        if cycles[e]:
            found.setdefault((teeth, stage.frame_of(mesh), cycles[e]), []).append(e)
    families = []
    for key, numbers in found.items():
        first, last = (stage.engagements[numbers[k]].name for k in (0, -1))
        name = first if len(numbers) == 1 else f"{len(numbers)} meshes, {first} … {last}"
        families.append(Family(name, tuple(numbers), key[-1]))
    return families


def crossings(modes: StageModes, families: Sequence[Family], speed_max: float) -> list[Crossing]:
    """Where mesh orders meet modes that a transmission error of those meshes drives, below `speed_max` (rad/s of the
    input)."""
    frequency, strong = modes.frequency.mean(axis=0), loud(modes)
    found = []
    for family in families:
        for order in range(1, ORDERS + 1):
            for k in np.flatnonzero(strong[:, family.meshes].any(axis=1)):
                speed = float(2 * np.pi * frequency[k] / (order * family.cycles))
                if speed <= speed_max:
                    found.append(Crossing(family, order, int(k) + 1, speed))
    return found


def loud(modes: StageModes) -> np.ndarray:
    """(n, E) whether the force of a mesh in a mode at resonance reaches `LOUD` of the largest one of that mesh."""
    force = modes.mesh_force.max(axis=0)
    return np.asarray(force > LOUD * force.max(axis=0))


def write_campbell(modes: StageModes, name: str, families: Sequence[Family], speed_max: float, path: Path) -> None:
    """The diagram up to `speed_max` (rad/s of the input, the shaft `name`), natural frequencies as bands over the
    pitch."""
    limit, strong = speed_max * RPM, np.any(loud(modes), axis=1)
    lines = {family.cycles: family.name for family in reversed(families)}  # of equal orders the first name
    drawn = min(ORDERS * max(lines) * limit / 60, float(modes.frequency.max()))  # above it modes are not known
    top = 1.1 * max(drawn, float(modes.frequency[:, strong].min()))
    with styled():
        figure = Figure(figsize=(WIDTH, 0.62 * WIDTH), layout="constrained")
        axis = figure.subplots()
        for number, (cycles, label) in enumerate(reversed(lines.items())):
            _orders(figure, label if len(lines) > 1 else "", cycles / 60, (limit, top), number)
        used: set[str] = set()
        for k in np.flatnonzero(modes.frequency.min(axis=0) < top):
            _line(figure, modes, int(k), strong[k], limit, used)
        for crossing in crossings(modes, families, speed_max):
            height = modes.frequency[:, crossing.mode - 1].mean()
            axis.plot(crossing.speed * RPM, height, "o", ms=4.5, mfc="white", mec=INK, mew=0.9, zorder=4)
        axis.set(xlim=(0, limit), ylim=(0, top), xlabel=f"speed of the {name} in rpm", ylabel="frequency in Hz")
        axis.set_title(f"{modes.torque:g} N·m; mesh orders 1–{ORDERS}", loc="right", color=MUTED)
        figure.legend(loc="outside upper left", ncols=4)
        written(figure, path)


def _orders(figure: Figure, label: str, each: float, ends: tuple[float, float], number: int) -> None:
    """The orders of equal meshes, whose frequency is `each` (Hz per rpm), up to a speed and a frequency; where meshes
    differ each kind has its dashes."""
    (limit, top), axis, look = ends, figure.axes[0], ("-", "--", ":", "-.")[number % 4]
    for order in range(1, ORDERS + 1):
        at = (limit, order * each * limit)
        known = f"mesh {label}" if label and order == 1 else None
        axis.plot([0, at[0]], [0, at[1]], color=MUTED, lw=0.8, ls=look, zorder=1, label=known)
        if at[1] <= top:
            axis.annotate(f"{order}", at, (4, 0), textcoords="offset points", va="center", color=MUTED)
        else:
            at = (top / (order * each), top)
            axis.annotate(f"{order}", at, (0, -3), textcoords="offset points", va="top", ha="right", color=MUTED)


def _line(figure: Figure, modes: StageModes, k: int, strong: bool, limit: float, used: set[str]) -> None:
    """One natural frequency: band from its lowest to its highest over the pitch, coloured by where most energy is."""
    group = GROUPS[int(modes.shares[:, k].mean(axis=0).argmax())]
    colour, axis = COLOURS[GROUPS.index(group)], figure.axes[0]
    low, high, mean = (f(modes.frequency[:, k]) for f in (np.min, np.max, np.mean))
    label = None if group in used else f"energy mostly in {group}"
    used.add(group)
    axis.fill_between([0, limit], low, high, color=colour, alpha=0.22, lw=0, zorder=2)
    look: dict[str, Any] = {"lw": 1.8, "alpha": 1} if strong else {"lw": 0.8, "alpha": 0.6}
    axis.plot([0, limit], [mean, mean], color=colour, label=label, **look)


def campbell_columns(modes: StageModes) -> dict[str, np.ndarray]:
    """Columns of the table of natural frequencies, one row a mode: means over the pitch, and the range of the
    frequency; of a train a mesh force for each mesh."""
    columns = {
        "mode": np.arange(1, modes.frequency.shape[1] + 1),
        "frequency_Hz": modes.frequency.mean(axis=0),
        "lowest_Hz": modes.frequency.min(axis=0),
        "highest_Hz": modes.frequency.max(axis=0),
        "damping_ratio": modes.damping_ratio.mean(axis=0),
    }
    for e, mesh in enumerate(modes.meshes):
        name = "mesh" if len(modes.meshes) == 1 else mesh
        columns[f"{name}_force_per_te_N_per_um"] = 1e-6 * modes.mesh_force[:, :, e].mean(axis=0)
    return columns | {f"{group}_share": modes.shares[:, :, k].mean(axis=0) for k, group in enumerate(GROUPS)}
