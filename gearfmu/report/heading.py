"""Head of a report: the stage and its operating point, and the key numbers of a planetary set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from gearfmu.report.mesh_cycle import face_load_factor, static_face_load_factor
from gearfmu.report.names import mesh_words, minus
from gearfmu.report.plots import RPM
from gearfmu.report.results import dynamic_factors
from gearfmu.report.run import Run
from gearfmu.report.signals import GEAR_SPEED, input_shaft, mesh_speed, steady
from gearfmu.stagefile.forms.general import Stage, ToothedBody

PHASE = 1e-3  # pitches: of a phase taken as 0 or ½


def operating_point(run: Run) -> list[str]:
    """Torque and speed of the input within the window of the results, as far as they were recorded: one number where
    they are steady, else the largest torque and the range of the speed: "302 N·m", "2000 rpm"."""
    part, found = run.part, []
    name = input_shaft(part)
    torque = next((n for n in (f"{name}.tau_mean", f"{name}.tau", f"drive.{name}.tau") if n in part), None)
    if torque is not None and np.any(part[torque]):
        values = np.abs(part[torque])
        found.append(f"{_round(values.mean()):.5g} N·m" if steady(values) else f"up to {values.max():.4g} N·m")
    speed = f"{name}{GEAR_SPEED}"
    if speed in part and np.any(part[speed]):
        values = np.abs(part[speed]) * RPM
        low, mean, high = (f"{_round(v):.5g}" for v in (values.min(), values.mean(), values.max()))
        found.append(f"{mean} rpm" if steady(values) else f"{low} … {high} rpm")
    return found


def _round(value: float) -> float:
    """Three digits, of four digits before the point four."""
    return float(f"{value:.4g}") if value >= 1000 else float(f"{value:.3g}")


def of_set(run: Run) -> list[tuple[str, str]]:
    """Key numbers of a planetary set over the window: torques, speeds, ratio, mesh frequency, phasing of the planets,
    K_γ, K_Hβ, dynamic factor; those that were not recorded are left out."""
    own = run.planets
    assert own is not None
    part, found = run.part, []
    bodies = ["sun", own.carrier, "ring"]
    means = {
        name: float(np.mean(part[n]))
        for name in bodies
        if (n := next((n for n in _torques(name) if n in part), "")) and np.any(part[n])
    }
    if means:
        found.append(("Torques, mean", ", ".join(f"{name} {minus(f'{v:.4g}')} N·m" for name, v in means.items())))
    speeds = {n: float(np.mean(part[f"{n}{GEAR_SPEED}"])) for n in bodies if f"{n}{GEAR_SPEED}" in part}
    if speeds:
        # below 0.05 rpm: elastic motion of a gear that is held
        rpm = {name: v * RPM if abs(v * RPM) >= 0.05 else 0.0 for name, v in speeds.items()}
        found.append(("Speeds, mean", ", ".join(f"{name} {minus(f'{v:.4g}')} rpm" for name, v in rpm.items())))
    if speeds.get("sun") and abs(speeds.get(own.carrier, 0.0)) > 1e-9:
        found.append(("Ratio, speed of the sun over that of the carrier", f"{speeds['sun'] / speeds[own.carrier]:.4g}"))
    frequency = mesh_speed(part, own) / (2 * math.pi)
    if frequency > 1e-3:
        found.append(("Mesh frequency", f"{frequency:.4g} Hz"))
    return found + _phasing(run) + _factors(run)


def _phasing(run: Run) -> list[tuple[str, str]]:
    if run.spec is None or run.planets is None:
        return []
    phases = planet_phases(run.spec, run.planets.planets, list(run.planets.meshes))
    return [
        (f"Planets at the {central}", f"{phasing(own)} ({', '.join(f'{_fraction(p)}' for p in own)} of a pitch)")
        for central, own in phases.items()
    ]


def _fraction(phase: float) -> str:
    return "½" if abs(phase - 0.5) < PHASE else f"{phase:.3g}" if phase > PHASE else "0"


def planet_phases(stage: Stage, planets: Sequence[str], central: Sequence[str]) -> dict[str, list[float]]:
    """Phase of the mesh of every planet with each central gear, by its name: pitches behind that of the first planet,
    0 … 1, from teeth and places."""
    axes = [stage.rotors[stage.rotor_of(planet)].axis for planet in planets]
    places = np.array([math.atan2(float(y), float(x)) for x, y in axes])
    found = {}
    for name in central:
        body = stage.bodies.get(name)
        if isinstance(body, ToothedBody):
            pitches = np.mod(body.teeth * (places - places[0]) / (2 * math.pi), 1.0)
            found[name] = [float(p) if 1.0 - p > PHASE else 0.0 for p in pitches]
    return found


def phasing(phases: Sequence[float]) -> str:
    """Phasing of planets whose meshes lag by `phases` pitches (Kahraman 1994; Parker 2000): in phase where all are
    equal, counter-phased where half of them lag by half a pitch, sequentially phased where first harmonics cancel."""
    lag = np.exp(2j * math.pi * np.asarray(phases))
    if np.allclose(lag, 1.0, atol=10 * PHASE):
        return "in phase"
    if abs(lag.sum()) > 10 * PHASE:
        return "unequally phased"
    return "counter-phased" if np.allclose(lag**2, 1.0, atol=10 * PHASE) else "sequentially phased"


def _torques(name: str) -> tuple[str, ...]:
    """Channels with the torque on a shaft, or of the ring on its mounts."""
    return f"{name}.tau_mean", f"{name}.tau", f"drive.{name}.tau", f"bearing.{name}.mz_mean", f"bearing.{name}.mz"


def _factors(run: Run) -> list[tuple[str, str]]:
    """K_γ and K_Hβ at every central gear, the latter of the run where forces of slices were recorded, else of the
    statics; dynamic factor."""
    assert run.planets is not None
    found, over_width = [], []
    for central, meshes in run.planets.meshes.items():
        if known := {mesh: run.mean_shares[mesh] for mesh in meshes.values() if mesh in run.mean_shares}:
            found.append((f"K_γ at the {central}, largest mean share", _largest(known)))
        of_run = {mesh: factor for mesh in meshes.values() if (factor := face_load_factor(run.part, mesh)) is not None}
        of_statics = {mesh: static_face_load_factor(run.loads[mesh]) for mesh in meshes.values() if mesh in run.loads}
        if known := of_run or of_statics:
            how = "largest" if of_run else "quasi-static"
            over_width.append((f"K_Hβ at the {central}, {how}: most loaded slice over the mean", _largest(known)))
    factors = {
        name.removesuffix("dynamic_factor").rstrip("_"): value
        for name, value in dynamic_factors(run.trace).items()
        if math.isfinite(value)
    }
    return found + over_width + ([("Dynamic factor, largest", _largest(factors))] if factors else [])


def _largest(known: Mapping[str, float]) -> str:
    """The largest number and its mesh."""
    mesh = max(known, key=lambda name: known[name])
    return f"{known[mesh]:.3f}" + (f" ({mesh_words(mesh)})" if mesh else "")
