"""The default step of a stage that no step suits: few modes and much contact damping leave hardly any compliance that
a force of alternating sign meets. It then is the step that comes nearest to the limit, and the run stays stable.

Sees: a default step that falls through all tried steps to the shortest, whose γ is 0; with friction such a run gained a
thousand times its energy within 0.1 ms."""

from __future__ import annotations

import pytest
from kinds import KINDS, Kind

FRICTION = {"effect.friction": 1.0, "friction_coefficient": 0.05}
STEPS = (7.5e-6, 5e-6, 2.5e-6, 1e-6, 0.5e-6)  # s
STABLE = 2e-3  # of the exchanged energy; the fallen step left 0.09


def lowered(kind: Kind, h: float) -> float:
    """γ of the run that the kernel warns of, 1 where it says nothing."""
    kernel = kind.model().driven_by_springs().kernel(level=1.0, h=h, **FRICTION)
    kernel.prepare()
    said = kernel.warning
    return float(said.split("gamma lowered to ")[1].split(";")[0]) if "gamma" in said else 1.0


@pytest.mark.parametrize("name", ["pair", "internal"])
def test_no_step_tried_is_nearer_to_the_limit_than_the_default(name: str) -> None:
    kind = KINDS[name]
    assert lowered(kind, 0.0) >= max(lowered(kind, h) for h in STEPS) - 0.01  # digits of the message


def test_few_modes_much_damping_and_friction_stay_stable() -> None:
    kind = KINDS["internal"]
    trace = kind.run(kind.model(), FRICTION)
    assert trace.meta["outcome"] == "completed"
    assert abs(trace.meta["energy_residual"]) < STABLE
    assert trace["solver.retried_steps"][-1] == 0
