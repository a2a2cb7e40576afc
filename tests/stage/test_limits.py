"""What a stage is made for is watched: torque_max, speed_max, and a start whose speeds come too late. The limit of the
step: runs on both sides of μ′ = 1, the default step by its rule, γ lowered with a warning, refusal with the step to
use; a stage that no step suits."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from driven import begun, give, stepped
from golden_stages import FRICTION, STEP, stages
from inner import Inner

from gearfmu.errors import ModelError, SimulationError
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
        follow = lambda n, kernel=kernel: give(kernel, drive(n * 1e-4))  # noqa: E731
        peak[late] = stepped(kernel, 20, 1e-4, "mesh.force_max", before=follow).max()
        words = status_words(int(kernel.get("solver.status")))
        assert any("set speeds before the initialisation ends" in word for word in words) is late
    assert peak[True] > 2 * peak[False]


# ---- the step --------------------------------------------------------------------------------------------------------
LOAD = 302.0  # N·m
LEVELS = {"rigid": 0, "fast": 1, "standard": 2, "full": 3}
UNDAMPED = {"effect.hertz": 0.0, "effect.contact_damping": 0.0, "effect.modal_damping": 0.0}
LADDER = np.array([0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 7.5]) * 1e-6  # s: the steps the kernel looks at
MU = 0.9  # of the default step, and of any other by γ
STEPS = 1500


def standing(inner_library: Path, model: StageModel, level: int, h: float) -> tuple[str, np.ndarray]:
    """Outcome and transmission error of a standing pair under load, undamped, γ = 1 whatever the limit says, after a
    millionth of the load is added."""
    inner, calm = Inner(inner_library, model.blob, {"level": level, "h": h, **UNDAMPED}), Steady(model, 0.0, LOAD)(0.0)
    kernel = begun(inner.kernel, calm)
    inner.force_gamma(1.0)
    kernel.set("pinion.phi", calm["pinion.phi"] * (1 + 1e-6))
    te = []
    try:
        for k in range(STEPS):
            kernel.step(k * h, h)
            te.append(kernel.get("mesh.te"))
    except SimulationError as error:
        return error.outcome, np.array(te)
    return "ok", np.array(te)


@pytest.mark.parametrize("level", ["fast", "standard"])
def test_both_sides_of_the_limit(inner_library: Path, relieved: StageModel, level: str) -> None:
    """μ′ is the worst over the pitch: where the pair stands the limit may lie some way beyond 1. Beyond it a knock that
    dies out below grows a thousandfold: until the run is stopped, or contacts that let go bound the swing."""
    number = LEVELS[level]
    probe = Inner(inner_library, relieved.blob, {"level": number, **UNDAMPED})
    steps = np.arange(15e-6, 60e-6, 0.5e-6)
    mu = np.array([probe.mu(h) for h in steps])
    below, above = steps[np.flatnonzero(mu < 0.95)[-1]], steps[np.flatnonzero(mu > 1.5)[0]]
    outcome, te = standing(inner_library, relieved, number, below)
    assert outcome == "ok" and np.ptp(te[-200:]) <= np.ptp(te[:200]) < 1e-8
    outcome, te = standing(inner_library, relieved, number, above)
    swing = np.ptp(te[-200:]) if len(te) else np.inf
    assert outcome != "ok" or swing > 1e-6, f"μ′ = 1.5 at {1e6 * above:.1f} µs did not grow: {swing:.1e} m"


@pytest.mark.parametrize("level", LEVELS)
def test_default_step_is_the_largest_that_meets_the_limit(
    inner_library: Path, relieved: StageModel, level: str
) -> None:
    probe = Inner(inner_library, relieved.blob, {"level": LEVELS[level]})
    good = np.array([probe.mu(h) <= MU for h in LADDER])
    wanted = LADDER[np.flatnonzero(good)[-1]]
    kernel = begun(relieved.kernel(level=LEVELS[level]), Steady(relieved, 0.0, LOAD)(0.0))
    kernel.step(0.0, 1e-3)
    used = kernel.get("solver.h")
    assert 1e-3 / used == pytest.approx(np.ceil(1e-3 / wanted - 1e-9)), f"{used:.3g} s, rule: {wanted:.3g} s"
    assert kernel.get("solver.status") == 0 and not kernel.warning


def test_a_larger_step_lowers_gamma_with_a_warning_and_keeps_the_limit(
    inner_library: Path, relieved: StageModel
) -> None:
    told = []
    for h in (40e-6, 50e-6, 60e-6, 70e-6):
        inner = Inner(inner_library, relieved.blob, {"level": LEVELS["fast"], "h": h})
        found = re.search(r"gamma lowered to (\d\.\d+)", inner.kernel.warning)
        assert found and "needs no lower gamma" in inner.kernel.warning
        told.append(float(found[1]))
        assert inner.mu(h, 1.0) > MU and inner.mu(h, told[-1] - 0.01) <= MU
    assert all(0 <= b < a < 0.7 for a, b in zip(told, told[1:], strict=False))


def test_too_large_a_step_is_refused_with_the_step_to_use(relieved: StageModel) -> None:
    """An eighth of the mesh period at speed_max: 16 teeth at 6000 rpm."""
    allowed = 60 / 6000 / 16 / 8
    kernel = relieved.kernel(level=LEVELS["fast"], h=1.01 * allowed)
    with pytest.raises(ModelError, match=f"use h <= {allowed:.3g}"):
        kernel.prepare()
    relieved.kernel(level=LEVELS["fast"], h=0.99 * allowed).prepare()


# ---- a stage that no step suits --------------------------------------------------------------------------------------
# Few modes and much contact damping leave hardly any compliance that a force of alternating sign meets. The default is
# the step nearest to the limit, and the run stays stable. One that fell through all tried steps to the shortest, whose
# γ is 0, gained with friction a thousand times its energy within 0.1 ms.
TRIED = (7.5e-6, 5e-6, 2.5e-6, 1e-6, 0.5e-6)  # s
STABLE = 1e-3  # of the energy that dampers took; the run at the shortest step left 0.6 of what was stored


def lowered(h: float) -> float:
    """γ of a helical pair with 24 modes a gear, as the kernel's warning has it; 1 where it says nothing."""
    kernel = stages()["helical"].kernel(FAST | {"h": h} | FRICTION, None)
    kernel.prepare()
    said = kernel.warning
    return float(said.split("lowered to ")[1][:4]) if "gamma" in said else 1.0


def test_no_step_tried_is_nearer_to_the_limit_than_the_default() -> None:
    assert lowered(0.0) < 1.0, "the stage is no example of what is tested"
    assert lowered(0.0) >= max(map(lowered, TRIED)) - 0.01  # digits of the message


def test_few_modes_much_damping_and_friction_stay_stable() -> None:
    stage = stages()["helical"]
    kernel = stage.kernel(FAST | FRICTION, None)
    kernel.initialize()
    stepped(kernel, stage.steps, STEP, before=lambda i: stage.drive(kernel, i))
    assert kernel.get("solver.retried_steps") == 0
    assert abs(kernel.get("energy.residual")) < STABLE * kernel.get("energy.dissipated")
