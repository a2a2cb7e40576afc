"""Force outputs at communication points: second order in h, never negative on a flank, and means whose sums are the
impulse."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfmu.stage import StageModel, Steady

H = 4e-5  # s, communication step: the points that runs of all internal steps share
FAST = 1


def loaded(model: StageModel, h: float, torque: float, count: int = 200) -> dict[str, np.ndarray]:
    """Sampled outputs (count,) of a run at 2000 rpm with the internal step h (s)."""
    kernel, drive = model.kernel(level=FAST, h=h), Steady(model, 209.44, torque)
    rows = []
    for k in range(count):
        for name, value in drive(k * H).items():
            kernel.set(name, value)
        if k == 0:
            kernel.initialize()
        kernel.step(k * H, H)
        rows.append([kernel.get(name) for name in ("mesh.force", "pinion.tau")])
    return dict(zip(("force", "tau"), np.array(rows[50:]).T, strict=True))


def test_sampled_forces_are_of_second_order(relieved: StageModel) -> None:
    """Error against 0.31 µs falls sixfold with a quarter of the step (measured: 9.8 and 7.0), and in the middle
    of the points, away from contacts that close, it is small at the default step."""
    exact = loaded(relieved, 0.3125e-6, 302.0)
    for name in ("force", "tau"):
        error = {}
        for h in (5e-6, 1.25e-6):
            error[h] = np.abs(loaded(relieved, h, 302.0)[name] - exact[name])
        scale = np.std(exact[name])
        print(name, {h: (100 * np.sqrt(np.mean(e**2)) / scale, 100 * np.median(e) / scale) for h, e in error.items()})
        assert np.sqrt(np.mean(error[1.25e-6] ** 2)) < np.sqrt(np.mean(error[5e-6] ** 2)) / 6
        assert np.median(error[5e-6]) < 0.015 * scale


def rattling(model: StageModel, count: int = 1500) -> dict[str, np.ndarray]:
    """A light pair whose pinion's shaft swings by 4 mrad at 180 Hz: both flanks meet and let go."""
    names = ("mesh.force_drive", "mesh.force_coast", "mesh.force", "mesh.force_mean", "mesh.impacts")
    kernel, drive, rows = model.kernel(level=FAST), Steady(model, 50.0, 2.0), []
    swing, omega = 4e-3, 2 * math.pi * 180
    for k in range(count):
        for name, value in drive(k * H).items():
            kernel.set(name, value)
        t = k * H
        kernel.set("pinion.phi", drive(t)["pinion.phi"] + swing * (math.cos(omega * t) - 1))
        kernel.set("pinion.w", 50.0 - swing * omega * math.sin(omega * t))
        if k == 0:
            kernel.initialize()
        kernel.step(t, H)
        rows.append([kernel.get(name) for name in names])
    return dict(zip(names, np.array(rows).T, strict=True))


def test_no_flank_pulls(relieved: StageModel) -> None:
    """Through 60 ms of impacts on both flanks; what a dashpot would pull used to stand in the sample."""
    found = rattling(relieved)
    assert found["mesh.impacts"][-1] > 20
    assert found["mesh.force_drive"].max() > 100 and found["mesh.force_coast"].max() > 100
    assert found["mesh.force_drive"].min() >= 0 and found["mesh.force_coast"].min() >= 0
    assert found["mesh.force"] == pytest.approx(found["mesh.force_drive"] - found["mesh.force_coast"])


def test_means_sum_to_the_impulse(bodies, plain: StageModel) -> None:
    """Without relief the line of action keeps its arm: what a gear that nothing else turns gains is −r_b ΣF̄H, to
    rounding of its elastic modes."""
    kernel, steady = plain.kernel(level=0), Steady(plain, 100.0, 50.0)
    for name, value in steady(0.0).items():
        kernel.set(name, value)
    kernel.initialize()
    inertia = bodies[0].inertia[2, 2]
    r_b = (
        plain.stage.written.pair.normal_module
        * plain.stage.gears[0].teeth
        / 2
        * math.cos(plain.stage.written.pair.pressure_angle)
    )
    before, impulse = kernel.get("pinion.gear.w"), 0.0
    for k in range(200):
        for name, value in steady(k * H).items():
            kernel.set(name, value)
        kernel.step(k * H, H)
        impulse += H * (-r_b * kernel.get("mesh.force_mean") - kernel.get("pinion.tau_mean"))
    assert inertia * (kernel.get("pinion.gear.w") - before) == pytest.approx(impulse, abs=1e-3)
