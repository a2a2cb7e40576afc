"""Steps at which friction used to make forces alternate: γ is lowered there, and there alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfmu.kernel.binding import status_words
from gearfmu.stage import StageModel, Steady, Trace, simulate

FAST, SPEED, TORQUE = 1.0, 2000 * math.pi / 30, 600.0


def rolling(model: StageModel, h: float, coefficient: float) -> Trace:
    """4 ms, every internal step recorded."""
    setting = {"level": FAST, "h": h, "effect.friction": 1.0, "friction_coefficient": coefficient}
    return simulate(model, Steady(model, SPEED, TORQUE), 4e-3, h, setting)


@pytest.mark.parametrize("h", [3.4e-6, 3.57e-6, 3.7e-6])
def test_forces_do_not_alternate_from_step_to_step(relieved: StageModel, h: float) -> None:
    """With the limit of frictionless contact the second difference of the force was 0.8 to 1.5 of its mean."""
    trace = rolling(relieved, h, 0.1)
    force = trace["mesh.force"]
    assert np.std(np.diff(force, 2)) < 0.03 * np.mean(force)
    assert trace["solver.retried_steps"][-1] == 0


@pytest.mark.parametrize(
    ("h", "coefficient", "lowered"), [(5e-6, 0.1, False), (3.57e-6, 1e-6, False), (3.57e-6, 0.1, True)]
)
def test_gamma_is_lowered_by_friction_alone(relieved: StageModel, h: float, coefficient: float, lowered: bool) -> None:
    status = int(rolling(relieved, h, coefficient)["solver.status"][-1])
    assert any("gamma" in word for word in status_words(status)) is lowered, status_words(status)
