"""Whole coupled runs on the analytic stage: what is recorded, what is estimated, how a failure ends."""

from __future__ import annotations

import numpy as np
import pytest
from analytic_stage import Plant, Stage

from gearfmu.cosim.accuracy import Window, alternating, coupling_errors, rms
from gearfmu.cosim.coupled import OK, Plan, run_coupled
from gearfmu.cosim.fmu_unit import outcome_of
from gearfmu.cosim.masters import Cut
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.signals import Ramp
from gearfmu.errors import CouplingError, FmuError, SimulationError
from gearfmu.kernel.binding import OUTCOMES, load

CLOSURE = Plant(chain=True, capacity=Ramp(((0.0, 0.0), (0.05, 250.0))), engine_w=202.0, ripple=50.0)
DURATION = 0.08


def cut(stage: Stage | None = None) -> Cut:
    return Cut(stage or Stage(CLOSURE), PyUnit(CLOSURE.drive()))


def plan(name: str = "gs_mean", h: float = 2e-4, **more) -> Plan:
    return Plan(name, h, round(DURATION / h), **more)


def test_everything_is_recorded_at_every_point_with_unit_and_description():
    told = []
    result = run_coupled(cut(), plan(progress=told.append))
    trace = result.trace
    assert result.outcome == OK and trace.time.size == 401 and trace.time[-1] == pytest.approx(DURATION, abs=1e-15)
    assert trace.channels["input.tau"].unit == "N.m" and trace.channels["clutch.locked"].values.dtype == np.int64
    assert "drive.engine.w" in trace and "engine" in trace.channels["drive.engine.w"].description
    assert told[-1] == 1.0 and all(b > a for a, b in zip(told, told[1:], strict=False)) and result.cpu_s > 0.0


def test_patterns_choose_what_is_recorded_and_must_fit_something():
    assert set(run_coupled(cut(), plan(record=("mesh.tau", "drive.*.w"))).trace.channels) == {
        "mesh.tau",
        "drive.engine.w",
        "drive.vehicle.w",
        "drive.pinion.w",
        "drive.wheel.w",
    }
    with pytest.raises(CouplingError, match="nothing to record for mash.te"):
        run_coupled(cut(), plan(record=("mesh.tau", "mash.te")))


@pytest.mark.parametrize(("name", "low", "high"), [("gs_mean", 0.8, 1.3), ("jacobi", 0.8, 1.3)])
def test_richardson_predicts_the_true_coupling_error(name, low, high):
    """Estimated over true error of the shaft's torque, against the uncut equations; prototypes: 0.8–1.1."""
    coarse, fine = run_coupled(cut(), plan(name)), run_coupled(cut(), plan(name, 1e-4))
    estimate = coupling_errors(coarse.trace, fine.trace, coarse.order, Window(0.0, steady=False))["input.tau"].relative
    unit = PyUnit(CLOSURE.monolithic(), CLOSURE.micro_step)
    unit.initialize(0.0)
    log = unit.log(["input.tau"], 401)
    for n in range(401):
        log.take()
        unit.step(n * 2e-4, 2e-4)
    whole = log.rows()[:, 0]
    true = rms(coarse.trace["input.tau"] - whole) / rms(alternating(whole, 2e-4, steady=False))
    assert low < estimate / true < high, (estimate, true)


class Failing(Stage):
    """The stage, until it gives up in the step from 20 ms."""

    def __init__(self, error: Exception) -> None:
        super().__init__(CLOSURE)
        self.error = error

    def step(self, time: float, h: float) -> None:
        """As the stage's, up to 20 ms."""
        if time > 0.0199:
            raise self.error
        super().step(time, h)


@pytest.mark.parametrize(
    ("error", "outcome"),
    [(SimulationError("state not finite", "diverged", 0.02), "diverged"), (FmuError("refused"), "stopped")],
)
def test_a_failing_stage_ends_the_run_with_its_outcome_and_the_trace_so_far(error, outcome):
    result = run_coupled(cut(Failing(error)), plan())
    assert result.outcome == outcome and result.message == str(error)
    assert result.trace.time[-1] == pytest.approx(0.02) and result.trace.time.size == 101
    whole = run_coupled(cut(), plan()).trace
    assert np.array_equal(result.trace["mesh.tau"], whole["mesh.tau"][:101])


def test_outcomes_of_an_fmu_have_the_kernels_names():
    text = "the step from 0.1 s stopped at 0.1001 s: " + load().gk_outcome_text(OUTCOMES.index("diverged")).decode()
    assert (
        outcome_of(text) == "diverged"
        and outcome_of("the step stopped: energy balance broken") == "energy"
        and outcome_of("help") == "discarded"
    )


def test_alternating_part():
    """A slow drift goes, a tone above 100 Hz stays; in steady windows only the mean goes."""
    t = np.arange(4000) * 1e-4
    tone, drift = np.sin(2 * np.pi * 400 * t), 50.0 * t
    inner = slice(100, -100)
    assert rms((alternating(tone + drift, 1e-4, steady=False) - tone)[inner]) < 0.02
    assert np.allclose(alternating(tone + 3.0, 1e-4, steady=True), tone - tone.mean(), atol=1e-12)
