"""A run that goes on with another setup (gk_adopt): the motion is carried over."""

from __future__ import annotations

import numpy as np
import pytest
from driven import begun, give, stepped

import gearfmu as gf
from gearfmu.errors import ModelError
from gearfmu.kernel import Kernel
from gearfmu.stage.run.steady import Steady

STEP, BEFORE, AFTER = 20e-6, 250, 250  # s; communication steps


@pytest.fixture(scope="module")
def drive() -> Steady:
    return Steady(gf.assemble("fzg_c/stage_relief"), 209.4, 250.0)


def halfway(drive: Steady, **parameters: float) -> Kernel:
    kernel = begun(drive.model.kernel(**parameters), drive(0.0))
    run(kernel, drive, 0, BEFORE)
    return kernel


def run(kernel: Kernel, drive: Steady, start: int, end: int) -> np.ndarray:
    """Transmission error after every step."""
    follow = lambda k: give(kernel, drive((start + k) * STEP))  # noqa: E731
    return stepped(kernel, end - start, STEP, "mesh.te", before=follow)[:, 0]


def taken_over(drive: Steady, old: dict[str, float], new: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Transmission errors after the change, and of a run with the new setup from the start, over its alternating
    part."""
    first, kernel, own = halfway(drive, **old), drive.model.kernel(**new), halfway(drive, **new)
    kernel.adopt(first)
    found, wanted = (run(k, drive, BEFORE, BEFORE + AFTER) for k in (kernel, own))
    return found / np.std(wanted), wanted / np.std(wanted)


@pytest.mark.parametrize("new", [{"level": 0.0, "h": 5e-6}, {"level": 1.0, "h": 1e-5, "slices": 1.0}])
def test_what_a_poorer_setup_cannot_keep_is_forgotten(drive: Steady, new: dict[str, float]) -> None:
    found, wanted = taken_over(drive, {"level": 1.0, "h": 5e-6}, new)
    distance = np.abs(found - wanted)
    assert distance[-50:].max() < 0.1 and distance[-50:].max() < 0.2 * distance[:50].max()


def test_a_change_leaves_no_debt_of_energy(drive: Steady) -> None:
    first, kernel = halfway(drive, level=1.0, h=5e-6), drive.model.kernel(level=2.0, h=5e-6)
    kernel.adopt(first)
    run(kernel, drive, BEFORE, BEFORE + 20)
    rounds = kernel.get("solver.iterations")
    run(kernel, drive, BEFORE + 20, BEFORE + 120)
    assert kernel.get("solver.iterations") - rounds < 1.5 * 100 * STEP / 5e-6  # a debt costs 35 iterations a step


def test_states_that_cannot_be_taken_over_are_refused(drive: Steady) -> None:
    fresh = begun(drive.model.kernel(level=1.0), drive(0.0))
    with pytest.raises(ModelError, match="must have made a step"):
        drive.model.kernel(level=2.0).adopt(fresh)
    with pytest.raises(ModelError, match="effect.bearings"):
        drive.model.kernel(**{"effect.bearings": 0.0}).adopt(halfway(drive, level=1.0))
