"""The planetary set under friction of the flanks."""

from __future__ import annotations

from evidence.stability.case import Case, Finding
from evidence.stability.checks import at_least
from evidence.stability.motion import Constant, Step
from evidence.stability.rubbing import MU
from evidence.stability.set_bench import ALL_MESHES, NOMINAL, PLAIN_SET, SPEED, Carried, carries, set_finding, set_run

FRICTION = {"effect.friction": 1.0, **{f"{mesh}.friction_coefficient": MU for mesh in ALL_MESHES}}


def set_rubbing_reversal(case: Case) -> Finding:
    """Friction in all eight meshes and ±600 N·m on the carrier within 5 ms, through the backlash and back, at 85 rad/s.
    Every mesh is struck, and at the end the meshes carry the torque to 6 %, which friction takes from."""
    back = (Step(0.003, 0.008, NOMINAL, -NOMINAL), Step(0.022, 0.027, -NOMINAL, NOMINAL))
    made = set_run(PLAIN_SET, case, Carried(Constant(SPEED), back), 0.042, FRICTION)
    said, facts = carries(made, NOMINAL, 0.034, 0.06)
    for mesh in ALL_MESHES:
        said += at_least(f"impacts in {mesh}", made[f"{mesh}.impacts"][-1], 2)
    return set_finding(PLAIN_SET, made, said, facts)
