"""Campbell diagram of the linearised stage: natural frequencies over speed with mesh orders."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gearfmu.files import written_whole
from gearfmu.modes.linear import GROUPS, StageModes
from gearfmu.report.style import COLOURS, INK, MUTED, WIDTH, styled

ORDERS = 8
RPM = 30 / np.pi
LOUD = 0.05  # of the largest mesh force: modes above it are drawn strong and their crossings marked


def crossings(modes: StageModes, teeth: int, speed_max: float) -> list[tuple[int, int, float]]:
    """Mesh order, number of the mode (from 1) and speed (rad/s) below `speed_max` at which they meet, of the modes that
    a transmission error drives."""
    frequency = modes.frequency.mean(axis=0)
    found = []
    for order in range(1, ORDERS + 1):
        for k in np.flatnonzero(loud(modes)):
            speed = 2 * np.pi * frequency[k] / (order * teeth)
            if speed <= speed_max:
                found.append((order, int(k) + 1, float(speed)))
    return found


def loud(modes: StageModes) -> np.ndarray:
    """(n,) whether the mesh force of a mode at resonance reaches `LOUD` of the largest one."""
    force = modes.mesh_force.max(axis=0)
    return force > LOUD * force.max()


def write_campbell(modes: StageModes, shafts: Sequence[tuple[str, int]], speed_max: float, path: Path) -> None:
    """The diagram up to `speed_max` (rad/s, first shaft), natural frequencies as bands over the pitch; shafts: (name,
    teeth), the first one is that of the speed."""
    (name, teeth), limit = shafts[0], speed_max * RPM
    top = 1.1 * max(ORDERS * teeth * limit / 60, float(modes.frequency[:, loud(modes)].min()))
    strong = loud(modes)
    with styled():
        figure = Figure(figsize=(WIDTH, 0.62 * WIDTH), layout="constrained")
        axis = figure.subplots()
        for order in range(1, ORDERS + 1):
            end = order * teeth * limit / 60
            axis.plot([0, limit], [0, end], color=MUTED, lw=0.8, zorder=1)
            axis.annotate(f"{order}", (limit, end), (4, 0), textcoords="offset points", va="center", color=MUTED)
        used: set[str] = set()
        for k in np.flatnonzero(modes.frequency.min(axis=0) < top):
            _line(figure, modes, int(k), strong[k], limit, used)
        for _, number, speed in crossings(modes, teeth, speed_max):
            height = modes.frequency[:, number - 1].mean()
            axis.plot(speed * RPM, height, "o", ms=4.5, mfc="white", mec=INK, mew=0.9, zorder=4)
        axis.set(xlim=(0, limit), ylim=(0, top), xlabel=f"speed of the {name} in rpm", ylabel="frequency in Hz")
        axis.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=6, borderaxespad=0.1, title=None)
        axis.set_title(f"{modes.torque:g} N·m; mesh orders 1–{ORDERS} (right)", loc="right", color=MUTED)
        with written_whole(path) as temporary:
            figure.savefig(temporary, dpi=150, format="png")


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
    frequency."""
    columns = {
        "mode": np.arange(1, modes.frequency.shape[1] + 1),
        "frequency_Hz": modes.frequency.mean(axis=0),
        "lowest_Hz": modes.frequency.min(axis=0),
        "highest_Hz": modes.frequency.max(axis=0),
        "damping_ratio": modes.damping_ratio.mean(axis=0),
        "mesh_force_per_te_N_per_um": 1e-6 * modes.mesh_force.mean(axis=0),
    }
    return columns | {f"{group}_share": modes.shares[:, :, k].mean(axis=0) for k, group in enumerate(GROUPS)}
