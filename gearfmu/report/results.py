"""The numbers to compare runs by, and their strict JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from gearfmu.cosim.accuracy import alternating, rms
from gearfmu.report.signals import GEAR_SPEED, SETTLED, bearings, drive_side, lock_time, meshes, window_of_interest
from gearfmu.stage.run.trace import Trace

REACHED_THE_END = ("completed", "ok")  # outcomes of a run
LOADED = 0.1  # of the largest static force: below it there is hardly a load to refer to


def key_results(trace: Trace) -> dict[str, float]:
    """The numbers to compare runs by, over the window of interest; names carry the unit. Peaks are left out: they do
    not repeat.

    "ac" is the signal minus its mean where the scene has a settling time (steady running), else minus a 10 ms moving
    average. Of several meshes every name begins with that of the mesh.
    """
    window = window_of_interest(trace)
    part = trace.window(window.start, window.end)
    steady = window.reason == SETTLED
    found: dict[str, float] = {}
    several = len(meshes(trace)) > 1
    for mesh in meshes(trace):
        own = _mesh_results(trace, part, mesh, steady)
        found |= {f"{mesh}_{key}" if several else key: value for key, value in own.items()}
    for bearing in bearings(part):
        forces = [name for d in "xy" if (name := f"bearing.{bearing}.f{d}") in part]
        if len(forces) == 2:
            found[f"bearing_{bearing}_rms_ac_N"] = math.hypot(*[_rms_ac(part, name, steady) for name in forces])
    locked = lock_time(trace)
    if locked is not None:
        found["lock_time_s"] = locked
    return found


def _mesh_results(trace: Trace, part: Trace, mesh: str, steady: bool) -> dict[str, float]:
    """Numbers of one engagement; part: the window of interest of the trace."""
    found: dict[str, float] = {}
    if f"{mesh}.force" in part:
        found["mesh_force_mean_N"] = float(np.mean(part[f"{mesh}.force"]))
        found["mesh_force_rms_ac_N"] = _rms_ac(part, f"{mesh}.force", steady)
    if f"{mesh}.te" in part:
        found["te_mean_um"] = 1e6 * float(np.mean(part[f"{mesh}.te"]))
        found["te_rms_ac_um"] = 1e6 * _rms_ac(part, f"{mesh}.te", steady)
    if f"{mesh}.contact" in trace:
        found["contact_loss_percent"] = 100 * float(np.mean(trace[f"{mesh}.contact"] == 0))
        found["coast_contact_percent"] = 100 * float(np.mean(trace[f"{mesh}.contact"] == -drive_side(trace, mesh)))
    if f"{mesh}.impacts" in trace:
        found["impacts"] = float(trace[f"{mesh}.impacts"][-1])
    return found


def _rms_ac(trace: Trace, name: str, steady: bool) -> float:
    interval = float(trace.time[-1] - trace.time[0]) / max(trace.time.size - 1, 1)
    return rms(alternating(trace[name], interval, steady or interval <= 0))


def dynamic_factors(trace: Trace) -> dict[str, float]:
    """Largest mesh force over the static one within the window of interest, by name ("dynamic_factor", of several
    meshes behind that of the mesh).

    Static is the mean where the scene has a settling time, else the 10 ms moving average, looked at where it is at
    least LOADED of its largest. The largest force of a step replaces its sample where it was recorded (X.force_max).
    K_v of ISO 6336-1 is meant, as far as a simulation has it: of the normal force, its largest value in this run.
    """
    window = window_of_interest(trace)
    part, names = trace.window(window.start, window.end), meshes(trace)
    found = {}
    for mesh in names:
        if f"{mesh}.force" not in part or part.time.size < 2:
            continue
        force = np.asarray(part[f"{mesh}.force"], dtype=float)
        interval = float(part.time[-1] - part.time[0]) / (part.time.size - 1)
        static = np.abs(force - alternating(force, interval, window.reason == SETTLED))
        peak = np.abs(part[f"{mesh}.force_max"] if f"{mesh}.force_max" in part else force)
        loaded = static >= LOADED * static.max()
        if static.max() > LOADED * peak.max():
            name = f"{mesh}_dynamic_factor" if len(names) > 1 else "dynamic_factor"
            found[name] = float(np.max(peak[loaded] / static[loaded]))
    return found


def port_work(trace: Trace) -> float:
    """J: work through the ports of a stage, ∫|torque · speed| dt, over all of its shafts whose torque and speed were
    recorded; that of the trace's meta "exchanged_work_J" where there is one."""
    known = trace.meta.get("exchanged_work_J")
    if known is not None:
        return float(known)
    ports = [name.removesuffix(".tau") for name in trace.channels if name.endswith(".tau")]
    ports = [name for name in ports if f"{name}{GEAR_SPEED}" in trace]
    power = sum(np.abs(trace[f"{name}.tau"] * trace[f"{name}{GEAR_SPEED}"]) for name in ports)
    return float(trapezoid(power, trace.time)) if ports else 0.0


def energy_balance(trace: Trace) -> dict[str, float]:
    """Residual of the energy balance of the stage at the end over the work through its ports; empty where either was
    not recorded."""
    work = port_work(trace)
    if "energy.residual" not in trace or not work:
        return {}
    return {"energy_residual_of_port_work": float(trace["energy.residual"][-1]) / work}


def strict(value: object) -> Any:
    """`value` as plain JSON: numpy scalars become Python's, numbers that are not finite become null."""
    if isinstance(value, Mapping):
        return {str(key): strict(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [strict(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, (int, float, str, type(None))) else str(value)
