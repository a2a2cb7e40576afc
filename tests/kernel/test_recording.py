"""Runs whose rows the kernel writes itself: those of single steps, to the bit; what is made until a failure is kept."""

from __future__ import annotations

import numpy as np
import pytest
from driven import begun, give, stepped
from small_model import pair_blob

from gearfmu.errors import ModelError, SimulationError
from gearfmu.kernel import Kernel
from gearfmu.kernel.instance import Recording

H, STEPS = 2e-5, 60  # s; communication steps
NAMES = ("mesh.force", "mesh.te", "energy.work", "solver.steps")


def started(**parameters: float) -> Kernel:
    return begun(Kernel(pair_blob(("spring", "spring")), {"level": 1.0, **parameters}), {"pinion.phi": 6e-3})


def given(steps: int) -> dict[str, np.ndarray]:
    times = np.arange(steps) * H
    return {
        "pinion.phi": 6e-3 + 200.0 * times,
        "pinion.w": np.full(steps, 200.0),
        "wheel.phi": -200.0 * 16 / 24 * times,
    }


def test_rows_are_those_of_single_steps() -> None:
    one, kernel, inputs = started(), started(), given(STEPS)
    record, wanted = Recording(one, NAMES, STEPS, H), [kernel.get(name) for name in NAMES]
    for first, last in ((0, 1), (1, 30), (30, STEPS)):
        record.advance(last - first, {name: values[first:last] for name, values in inputs.items()})
    told = lambda i: give(kernel, {name: float(values[i]) for name, values in inputs.items()})  # noqa: E731
    wanted = np.vstack([wanted, stepped(kernel, STEPS, H, *NAMES, before=told)])
    assert record.done == STEPS and np.array_equal(record.rows, wanted) and np.ptp(record.rows[:, 0]) > 0


def test_a_refused_input_is_named_and_what_was_made_is_kept() -> None:
    record, inputs = Recording(started(), NAMES, STEPS, H), given(STEPS)
    inputs["pinion.w"][7] = np.nan
    with pytest.raises(ModelError, match="pinion.w = nan"):
        record.advance(STEPS, inputs)
    assert record.done == 7 and record.kernel.time == pytest.approx(7 * H) and np.all(np.isfinite(record.rows[:8]))
    with pytest.raises(ModelError, match="level = 2"):
        record.advance(1, {"level": np.array([2.0])})


def test_a_step_that_fails_ends_the_rows() -> None:
    """Shaft ends that jump apart by half a turn press the teeth through each other."""
    record, inputs = Recording(started(), NAMES, STEPS, H), given(STEPS)
    inputs["pinion.phi"][30:] += 3.0
    with pytest.raises(SimulationError, match="last good time"):
        record.advance(STEPS, inputs)
    assert 30 <= record.done < STEPS and np.all(np.isfinite(record.rows[: record.done + 1]))
