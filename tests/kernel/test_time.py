"""Communication times as tools hand them over: n·H, or accumulated with rounding noise in time and step, give the
same bits."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from driven import give
from small_model import pair_blob

from gearfmu.errors import SimulationError
from gearfmu.kernel import Kernel

H, STEPS = 1e-4, 600


def forces(start: float, times: np.ndarray) -> list[bytes]:
    """Mesh force and state time after every step from times[i] to times[i + 1]; inputs depend on the number of the
    step alone."""
    kernel = Kernel(pair_blob(("spring", "spring")), {"level": 1})
    give(kernel, {"pinion.w": 100.0, "wheel.w": -100.0 * 16 / 24})
    kernel.initialize(start)
    found = []
    for i in range(times.size - 1):
        give(kernel, {"pinion.phi": 5e-3 + 100.0 * i * H, "wheel.phi": 4e-3 - 100.0 * 16 / 24 * i * H})
        kernel.step(times[i], times[i + 1] - times[i])
        found.append(np.array([kernel.get(name) for name in ("mesh.force", "mesh.te", "solver.steps")]).tobytes())
    return found


@pytest.mark.parametrize("start", [0.0, 3.7, 1000.0])
def test_accumulated_times_give_the_bits_of_counted_ones(start: float) -> None:
    counted = start + H * np.arange(STEPS + 1)
    accumulated = np.cumsum([start, *[H] * STEPS])
    assert start == 0.0 or not np.array_equal(np.diff(accumulated), np.full(STEPS, H))
    first = accumulated[1] - accumulated[0]
    counted[1:] = counted[0] + first * np.arange(1, STEPS + 1)
    assert forces(start, counted) == forces(start, accumulated)


@pytest.mark.parametrize("reference", [0.0, 1.0])
def test_angles_are_taken_but_for_whole_turns(reference: float) -> None:
    """A host that wraps angles to ±π, or starts a turn away, gives the run of one that does not; also of a state saved
    after the first wrap, which holds the turns. Without them a wrap was a jump of 2π: tooth penetration. 1e-15 rad more
    of the angle move the force by 2e-8."""

    def outputs(wrap: Callable[[float], float], saved: int) -> np.ndarray:
        kernel = Kernel(pair_blob(("spring", "spring")), {"level": 1, "phi_reference": reference})
        give(kernel, {"pinion.w": 100.0, "wheel.w": -100.0 * 16 / 24})
        rows = []
        for i in range(STEPS):
            kernel.set("pinion.phi", wrap(1e-3 + 2e-3 * min(1.0, i / 100) + 100.0 * i * H))
            kernel.set("wheel.phi", wrap(-100.0 * 16 / 24 * i * H))
            if i == 0:
                kernel.initialize(0.0)
            if i == saved:
                state = kernel.save()
                kernel.step(i * H, H)
                kernel.restore(state)
            kernel.step(i * H, H)
            rows.append([kernel.get(name) for name in ("mesh.force", "pinion.tau", "pinion.gear.phi")])
        return np.array(rows)

    straight = outputs(lambda phi: phi, -1)
    wrapped = outputs(lambda phi: math.remainder(phi, math.tau), 400)
    assert np.all(np.abs(straight[:, (0, 2)]).max(axis=0) > (10.0, math.pi))
    assert np.all(np.abs(wrapped - straight) < 1e-7 * np.abs(straight).max(axis=0))


def test_a_step_that_is_not_at_the_present_time_is_refused_and_changes_nothing() -> None:
    kernel = Kernel(pair_blob(("spring", "spring")), {"level": 1})
    kernel.initialize(0.0)
    kernel.step(0.0, H)
    before = kernel.save()
    for time, step in ((0.0, H), (3 * H, H), (H, -H), (H, 0.0), (H, float("nan")), (float("inf"), H)):
        with pytest.raises(SimulationError) as caught:
            kernel.step(time, step)
        assert caught.value.outcome == "bad_step" and kernel.save() == before


@pytest.mark.parametrize("time", [math.nan, math.inf])
def test_a_start_at_no_time_is_refused(time: float) -> None:
    kernel = Kernel(pair_blob(("spring", "spring")), {"level": 1})
    with pytest.raises(SimulationError) as caught:
        kernel.initialize(time)
    assert caught.value.outcome == "bad_value"
    kernel.initialize(0.0)
