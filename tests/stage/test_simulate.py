"""Standalone runs of the shipped pair: mean values, agreement of the integrators, what a run records."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, Steady, Trace, loaded_te, simulate
from gearfmu.stagefile.stage import load_stage

LOAD, SPEED = 302.0, 2000 * math.pi / 30  # N·m, rad/s of the pinion
H = 60e-6  # s, communication step: 8, 16, 32 … internal steps of 7.5, 3.75, 1.875 … µs
SETTLED = 0.02
DG4, EM, RK45 = range(3)
RIGID, FAST = 0, 1


def run(model: StageModel, duration: float, **parameters: float) -> Trace:
    return simulate(model, Steady(model, SPEED, LOAD), duration, H, {"level": FAST, **parameters})


def error(trace: Trace, reference: Trace, channel: str) -> float:
    """rms of the difference over the rms of the alternating part, second half of the run."""
    half = trace.time.size // 2
    wanted = reference[channel][half:]
    return float(np.sqrt(np.mean((trace[channel][half:] - wanted) ** 2)) / wanted.std())


@pytest.fixture(scope="module")
def steady(relieved: StageModel) -> Trace:
    return run(relieved, 0.08)


def test_mean_values_are_those_of_the_load(steady: Trace, relieved: StageModel, pair: PairGeometry) -> None:
    """Over whole mesh periods the mesh carries the torque, and te is on average the quasi-static one."""
    assert (
        steady.meta["outcome"] == "completed"
        and steady["solver.retried_steps"][-1] == 0
        and steady["solver.status"][-1] == 0
    )
    samples = steady.time > SETTLED
    force = pair.gears[0].r_b * steady["mesh.force_mean"][samples].mean()
    te, static = steady["mesh.te"][samples].mean(), loaded_te(relieved, [LOAD], 64).te.mean()
    assert force == pytest.approx(LOAD, rel=5e-3) and te == pytest.approx(static, rel=5e-3)
    assert steady["wheel.tau_mean"][samples].mean() == pytest.approx(-LOAD * 24 / 16, rel=5e-3)


def test_te_is_what_its_name_says(steady: Trace, pair: PairGeometry) -> None:
    """mesh.te = r_b1 φ_1 + r_b2 φ_2 of the bore nodes."""
    angles = (steady["pinion.gear.phi"], steady["wheel.gear.phi"])
    expected = sum(shape.r_b * phi for shape, phi in zip(pair.gears, angles, strict=True))
    assert np.abs(steady["mesh.te"] - expected).max() < 1e-9 * np.abs(angles[0]).max()


def test_integrators_agree_at_small_steps(relieved: StageModel) -> None:
    """Against a step of 0.47 µs. Order: tests/study/test_order.py."""
    fine = run(relieved, 0.03, h=H / 128)
    for scheme in (DG4, EM, RK45):
        trace = run(relieved, 0.03, integrator=scheme, h=H / 64)
        te, force = error(trace, fine, "mesh.te"), error(trace, fine, "mesh.force")
        # rk45 reads the closing speed from the coordinates, the steps from the path's deflection: they differ by what
        # the rows' own motion along the flank adds (decisions.md)
        assert te < 5e-3 and force < (5e-2 if scheme == RK45 else 2e-2)


def test_rk45_without_contact_dashpots_is_the_same_model(relieved: StageModel) -> None:
    off = {"effect.contact_damping": 0.0}
    step, paper_way = (run(relieved, 0.01, integrator=scheme, h=H / 64, **off) for scheme in (DG4, RK45))
    assert error(paper_way, step, "mesh.te") < 1e-3


def test_the_kernel_writes_the_samples_itself(relieved: StageModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reads of single channels, 47 a sample, took eight times the kernel's own time."""
    calls = {"get": 0, "record": 0, "step": 0}
    for name in calls:
        own = getattr(Kernel, name)

        def counted(*given: Any, name: str = name, own: Any = own) -> Any:
            calls[name] += 1
            return own(*given)

        monkeypatch.setattr(Kernel, name, counted)
    told: list[float] = []
    trace = simulate(relieved, Steady(relieved, SPEED, LOAD), 4000 * 20e-6, 20e-6, {"level": 0.0}, told.append)
    assert trace.time.size == 4001 and calls["record"] <= 200 and calls["get"] < 50 and calls["step"] == 0
    assert told == sorted(told) and told[0] == 0.0 and len(told) == calls["record"]


def test_inputs_of_ones_own_are_asked_at_every_step(relieved: StageModel) -> None:
    """A function of time that names fewer inputs later leaves them as they were: the same bits as rows of all."""
    steady, first = Steady(relieved, SPEED, LOAD), {"pinion.w", "wheel.w"}

    def own(time: float) -> dict[str, float]:
        return {name: value for name, value in steady(time).items() if time == 0.0 or name not in first}

    one, other = (simulate(relieved, inputs, 40 * H, H, {"level": FAST}) for inputs in (own, steady))
    assert all(np.array_equal(one[name], other[name]) for name in one.channels)


@pytest.mark.parametrize("level, drift", [(RIGID, 2e-7), (FAST, 2e-5)])
def test_standstill_under_load_stays_at_rest(relieved: StageModel, level: int, drift: float) -> None:
    """The static start is the equilibrium of the step; rows and modal states of single precision hold it to their
    rounding."""
    trace = simulate(relieved, Steady(relieved, 0.0, LOAD), 0.01, H, {"level": level})
    for channel in ("mesh.force", "mesh.te", "bearing.pinion.fy", "bearing.wheel.fy", "pinion.tau", "wheel.tau"):
        values = trace[channel]
        assert np.ptp(values) < drift * np.abs(values).max(), channel
    assert trace["mesh.force"][0] > 8000 and trace["solver.retried_steps"][-1] == 0


def test_a_run_that_stops_keeps_its_samples(relieved: StageModel, tmp_path: Path) -> None:
    """From 3 ms on the pinion's shaft end is turned by 100 rad per step: a named outcome, and the good part of the
    run."""
    calm = Steady(relieved, SPEED, LOAD)

    def inputs(time: float) -> dict[str, float]:
        values = dict(calm(time))
        return values if time < 3e-3 else values | {"pinion.phi": 100.0 * time / H}

    trace = simulate(relieved, inputs, 0.01, H, {"level": FAST})
    assert trace.meta["outcome"] in {"penetration", "diverged", "energy"}
    assert 3e-3 <= trace.meta["simulated_s"] == trace.time[-1] < 0.01
    assert all(np.all(np.isfinite(trace[name])) for name in trace.channels)
    trace.save(tmp_path / "trace.h5")
    assert Trace.load(tmp_path / "trace.h5").meta["outcome"] == trace.meta["outcome"]


def test_meta_of_a_run_needs_nobody_to_complete_it(steady: Trace, relieved: StageModel) -> None:
    """The residual is relative, orders and stage can be found again: the report of a trace made in Python."""
    work, stored = abs(steady["energy.work"]).max(), steady["energy.stored"].max()
    assert steady.meta["energy_residual"] == steady["energy.residual"][-1] / (work + stored)
    assert abs(steady.meta["energy_residual"]) < 1e-2 and steady.meta["H"] == H
    assert [gear for gear, *_ in steady.meta["meshes"].values()] == ["pinion"]
    assert load_stage(steady.meta["stage"]) == load_stage(steady.meta["stage_path"]) == relieved.stage
