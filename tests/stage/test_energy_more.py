"""Around the energy of the step: changes of h, the start of a free train, the limits of central and the level
explicit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from evidence.energy.free import FreePair, Rattle, energies, started
from gearfmu.errors import ModelError, SimulationError
from gearfmu.kernel import Kernel

FAST, FULL, EXPLICIT = 1, 3, 5
CENTRAL = 3


def changes_of_h(free: FreePair, steps: tuple[float, float], h: float = 7.5e-6) -> float:
    """Largest relative change of stored energy over 50 ms of undamped frozen rattle whose communication step alternates
    between two lengths (s); sampled after the first of them."""
    kernel = started(free, Rattle(position=0.3), {"level": FAST, "h": h})
    time, samples = 0.0, []
    while time < 0.05:
        for number, step in enumerate(steps):
            kernel.step(time, step)
            time += step
            if number == 0:
                samples.append(kernel.get("energy.stored"))
    return float(np.ptp(samples) / samples[0])


def test_changes_of_h_cost_little(relieved_free: FreePair) -> None:
    """Communication steps of 50 and 60 µs in turn, 900 changes: rounding without them. Speeds stay, so that the energy
    of the step goes up and down by what it is apart from that of the motion: 2.2e-2 measured, at half of h 2.8e-3."""
    assert changes_of_h(relieved_free, (50e-6, 50e-6)) < 1e-5
    coarse, fine = (changes_of_h(relieved_free, (50e-6, 60e-6), h) for h in (7.5e-6, 3.75e-6))
    assert coarse < 4e-2 and fine < 0.3 * coarse


@pytest.mark.parametrize("position", [0.3, 0.8])
@pytest.mark.parametrize("motion", [0.0, 1.0])
def test_a_free_train_goes_on_with_the_force_it_starts_with(
    relieved_free: FreePair, position: float, motion: float
) -> None:
    """Also where tip relief turns the torque arms by different shares, so that the train accelerates (0.3)."""
    parameters = {"level": 0, "h": 1e-6, "effect.roll_motion": motion}
    kernel = started(relieved_free, Rattle(position=position, load=302.0, speed=0.0), parameters)
    before = kernel.get("mesh.force")
    kernel.step(0.0, 1e-6)
    assert kernel.get("mesh.force") == pytest.approx(before, rel=1e-6) and before > 8000


def test_level_explicit_is_central_with_all_modes_below_its_limit(relieved_free: FreePair) -> None:
    kernel = started(relieved_free, Rattle(), {"level": EXPLICIT})
    full = started(relieved_free, Rattle(), {"level": FULL, "h": 1e-7})
    kernel.step(0.0, 1e-4)
    assert kernel.get("solver.n_dyn") == full.get("solver.n_dyn") and 1e-6 < kernel.get("solver.h") < 1.5e-6


def predicted_limit(kernel: Kernel) -> float:
    """Limit of stability of central, from its default step; infinite when another rule sets that."""
    kernel.step(0.0, 1e-3)
    h = kernel.get("solver.h")
    return h / 0.9 if h < 7e-6 else math.inf


def measured_limit(free: FreePair, level: int, predicted: float) -> float:
    """Largest of a ladder of steps at which 5 ms of undamped contact, jammed to about full load, keep their energy
    within 10 %, s."""
    largest = 0.0
    for factor in (0.7, 0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.2, 1.3, 1.4):
        h = factor * predicted
        try:
            kernel = started(free, Rattle(play=-60e-6, speed=0.05), {"level": level, "integrator": CENTRAL, "h": h})
            found = energies(kernel, h, 0.005)
        except (ModelError, SimulationError):
            break
        if not found.drift < 0.1:
            break
        largest = h
    return largest


def test_central_is_warned_above_its_limit_and_refused_far_above(relieved_free: FreePair) -> None:
    limit = predicted_limit(started(relieved_free, Rattle(), {"level": FAST, "integrator": CENTRAL}))
    parameters = {"level": FAST, "integrator": CENTRAL}
    assert started(relieved_free, Rattle(), {**parameters, "h": 0.95 * limit}).warning == ""
    assert "limit of stability" in started(relieved_free, Rattle(), {**parameters, "h": 1.1 * limit}).warning
    with pytest.raises(ModelError, match="use h <="):
        started(relieved_free, Rattle(), {**parameters, "h": 1.6 * limit})


def test_runs_confirm_the_predicted_limit(relieved_free: FreePair) -> None:
    """Stable just below it; unstable some way above (the prediction is for the stiffest roll position)."""
    predicted = predicted_limit(started(relieved_free, Rattle(), {"level": FAST, "integrator": CENTRAL}))
    measured = measured_limit(relieved_free, FAST, predicted)
    assert 0.95 * predicted < measured < 1.3 * predicted
