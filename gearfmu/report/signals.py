"""Facts of a trace: which meshes and bearings it has, where it is in steady operation, how fast the
teeth mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.report.metrics import mesh_angle
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.turning import Meshing, meshings

GEAR_SPEED = ".gear.w"
LOCKED = ".locked"
MESH_CHANNELS = ("force", "force_mean", "te", "contact", "impacts")
NOISE = 1e-4  # of the largest mesh force: forces that cancel leave less
STEADY = 0.1
SETTLED = "after the scene's settling time"


@dataclass(frozen=True)
class Window:
    """The part of a run that spectra are taken from: start, end in s, and why it is that part."""

    start: float
    end: float
    reason: str


def bearings(trace: Trace) -> list[str]:
    """Names of the bearings, in the trace's order: all X with a channel "bearing.X.…"."""
    return list(
        dict.fromkeys(n.split(".")[1] for n in trace.channels if n.startswith("bearing.") and n.count(".") == 2)
    )


def meshes(trace: Trace) -> list[str]:
    """Names of the engagements, in the trace's order: all X with a channel as X.force; that of a pair is "mesh"."""
    found = (name.split(".") for name in trace.channels)
    return list(dict.fromkeys(parts[0] for parts in found if len(parts) == 2 and parts[1] in MESH_CHANNELS))


def noise_floor(trace: Trace) -> float:
    """N: forces below it are rounding and tolerances of the solver, NOISE times the largest mesh force; 0 without."""
    forces = [f"{mesh}.force" for mesh in meshes(trace) if f"{mesh}.force" in trace]
    return NOISE * max((float(np.abs(trace[name]).max()) for name in forces), default=0.0)


def input_shaft(trace: Trace) -> str:
    """The first shaft with a torque and a speed, else the first gear with a speed; "" without any."""
    torques = [name.removesuffix(".tau").removeprefix("drive.") for name in trace.channels if name.endswith(".tau")]
    known = [name for name in torques if f"{name}{GEAR_SPEED}" in trace]
    speeds = [name.removesuffix(GEAR_SPEED) for name in trace.channels if name.endswith(GEAR_SPEED)]
    return next(iter(known or speeds), "")


def drive_side(trace: Trace, mesh: str) -> int:
    """Sign of an engagement's force on its drive flanks, those that carry a positive torque on the input: −1 for some
    meshes of trains and sets. +1 where force or torque are not known."""
    torque = f"{input_shaft(trace)}.tau"
    if f"{mesh}.force" not in trace or torque not in trace:
        return 1
    together = -float(np.sum(trace[f"{mesh}.force"] * trace[torque]))  # the channel: torque of the stage on its shaft
    return -1 if together < 0 else 1


def known_meshings(trace: Trace, stage: Stage | None = None) -> dict[str, Meshing]:
    """Meshing of every engagement, from the stage or the trace's meta "meshes"."""
    if stage is not None:
        return meshings(stage)
    return {mesh: Meshing.of_plain(own) for mesh, own in dict(trace.meta.get("meshes") or {}).items()}


def mesh_angles(trace: Trace, stage: Stage | None = None) -> dict[str, np.ndarray]:
    """Mesh angle (n,) rad of every engagement whose gear's speed and teeth are known: `known_meshings`."""
    known = known_meshings(trace, stage)
    speeds = {name.removesuffix(GEAR_SPEED): trace[name] for name in trace.channels if name.endswith(GEAR_SPEED)}
    return {
        mesh: mesh_angle(trace.time, meshing.relative(speeds), meshing.teeth)
        for mesh, meshing in known.items()
        if {meshing.rotor, meshing.carrier} - {None} <= set(speeds)
    }


def lock_time(trace: Trace) -> float | None:
    """Time in s from which a clutch stays locked to the end; None without a clutch or when it slips at the end."""
    for name in trace.channels:
        if name.endswith(LOCKED):
            slipping = np.flatnonzero(~trace[name].astype(bool))
            first = slipping[-1] + 1 if slipping.size else 0
            return float(trace.time[first]) if first < trace.time.size else None
    return None


