"""Metrics against exact sines, Parseval and run-ups of known order content."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearfmu.report import metrics

STEP = 1e-4


def sine(frequency: float, peak: float, n: int = 4000, phase: float = 0.0) -> np.ndarray:
    return peak * np.sin(2 * np.pi * frequency * np.arange(n) * STEP + phase)


@settings(max_examples=50)
@given(line=st.integers(3, 1900), peak=st.floats(1e-6, 1e6), phase=st.floats(0, 6.2), offset=st.floats(-1e3, 1e3))
def test_sine_on_a_line_has_its_exact_rms(line: int, peak: float, phase: float, offset: float) -> None:
    spectrum = metrics.amplitude_spectrum(sine(line * 2.5, peak, phase=phase) + offset, STEP)
    assert spectrum.frequency[line] == pytest.approx(2.5 * line)
    assert spectrum.amplitude[line] == pytest.approx(peak / np.sqrt(2), rel=1e-9, abs=1e-10 * abs(offset))


@settings(max_examples=30)
@given(frequency=st.floats(50, 4900))
def test_sine_between_lines_loses_at_most_the_hann_scallop(frequency: float) -> None:
    """Scalloping loss of Hann is 1.42 dB at half a line; the band level loses nothing."""
    spectrum = metrics.amplitude_spectrum(sine(frequency, np.sqrt(2)), STEP)
    assert -1.45 < metrics.level(spectrum.amplitude).max() < 0.02
    assert metrics.band_rms(spectrum, frequency - 25, frequency + 25) == pytest.approx(1, rel=2e-3)


def test_parseval_over_all_bands() -> None:
    noise = np.random.default_rng(4).normal(size=2**16)
    spectrum = metrics.amplitude_spectrum(noise, STEP, segment=1024)
    assert metrics.band_rms(spectrum, 0, 5001) == pytest.approx(noise.std(), rel=5e-3)


def run_up(start: float, end: float, n: int = 20000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    time = np.arange(n) * STEP / 4
    speed = start + (end - start) * time / time[-1]
    return time, speed, metrics.mesh_angle(time, speed, 16)


@pytest.mark.parametrize(("start", "end"), [(150.0, 150.0), (30.0, 210.0), (210.0, 30.0), (-30.0, -210.0)])
def test_order_keeps_its_level_in_a_run_up(start: float, end: float) -> None:
    time, _, angle = run_up(start, end)
    values = 1000 + 80 * np.sin(angle + 0.3) + 8 * np.cos(3 * angle)
    cuts = metrics.order_cuts(time, values, angle, orders=4)
    assert np.allclose(cuts.amplitude[0], 80 / np.sqrt(2), rtol=1e-3)
    assert np.allclose(cuts.amplitude[2], 8 / np.sqrt(2), rtol=1e-2)
    assert np.nanmax(cuts.amplitude[[1, 3]]) < 0.05
    assert cuts.mesh_frequency[0] == pytest.approx(
        abs(np.interp(cuts.time[0], time, np.linspace(start, end, time.size))) * 16 / (2 * np.pi), rel=1e-3
    )


def test_orders_above_the_sampling_limit_are_not_invented() -> None:
    time = np.arange(8000) * STEP
    angle = metrics.mesh_angle(time, np.full(8000, 600.0), 16)
    cuts = metrics.order_cuts(time, np.sin(angle), angle, orders=5)
    assert np.all(np.isfinite(cuts.amplitude[:2])) and np.all(np.isnan(cuts.amplitude[2:]))


def test_off_order_tone_does_not_enter_the_cut() -> None:
    time, _, angle = run_up(150, 150)
    cuts = metrics.order_cuts(time, 100 * np.sin(angle * 1.5), angle, orders=3)
    assert np.nanmax(cuts.amplitude) < 0.5


def test_mesh_angle_is_the_integral_of_the_speed() -> None:
    time, speed, angle = run_up(20, 200)
    assert angle[-1] == pytest.approx(16 * 110 * time[-1], rel=1e-12)


def test_unusable_signals_are_refused_with_the_remedy() -> None:
    with pytest.raises(metrics.MetricsError, match="record"):
        metrics.amplitude_spectrum(np.zeros(10), STEP)
    with pytest.raises(metrics.MetricsError, match="evenly spaced"):
        metrics.sample_step(np.array([0.0, 1, 2, 4]))
    with pytest.raises(metrics.MetricsError, match="mesh periods"):
        metrics.order_cuts(np.arange(100) * STEP, np.zeros(100), np.linspace(0, 6, 100))


@pytest.mark.parametrize("turns", [8, 32])
def test_means_over_the_step_give_the_amplitudes_of_the_signal(turns: int) -> None:
    """Exact means of a vibration over every step: spectrum, spectrogram, cut and map tell its own level."""
    step, frequency, n = 1e-4, 3125.0, 4096  # 3.2 samples a period
    t = np.arange(1, n + 1) * step
    omega = 2 * np.pi * frequency
    means = (np.cos(omega * (t - step)) - np.cos(omega * t)) / (omega * step)  # of sin(ω t)
    rms = np.sqrt(0.5)
    assert metrics.amplitude_spectrum(means, step).amplitude.max() == pytest.approx(rms * np.sinc(0.3125), rel=1e-3)
    assert metrics.amplitude_spectrum(means, step, averaged=step).amplitude.max() == pytest.approx(rms, rel=1e-3)
    assert metrics.spectrogram(means, step, 512, 256, step).amplitude.max(axis=1) == pytest.approx(rms, rel=1e-3)
    angle = omega * t
    assert metrics.order_cuts(t, means, angle, 1, 8, step).amplitude == pytest.approx(rms, rel=1e-3)
    shaft = angle / turns
    found = metrics.order_map(t, means, shaft, turns + 2.0, 4, step)
    assert found.amplitude[:, found.order == turns] == pytest.approx(rms, rel=1e-3)
