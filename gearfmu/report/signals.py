"""What a trace tells about itself: which shafts it has, where it is in steady operation, how fast the teeth mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.report.metrics import mesh_angle
from gearfmu.stage.trace import Trace

GEAR_SPEED = ".gear.w"
GEAR_PHI = ".gear.phi"
LOCKED = ".clutch.locked"
SETTLED = "after the scene's settling time"


@dataclass(frozen=True)
class Window:
    """The part of a run that spectra are taken from: start, end in s, and why it is that part."""

    start: float
    end: float
    reason: str


def shafts(trace: Trace) -> list[str]:
    """Shaft names, in the trace's order, pinion first: all X with a channel "X.gear.w" or "bearing.X.…"."""
    found = [name.removesuffix(GEAR_SPEED) for name in trace.channels if name.endswith(GEAR_SPEED)]
    found += [name.split(".")[1] for name in trace.channels if name.startswith("bearing.") and name.count(".") == 2]
    return list(dict.fromkeys(found))


def teeth(trace: Trace, spec: Any = None) -> dict[str, int]:
    """Tooth numbers by shaft, from the StageSpec or the trace's meta "teeth"; empty when neither says."""
    if spec is not None:
        return {gear.name: int(gear.teeth) for gear in spec.gears}
    return {str(name): int(z) for name, z in dict(trace.meta.get("teeth") or {}).items()}


def angle_of_mesh(trace: Trace, tooth_numbers: dict[str, int]) -> np.ndarray | None:
    """Mesh angle (n,) rad of the first shaft whose speed and tooth number are known; None when there is none."""
    for shaft, number in tooth_numbers.items():
        if shaft + GEAR_SPEED in trace:
            return mesh_angle(trace.time, trace[shaft + GEAR_SPEED], number)
    return None


def lock_time(trace: Trace) -> float | None:
    """Time in s from which a clutch stays locked to the end; None without a clutch or when it slips at the end."""
    for name in trace.channels:
        if name.endswith(LOCKED):
            return _last_rise(trace.time, trace[name].astype(bool))
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
    return Window(start, end, "the whole run")


def spans(time: np.ndarray, mask: np.ndarray) -> list[tuple[float, float]]:
    """Intervals (start, end) in s where mask (n,) holds, each to the sample after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return [(float(time[a]), float(time[min(b, time.size - 1)])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _last_rise(time: np.ndarray, locked: np.ndarray) -> float | None:
    if not locked[-1]:
        return None
    slipping = np.flatnonzero(~locked)
    return float(time[0] if slipping.size == 0 else time[slipping[-1] + 1])
