"""Scenes of effects on the planetary set: all of them at once, and every one switched off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from evidence.stability.case import COMPLETED, Case, Finding
from evidence.stability.checks import at_most
from evidence.stability.motion import Constant, Step
from evidence.stability.set_bench import (
    MESHES,
    NOMINAL,
    PLAIN_SET,
    SPEED,
    Carried,
    SetVariant,
    carries,
    set_finding,
    set_run,
    steady,
)
from gearfmu.spec.tables.ports import PortSpec

EFFECTS = (
    "residual",
    "hertz",
    "coast_flank",
    "contact_damping",
    "tip_relief",
    "tip_contact",
    "bearings",
    "modal_damping",
    "elastic",
    "roll_motion",
    "coriolis",
    "centrifugal",
    "gyroscopic",
)
COAST = "coast_flank"  # a driving carrier presses planets on the ring by its drive flanks: no others may push
FROZEN = "roll_motion"  # without it a turning mesh jams along the slope of its relief: run at rest
PAPER = "paper"  # the level at which the residual may be left out: all modes are dynamic
SHORT = 2e-3  # s
FAST = 300.0  # rad/s of the carrier
HELD = SetVariant(ring=PortSpec(kind="spring", k=2e6, c=20.0))


def set_all_effects(case: Case) -> Finding:
    """Everything at once: all effects, ten slices, pins out of place, the ring on a spring, the carrier at its largest
    speed, 300 rad/s, where Coriolis and centrifugal loads are largest, and a torque that goes through the backlash."""
    parameters = {f"effect.{name}": 1.0 for name in EFFECTS} | {"slices": 10.0}
    load = (Step(0.003, 0.006, NOMINAL, -NOMINAL), Step(0.01, 0.013, -NOMINAL, NOMINAL))
    made = set_run(HELD, case, Carried(Constant(FAST), load), 0.028, parameters)
    said, facts = carries(made, NOMINAL, 0.02, 0.03)
    return set_finding(HELD, made, said, facts)


def set_each_effect_off(case: Case) -> Finding:
    """Twelve runs of 2 ms under 600 N·m at 85 rad/s (at rest with the mesh frozen),
    each with another effect switched off: all finite, the energy balance closed, no step unsolved. The row is that of
    the run whose balance leaves most."""
    findings: dict[str, Finding] = {}
    said: list[str] = []
    for name in EFFECTS:
        found = _without(case, name)
        said += [f"without {name}: {complaint}" for complaint in found.complaints]
        said += [f"without {name}: {found.outcome}"] if found.outcome != COMPLETED and not found.complaints else []
        findings[name] = found
    worst = max(findings.values(), key=lambda found: found.energy_residual)
    facts = {f"energy_without_{name}": found.energy_residual for name, found in findings.items()}
    seconds = float(np.mean([found.realtime_factor for found in findings.values()]))
    outcome = "failed" if said else COMPLETED
    deepest = max(found.penetration for found in findings.values())
    return Finding(outcome, worst.h, worst.energy_residual, deepest, seconds, tuple(said), facts)


def _without(case: Case, name: str) -> Finding:
    off: Mapping[str, float] = {f"effect.{name}": 0.0}
    level = PAPER if name == "residual" else case.level
    speed = 0.0 if name == FROZEN else SPEED
    made = set_run(PLAIN_SET, replace(case, level=level), Carried(Constant(speed), steady(NOMINAL)), SHORT, off)
    said: list[str] = []
    if name == COAST:
        for mesh in MESHES["ring"]:
            said += at_most(f"force on coast flanks of {mesh}", float(made[f"{mesh}.force_coast"].max()), 0.0)
    return set_finding(PLAIN_SET, made, said, {})
