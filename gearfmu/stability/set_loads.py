"""Scenes of load on the planetary set: through the backlash, reversal, rattle, too much, hardly any, at rest, jammed."""

from __future__ import annotations

import numpy as np

from gearfmu.stability.case import Case, Finding
from gearfmu.stability.checks import at_least, at_most
from gearfmu.stability.motion import Constant, Step
from gearfmu.stability.set_bench import (
    ALL_MESHES,
    MESHES,
    NOMINAL,
    PLAIN_SET,
    SPEED,
    Carried,
    carries,
    set_finding,
    set_run,
    steady,
)

TURNING = Constant(SPEED)
LIGHT, OVERLOAD = 100.0, 10.0  # N·m on the carrier; times its largest torque
INTERFERENCE = -20e-6  # m: backlash of the jammed set


def set_torque_step(case: Case) -> Finding:
    """The set with pins out of place at 85 rad/s: from 100 to 600 N·m on the carrier within 2 ms. All meshes ring and
    stay whole; in the end they carry the torque to 2 %."""
    made = set_run(PLAIN_SET, case, Carried(TURNING, (Step(0.004, 0.006, LIGHT, NOMINAL),)), 0.03)
    said, facts = carries(made, NOMINAL, 0.02)
    return set_finding(PLAIN_SET, made, said, facts)


def set_reversal(case: Case) -> Finding:
    """±600 N·m on the carrier within 5 ms, through the backlash of all eight meshes and back, at 85 rad/s. Every mesh
    is struck, and in between and at the end the meshes carry the torque to 3 %."""
    back = (Step(0.003, 0.008, NOMINAL, -NOMINAL), Step(0.022, 0.027, -NOMINAL, NOMINAL))
    made = set_run(PLAIN_SET, case, Carried(TURNING, back), 0.042)
    said, facts = carries(made, NOMINAL, 0.034, 0.03)
    for mesh in ALL_MESHES:
        said += at_least(f"impacts in {mesh}", made[f"{mesh}.impacts"][-1], 2)
        said += at_least(f"share of contact on the other flanks of {mesh}", _other(made[f"{mesh}.contact"]), 0.2)
    return set_finding(PLAIN_SET, made, said, facts)


def set_start_in_mid_backlash(case: Case) -> Finding:
    """No load at 85 rad/s: planets stand between sun and ring without contact; after 4 ms 600 N·m come within 4 ms.
    The meshes carry them to 2 % in the end."""
    made = set_run(PLAIN_SET, case, Carried(TURNING, (Step(0.004, 0.008, 0.0, NOMINAL),)), 0.03)
    said, facts = carries(made, NOMINAL, 0.02)
    before = made.time < 0.004
    touched = max(float(np.mean(made[f"{mesh}.contact"][before] != 0)) for mesh in MESHES["sun"])
    facts["contact_before"] = touched
    return set_finding(PLAIN_SET, made, said, facts)


def set_overload(case: Case) -> Finding:
    """From 600 N·m to ten times as much on the carrier within 5 ms, at 85 rad/s. The local law goes on along its
    tangent; the meshes carry the torque to 3 %."""
    load = Step(0.003, 0.008, NOMINAL, OVERLOAD * NOMINAL)
    made = set_run(PLAIN_SET, case, Carried(TURNING, (load,)), 0.03)
    said, facts = carries(made, OVERLOAD * NOMINAL, 0.02, 0.03)
    return set_finding(PLAIN_SET, made, said, facts)


def set_jammed(case: Case) -> Finding:
    """20 µm of interference instead of backlash in all eight meshes, 100 N·m: both flanks in contact all the time."""
    jam = {f"{mesh}.backlash": INTERFERENCE for mesh in ALL_MESHES}
    made = set_run(PLAIN_SET, case, Carried(TURNING, steady(LIGHT)), 0.02, jam)
    both = min(float(np.mean(made[f"{mesh}.contact"] == 2)) for mesh in ALL_MESHES)
    said = at_least("smallest share of contact on both flanks", both, 0.99)
    return set_finding(PLAIN_SET, made, said, {"both_flanks": both}, backlash=INTERFERENCE)


def _other(contact: np.ndarray) -> float:
    """Share of samples on the flank that is not the first sample's."""
    return float(np.mean(contact == -contact[0]))
