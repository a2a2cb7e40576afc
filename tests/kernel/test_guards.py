"""Guards around the internal step: what makes each bit of solver.status, steps that are halved, the energy guard."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from builds import edited_library
from driven import begun, stepped
from small_model import BASE, LENGTH, PSI, TEETH, WORKING, pair_blob

from gearfmu.errors import ModelError, SimulationError
from gearfmu.kernel import Kernel
from gearfmu.stage.assembly.blob import read_blob, write_blob

STEP = 2e-5  # s, communication step: three internal ones
QUARTER = math.pi / 2 / TEETH[0]  # rad of the pinion: a quarter of a pitch, what one step may turn it
BEYOND_THE_LAW, FALLBACK, ROUNDS = 1, 2, 4
TORQUE, SPEED = 32, 64
BAD_CALL, DIVERGED, ENERGY = 4, 8, 10
WIDTH, STRIP, YIELD = 14e-3, 1e-3, 2 * (1 - 0.3**2) / (math.pi * 206e9)  # of the small pair: m, m, 1/Pa


def spinning(speed: float, **parameters: float) -> Kernel:
    """Both gears turn freely at the speed (rad/s) of the pinion, and do not touch."""
    kernel = Kernel(pair_blob(("torque", "torque")), parameters)
    return begun(kernel, {"pinion.w_start": speed, "wheel.w_start": -speed * TEETH[0] / TEETH[1]})


def status(kernel: Kernel) -> int:
    """Without the bits of torque_max and speed_max, which these runs pass at will: stage/test_limits.py."""
    return int(kernel.get("solver.status")) & ~(TORQUE | SPEED)


@pytest.mark.parametrize("hertz", [1.0, 0.0])
def test_bit_1_says_that_the_patch_is_wider_than_the_local_law_reaches(hertz: float) -> None:
    """The law ends where the Hertz half-width is two thirds of the strip's: F = L (strip/1.5)²/β (theory, 2.4)."""
    roll = BASE[0] * (PSI[0] + WORKING)
    beta = 4 * YIELD / (1 / roll + 1 / (LENGTH - roll))
    limit = WIDTH * (STRIP / 1.5) ** 2 / beta
    for force, beyond in ((0.9 * limit, False), (3.5 * limit, True)):  # three pairs share the larger one
        kernel = Kernel(pair_blob(("torque", "fixed")), {"effect.hertz": hertz, "slices": 1})
        begun(kernel, {"pinion.tau": force * BASE[0]})
        kernel.step(0.0, 1e-6)
        assert kernel.get("mesh.force") == pytest.approx(force, rel=0.1) and kernel.get("mesh.pairs") <= 3
        assert status(kernel) == (BEYOND_THE_LAW if beyond and hertz else 0)


def test_bit_2_says_that_the_fallback_was_tried() -> None:
    """So fast that even an eighth of a step turns the gears by more than a quarter of a pitch, with whatever scheme:
    the run stops with a name; after shorter steps the bit is seen."""
    kernel = spinning(8.5 * QUARTER / 10e-6, h=10e-6)
    assert kernel.try_step(0.0, 10e-6) == DIVERGED and kernel.time == 0.0
    assert kernel.try_step(0.0, 1e-7) == 0
    assert (
        status(kernel) == FALLBACK and kernel.get("solver.retried_steps") == 4
    )  # the step, its half, quarter and eighth


def test_bit_4_says_that_rounds_ran_out() -> None:
    """The shipped step finds its balance in all of these; a build that may not look for it leaves steps in which
    contacts change unsolved."""
    hasty = edited_library("hasty", {r"GK_ENERGY_LIMIT 12": "GK_ENERGY_LIMIT 0"}, "checked float")
    for library, expected in ((None, 0), (hasty, ROUNDS)):
        found = [_loaded(library, speed, torque) for speed in (200.0, 400.0) for torque in (300.0, 600.0)]
        assert all(bits & ROUNDS == expected for bits in found), found


def _loaded(library: Path | None, speed: float, torque: float) -> int:
    kernel = Kernel(pair_blob(("torque", "torque")), {"level": 0}, library)
    ratio = TEETH[1] / TEETH[0]
    speeds = {"pinion.w_start": speed, "wheel.w_start": -speed / ratio}
    stepped(begun(kernel, speeds | {"pinion.tau": torque, "wheel.tau": torque * ratio}), 400, STEP)
    return status(kernel)


@pytest.mark.parametrize("turned, halves", [(0.9, 1), (1.1, 2), (1.9, 2), (2.1, 4), (3.9, 4), (4.1, 8), (6.0, 8)])
def test_a_step_that_would_turn_the_gears_too_far_is_halved_until_it_does_not(turned: float, halves: int) -> None:
    """`turned` quarters of a pitch in one internal step, from the first on. A free gear's motion is exact with any
    step: φ = ωt, and no energy is lost."""
    kernel = spinning(turned * QUARTER / (STEP / 3))
    stepped(kernel, 20, STEP)
    angle = turned * QUARTER * 60
    assert kernel.get("solver.steps") == 60 * halves and kernel.get("solver.retried_steps") == 60 * (halves - 1)
    assert kernel.get("pinion.phi") == pytest.approx(angle, rel=1e-13) and status(kernel) == 0
    assert abs(kernel.get("energy.residual")) < 1e-13 * kernel.get("energy.stored")


def heavier(blob: bytes, factor: float) -> bytes:
    """The same pair with `factor` times the moments of inertia."""
    sections = dict(read_blob(blob))
    return write_blob(sections | {"inertia": factor * np.array(sections["inertia"], float)})


@pytest.mark.parametrize("factor, broken", [(1.0, False), (1.8, False), (3.0, True), (0.4, True)])
def test_energy_guard_stops_a_run_that_gains_or_loses_half_of_all_energy(factor: float, broken: bool) -> None:
    """A state that goes on in gears of other inertia: the balance misses (1 − 1/factor) of the energy that there is.
    The failed run takes no further step, only a restored state."""
    kernel, blob = spinning(200.0), pair_blob(("torque", "torque"))
    stepped(kernel, 5, STEP)
    other = Kernel(heavier(blob, factor))
    other.initialize()
    own = other.save()
    other.restore(kernel.save())
    assert other.try_step(5 * STEP, STEP) == (ENERGY if broken else 0)
    missing = other.get("energy.residual") / other.get("energy.stored")
    assert missing == pytest.approx(1 - 1 / factor, abs=1e-3)
    if broken:
        assert other.time == 5 * STEP and other.try_step(5 * STEP, STEP) == BAD_CALL
        with pytest.raises(SimulationError):
            other.step(5 * STEP, STEP)
        other.restore(own)
        assert other.try_step(0.0, STEP) == 0


def test_the_state_of_a_pair_is_as_long_as_its_counts() -> None:
    """Not as those of the largest stage: that was 53 kB. A tooth pair keeps five numbers of each of 20 slices."""
    assert len(spinning(200.0).save()) <= 10 * 1024


def test_a_state_whose_arrays_lie_elsewhere_is_refused() -> None:
    kernel = spinning(200.0)
    state = bytearray(kernel.save())
    state[16 + 4] ^= 1  # behind magic, phase and status: where the second array begins
    with pytest.raises(ModelError):
        kernel.restore(bytes(state))
