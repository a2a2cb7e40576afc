"""What a run counts and averages, against what is seen when every internal step is sampled."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from gearfmu.stage import StageModel, Steady

STEP = 5e-6  # s, internal
FAST = 1


def test_mean_force_of_coast_flanks_is_negative(relieved: StageModel) -> None:
    kernel, drive = relieved.kernel(level=FAST, h=STEP), Steady(relieved, 100.0, -302.0)
    means, sampled = [], []
    for k in range(400):
        for name, value in drive(k * STEP).items():
            kernel.set(name, value)
        if not k:
            kernel.initialize()
        kernel.step(k * STEP, STEP)
        means.append(kernel.get("mesh.force_mean"))
        sampled.append(kernel.get("mesh.force"))
    assert np.max(sampled) < 0
    assert np.mean(means) == pytest.approx(np.mean(sampled), rel=1e-3)


def test_impacts_and_open_time_are_those_of_the_steps(relieved: StageModel) -> None:
    """A light pair whose pinion's shaft swings by 4 mrad at 180 Hz."""
    kernel, drive = relieved.kernel(level=FAST, h=STEP), Steady(relieved, 50.0, 2.0)
    swing, omega, rows = 4e-3, 2 * math.pi * 180, []
    names = ("mesh.open_time", "mesh.impacts", "mesh.force_drive", "mesh.force_coast")
    for k in range(8000):
        t = k * STEP
        for name, value in drive(t).items():
            kernel.set(name, value)
        kernel.set("pinion.phi", drive(t)["pinion.phi"] + swing * (math.cos(omega * t) - 1))
        kernel.set("pinion.w", 50.0 - swing * omega * math.sin(omega * t))
        if not k:
            kernel.initialize()
        kernel.step(t, STEP)
        rows.append([kernel.get(name) for name in names])
    time, impacts, drive_force, coast_force = np.array(rows).T
    opened = np.diff(time) > 0
    assert 0.1 < opened.mean() < 0.9
    assert np.allclose(np.diff(time)[opened], STEP, rtol=1e-6, atol=0)
    assert not np.any((drive_force + coast_force)[1:][opened])
    struck = opened[:-1] & ~opened[1:]
    assert np.array_equal(np.diff(impacts)[1:], struck.astype(float)) and struck.sum() > 10


def test_a_shaft_that_gathers_speed_is_followed_within_the_communication_step(relieved: StageModel) -> None:
    """Angles of ½ a t²: points four times as far apart give the same motion."""

    def end(apart: float) -> Mapping[str, float]:
        kernel = relieved.kernel(level=FAST, h=STEP)
        drive = Steady(relieved, 100.0, 302.0, rate=2e4)
        for k in range(round(4e-3 / apart)):
            for name, value in drive(k * apart).items():
                kernel.set(name, value)
            if not k:
                kernel.initialize()
            kernel.step(k * apart, apart)
        return {name: kernel.get(name) for name in ("pinion.gear.phi", "mesh.force")}

    near, far = end(5e-5), end(2e-4)
    assert far["pinion.gear.phi"] == pytest.approx(near["pinion.gear.phi"], abs=1e-8)
    assert far["mesh.force"] == pytest.approx(near["mesh.force"], rel=1e-4)