def window_of_interest(trace: Trace) -> Window:
    """After lock-up where a clutch locks in the first three quarters, else after the scene's settling time, else
    all."""
    start, end = float(trace.time[0]), float(trace.time[-1])
    locked = lock_time(trace)
    if locked is not None and start < locked < start + 0.75 * (end - start):
        return Window(locked, end, "after the clutch has locked")
    settled = float(trace.meta.get("settle") or 0.0)
    if start < settled < end:
        return Window(settled, end, SETTLED)
    early = f", which ends within the settling time of {settled:g} s" if settled >= end else ""
    return Window(start, end, f"the whole run{early}")


def spans(time: np.ndarray, mask: np.ndarray) -> list[tuple[float, float]]:
    """Intervals (start, end) in s where mask (n,) holds, each to the sample after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return [(float(time[a]), float(time[min(b, time.size - 1)])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def steady(values: np.ndarray) -> bool:
    """Whether nine tenths of values (n,) lie within STEADY of their median."""
    low, middle, high = np.percentile(values, [5, 50, 95])
    return bool(high - low < STEADY * middle)


@dataclass(frozen=True)
class PlanetSet:
    """The engagements of a trace that a carrier carries: by central gear ("sun") and planet ("planet1"), from names as
    sun_planet1; the Meshing of the first."""

    carrier: str
    meshes: Mapping[str, Mapping[str, str]]
    meshing: Meshing

    @property
    def rotors(self) -> list[list[str]]:
        """The carrier, the planets, the central gears."""
        return [[self.carrier], self.planets, [name for name in self.meshes if name]]

    @property
    def planets(self) -> list[str]:
        """Names of the planets, in order."""
        return list(dict.fromkeys(planet for own in self.meshes.values() for planet in own))


def planet_set(trace: Trace, known: Mapping[str, Meshing]) -> PlanetSet | None:
    """The set of a trace; None where no carrier carries an engagement. known: Meshing by engagement."""
    found: dict[str, dict[str, str]] = {}
    carried = {mesh: own for mesh, own in known.items() if own.carrier is not None and f"{mesh}.force" in trace}
    for mesh in carried:
        central, _, planet = mesh.rpartition("_")
        found.setdefault(central or mesh, {})[planet] = mesh
    first = next(iter(carried.values()), None)
    return PlanetSet(first.carrier, found, first) if first is not None and first.carrier is not None else None


def mesh_speed(trace: Trace, own: PlanetSet) -> float:
    """Median of the mesh frequency, rad/s."""
    turning: dict[str, Any] = {n: trace[f"{n}{GEAR_SPEED}"] for n in (own.meshing.rotor, own.carrier)}
    return max(float(np.median(np.abs(own.meshing.relative(turning)))) * own.meshing.teeth, 1e-9)


def recorded(trace: Trace, name: str) -> str:
    """The channel of the mean over the communication step where there is one, which folds less, else `name`."""
    return f"{name}_mean" if f"{name}_mean" in trace else name


def on_mounts(part: Trace) -> dict[str, np.ndarray]:
    """Force of the ring on its mounts, N, along the fixed axes x and y, by name; none where it cancels."""
    known = {name: part[recorded(part, name)] for name in ("bearing.ring.fx", "bearing.ring.fy") if name in part}
    floor = noise_floor(part)
    return known if any(np.abs(values).max() >= floor for values in known.values()) else {}


def running_mean(values: np.ndarray, width: int) -> np.ndarray:
    """(n,): mean over `width` samples around each; NaN at the ends, where there are fewer."""
    found, width = np.full(values.size, np.nan), min(width, values.size)
    before = (width - 1) // 2
    found[before : before + values.size - width + 1] = np.convolve(values, np.full(width, 1.0 / width), "valid")
    return found
