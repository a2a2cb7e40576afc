"""The default step of a stage that no step suits: few modes and much contact damping leave hardly any compliance that
a force of alternating sign meets. It is the step nearest to the limit, and the run stays stable.

Sees: a default step that falls through all tried steps to the shortest, whose γ is 0. With friction such a run gained a
thousand times its energy within 0.1 ms."""

from __future__ import annotations

from golden_stages import FAST, FRICTION, STEP, stages

TRIED = (7.5e-6, 5e-6, 2.5e-6, 1e-6, 0.5e-6)  # s
STABLE = 1e-3  # of the energy that dampers took; the run at the shortest step left 0.6 of what was stored


def lowered(h: float) -> float:
    """γ of a helical pair with 24 modes a gear, as the kernel's warning has it; 1 where it says nothing."""
    kernel = stages()["helical"].kernel({"level": FAST, "h": h} | FRICTION, None)
    kernel.prepare()
    said = kernel.warning
    return float(said.split("lowered to ")[1][:4]) if "gamma" in said else 1.0


def test_no_step_tried_is_nearer_to_the_limit_than_the_default() -> None:
    assert lowered(0.0) < 1.0, "the stage is no example of what is tested"
    assert lowered(0.0) >= max(map(lowered, TRIED)) - 0.01  # digits of the message


def test_few_modes_much_damping_and_friction_stay_stable() -> None:
    stage = stages()["helical"]
    kernel = stage.kernel({"level": FAST} | FRICTION, None)
    kernel.initialize()
    for i in range(stage.steps):
        stage.drive(kernel, i)
        kernel.step(i * STEP, STEP)
    assert kernel.get("solver.retried_steps") == 0
    assert abs(kernel.get("energy.residual")) < STABLE * kernel.get("energy.dissipated")
