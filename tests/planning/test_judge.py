"""Errors in budgets: known signals, known answers."""

from __future__ import annotations

import numpy as np
import pytest

from gearfmu.planning.judge import (
    Signals,
    error,
    silent_outputs,
    split_half_noise,
    trend,
)
from gearfmu.planning.request import Output, Request

STEP, COUNT = 2e-5, 4000
TIME = STEP * np.arange(COUNT)
SINE = np.sin(2 * np.pi * 1000.0 * TIME)
LEVEL = Request((Output("a", (("a", 1.0),)),), (200.0, 5000.0), level=1.0)
WAVE = Request(LEVEL.outputs, LEVEL.band, waveform=0.05)


def of(values: np.ndarray) -> Signals:
    return Signals({"a": values}, STEP)


def test_a_level_is_judged_in_decibels_of_the_budget() -> None:
    found = error(of(10 ** (0.5 / 20) * SINE), of(SINE), LEVEL)
    assert found.whole == pytest.approx(0.5, rel=1e-6)
    assert found.bound == pytest.approx(found.whole, rel=1e-6)  # the nested windows agree


def test_what_lies_outside_the_band_does_not_count() -> None:
    slow = 100.0 * np.sin(2 * np.pi * 20.0 * TIME) + 3.0 * TIME
    assert error(of(SINE + slow), of(SINE), LEVEL).whole < 1e-3


def test_a_waveform_is_judged_after_the_common_delay() -> None:
    later = np.sin(2 * np.pi * 1000.0 * (TIME - 1.3 * STEP))
    assert error(of(later), of(SINE), WAVE).whole < 0.05  # the window does not move along
    assert error(of(1.05 * later), of(SINE), WAVE).whole == pytest.approx(1.0, rel=1e-3)


def test_windows_that_disagree_raise_the_bound() -> None:
    growing = SINE * np.linspace(1.0, 1.2, COUNT)
    found = error(of(growing), of(SINE), LEVEL)
    assert found.bound > found.whole + 0.1


def test_a_run_that_failed_is_infinitely_wrong() -> None:
    assert error(Signals({}, STEP), of(SINE), LEVEL).bound == np.inf
    assert error(of(np.full(COUNT, np.nan)), of(SINE), LEVEL).bound == np.inf


def test_noise_is_the_difference_of_the_halves() -> None:
    louder = SINE * np.where(TIME < TIME[COUNT // 2], 1.0, 10 ** (2.0 / 20))
    assert split_half_noise(of(louder), LEVEL) == pytest.approx(2.0, abs=0.01)


def test_slow_growth_is_seen_and_scatter_is_not() -> None:
    assert trend(of(SINE * 10 ** (3.0 * TIME / TIME[-1] / 20)), LEVEL) == pytest.approx(3.0, abs=0.5)
    random = np.random.default_rng(1).normal(size=COUNT)
    assert trend(of(random), LEVEL) < 0.5


def test_an_output_without_a_signal_in_the_band_is_named() -> None:
    assert silent_outputs(of(np.full(COUNT, 5.0)), LEVEL) == ["a"]
    assert silent_outputs(of(SINE), LEVEL) == []
