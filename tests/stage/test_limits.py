"""What a stage is made for is watched: torque_max, speed_max, and a start whose speeds come too late."""

from __future__ import annotations

import math

import pytest
from driven import give

from gearfmu.errors import SimulationError
from gearfmu.kernel import Kernel
from gearfmu.kernel.binding import status_words
from gearfmu.stage import StageModel, Steady, Trace, loaded_te, simulate
from gearfmu.stage.run.limits import beyond_limits, largest_speed, largest_torque

FAST = {"level": 1.0}
TORQUE, SPEED, JUMP = 32, 64, 128
RPM = math.pi / 30


def status(trace: Trace) -> int:
    return int(trace["solver.status"][-1])


def run(model: StageModel, torque: float, rpm: float) -> Trace:
    return simulate(model, Steady(model, rpm * RPM, torque), 0.03, 20e-6, FAST)


def test_torque_and_speed_beyond_the_limits_are_told(relieved: StageModel) -> None:
    """Each by its own bit; at the limits themselves none is set, whatever the mesh does about its mean."""
    assert largest_torque(relieved) == pytest.approx(600.0) and largest_speed(relieved) == pytest.approx(6000 * RPM)
    found = {case: status(run(relieved, *case)) for case in ((600, 2000), (630, 2000), (302, 6000), (302, 6300))}
    assert found[600, 2000] & (TORQUE | SPEED) == 0 == found[302, 6000] & (TORQUE | SPEED)
    assert found[630, 2000] & (TORQUE | SPEED) == TORQUE and found[302, 6300] & (TORQUE | SPEED) == SPEED
    words = run(relieved, 1500, 20000).meta["warnings"]
    assert any("beyond torque_max" in word for word in words) and any("beyond speed_max" in word for word in words)


def test_an_angle_at_the_start_is_no_speed(relieved: StageModel) -> None:
    """Ports that begin many pitches away from zero, and are loaded there, have not turned by them."""
    drive, ratio = Steady(relieved, 100.0, 302.0), relieved.shafts.ratio
    kernel = Kernel(relieved.blob, FAST)
    for n in range(3):
        values = dict(drive(n * 1e-4))
        values["pinion.phi"] += 40.0
        values["wheel.phi"] += 40.0 / ratio
        give(kernel, values)
        kernel.initialize(0.0) if n == 0 else kernel.step((n - 1) * 1e-4, 1e-4)
        assert int(kernel.get("solver.status")) == 0


def test_limits_in_words_name_both_numbers(relieved: StageModel) -> None:
    assert beyond_limits(relieved, 600.0, 6000 * RPM) == []
    torque, speed = beyond_limits(relieved, -1500.0, 20000 * RPM)
    assert "1500 N·m on the pinion is beyond torque_max, 600 N·m" in torque
    assert "20000 rpm of the pinion is beyond speed_max, 6000 rpm" in speed


def test_a_torque_without_equilibrium_names_its_limit(relieved: StageModel) -> None:
    with pytest.raises(SimulationError, match=r"no static equilibrium under 1e\+06 N·m .*torque_max, 600 N·m"):
        loaded_te(relieved, [1e6], 3)


def test_speeds_that_come_after_the_start_are_told(relieved: StageModel) -> None:
    """An importer that sets its inputs once the initialisation has ended tears resting gears along: the same drive as
    in time, but more than twice the force and a warning."""
    drive = Steady(relieved, 2000 * RPM, 302.0)
    peak = {}
    for late in (False, True):
        kernel = Kernel(relieved.blob, FAST)
        if not late:
            give(kernel, drive(0.0))
        kernel.initialize(0.0)
        assert int(kernel.get("solver.status")) & JUMP == 0
        for n in range(20):
            give(kernel, drive(n * 1e-4))
            kernel.step(n * 1e-4, 1e-4)
            peak[late] = max(peak.get(late, 0.0), kernel.get("mesh.force_max"))
        words = status_words(int(kernel.get("solver.status")))
        assert any("set speeds before the initialisation ends" in word for word in words) is late
    assert peak[True] > 2 * peak[False]
