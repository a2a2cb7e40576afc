"""What a run counts and averages, against what is seen when every internal step is sampled; forces at communication
points are of second order in h."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfmu.stage import StageModel, Steady, Trace, simulate

STEP = 5e-6  # s, internal
FAST = {"level": 1.0, "h": STEP}


def test_mean_force_of_coast_flanks_is_negative(relieved: StageModel) -> None:
    trace = simulate(relieved, Steady(relieved, 100.0, -302.0), 400 * STEP, STEP, FAST)
    sampled = trace["mesh.force"][1:]
    assert sampled.max() < 0
    assert trace["mesh.force_mean"][1:].mean() == pytest.approx(sampled.mean(), rel=1e-3)


def test_impacts_and_open_time_are_those_of_the_steps(relieved: StageModel) -> None:
    """A light pair whose pinion's shaft swings by 4 mrad at 180 Hz."""
    drive, swing, omega = Steady(relieved, 50.0, 2.0), 4e-3, 2 * math.pi * 180

    def swinging(time: float) -> dict[str, float]:
        values = drive(time)
        values["pinion.phi"] += swing * (math.cos(omega * time) - 1)
        values["pinion.w"] = 50.0 - swing * omega * math.sin(omega * time)
        return values

    trace = simulate(relieved, swinging, 8000 * STEP, STEP, FAST)
    open_time, impacts = np.diff(trace["mesh.open_time"][1:]), np.diff(trace["mesh.impacts"][1:])
    opened = open_time > 0
    assert 0.1 < opened.mean() < 0.9
    assert np.allclose(open_time[opened], STEP, rtol=1e-6, atol=0)
    assert not np.any((trace["mesh.force_drive"] + trace["mesh.force_coast"])[2:][opened])
    struck = opened[:-1] & ~opened[1:]
    assert np.array_equal(impacts[1:], struck.astype(float)) and struck.sum() > 10
    for flank in ("drive", "coast"):  # what a dashpot would pull used to stand in the sample
        assert trace[f"mesh.force_{flank}"].max() > 100 and trace[f"mesh.force_{flank}"].min() >= 0
    assert trace["mesh.force"] == pytest.approx(trace["mesh.force_drive"] - trace["mesh.force_coast"])


def test_a_shaft_that_gathers_speed_is_followed_within_the_communication_step(relieved: StageModel) -> None:
    """Angles of ½ a t²: points four times as far apart give the same motion."""
    drive = Steady(relieved, 100.0, 302.0, rate=2e4)
    near, far = (simulate(relieved, drive, 4e-3, apart, FAST) for apart in (5e-5, 2e-4))
    assert far["pinion.gear.phi"][-1] == pytest.approx(near["pinion.gear.phi"][-1], abs=1e-8)
    assert far["mesh.force"][-1] == pytest.approx(near["mesh.force"][-1], rel=1e-4)


# ---- forces at communication points ----------------------------------------------------------------------------------
H = 4e-5  # s, communication step: the points that runs of all internal steps share


def test_sampled_forces_are_of_second_order(relieved: StageModel) -> None:
    """At 2000 rpm the error against 0.31 µs falls sixfold with a quarter of the step (measured: 9.8 and 7.0), and in
    the middle of the points, away from contacts that close, it is small at the default step."""

    def loaded(h: float) -> Trace:
        return simulate(relieved, Steady(relieved, 209.44, 302.0), 200 * H, H, {"level": 1.0, "h": h})

    exact, runs = loaded(0.3125e-6), {h: loaded(h) for h in (5e-6, 1.25e-6)}
    for name in ("mesh.force", "pinion.tau"):
        wanted = exact[name][51:]
        error = {h: np.abs(run[name][51:] - wanted) for h, run in runs.items()}
        scale = np.std(wanted)
        assert np.sqrt(np.mean(error[1.25e-6] ** 2)) < np.sqrt(np.mean(error[5e-6] ** 2)) / 6
        assert np.median(error[5e-6]) < 0.015 * scale
