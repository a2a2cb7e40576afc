"""Sound power of time series: a tone by hand, sums over lines, interpolation of the matrix, run-ups."""

from __future__ import annotations

import numpy as np
import pytest
from surfaces import box, rigid

from gearfmu.sound import (
    Radiation,
    SoundError,
    level,
    midbands,
    power_of,
    radiated,
    radiation,
    segments,
    skin_of,
)

STEP = 5e-5


def multipoles(lines: np.ndarray) -> Radiation:
    """Two coordinates, of f² and f⁴, and their coupling; gram the identity."""
    matrix = np.zeros((len(lines), 2, 2))
    matrix[:, 0, 0], matrix[:, 1, 1] = (lines / 1000) ** 2, (lines / 1000) ** 4
    matrix[:, 0, 1] = matrix[:, 1, 0] = 0.5 * (lines / 1000) ** 3
    return Radiation(lines, matrix, np.eye(2), 400.0, 8000.0, np.zeros(len(lines)))


SOUND = multipoles(midbands(63, 8000))


def record(amplitude: np.ndarray, frequency: float, seconds: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Displacements of two coordinates whose velocities have these complex amplitudes."""
    time = np.arange(0, seconds, STEP)
    wave = np.exp(2j * np.pi * frequency * time)[:, None] * amplitude / (2j * np.pi * frequency)
    return time, wave.real


def test_a_tone_has_the_power_of_its_amplitudes() -> None:
    """W = ½ (R₀₀|a|² + R₁₁|b|² + 2 R₀₁ Re a b*), by hand at 500 Hz: ½ (¼·9 + 1/16·4 + 2·1/16·Re 3·(−2i)…)·1e-6 W."""
    time, moved = record(1e-3 * np.array([3.0, 2.0 * np.exp(-1j)]), 500.0)
    found = power_of(segments(time, moved), SOUND)
    exact = 0.5e-6 * (0.25 * 9 + 4 / 16 + 2 * 0.0625 * 6 * np.cos(1.0))
    assert found.power.sum() == pytest.approx(exact, rel=2e-3)
    assert found.erp.sum() == pytest.approx(0.5 * 400e-6 * 13, rel=1e-3)
    assert found.total()[0] == pytest.approx(10 * np.log10(exact / 1e-12), abs=0.01)
    assert found.total_a()[0] == pytest.approx(found.total()[0] - 3.25, abs=0.02)  # −3.2 dB at 500 Hz
    bands = found.third_octaves()[0]
    assert bands.sum() == pytest.approx(exact, rel=2e-3) and bands.argmax() == np.abs(found.bands - 500).argmin()


def test_power_of_lines_adds_up_to_the_mean_power_of_noise() -> None:
    """R constant: the mean of ½ … is R times the mean square; Welch's window loses none of it on the average."""
    flat = Radiation(midbands(63, 8000), np.tile(3.0 * np.eye(2), (22, 1, 1)), np.eye(2), 400.0, 8e3, np.zeros(22))
    noise = np.random.default_rng(3).normal(size=(40_000, 2))
    found = power_of(segments(STEP * np.arange(len(noise)), noise, moved=False), flat)
    below = found.frequency > 0
    assert found.power[0, below].sum() == pytest.approx(3.0 * (noise**2).mean(axis=0).sum(), rel=0.02)


def test_power_between_lines_is_exact_for_every_multipole_and_close_for_sums() -> None:
    between = np.array([30.0, 70.0, 447.0, 5000.0])
    for velocity in (np.array([1.0, 0.0]), np.array([0.0, 1.0])):
        own = np.tile(velocity, (4, 1)).astype(complex)
        exact = [0.5 * velocity @ multipoles(np.array([f])).resistance[0] @ velocity for f in between]
        assert np.abs(radiated(between, own, SOUND) / exact - 1).max() < 1e-6
    both = np.tile([1.0 + 0j, 1.0], (4, 1))
    exact = np.array([0.5 * np.ones(2) @ multipoles(np.array([f])).resistance[0] @ np.ones(2) for f in between])
    assert np.abs(10 * np.log10(radiated(between, both, SOUND) / exact))[1:].max() < 0.1


def test_a_run_up_keeps_its_order_at_its_frequency() -> None:
    time = np.arange(0, 4.0, STEP)
    speed = 10 + 5 * time  # Hz; order 20 from 200 to 600 Hz
    phase = 2 * np.pi * 20 * np.cumsum(speed) * STEP
    moved = np.stack([np.sin(phase), 0 * phase], axis=1)
    pieces = segments(time, moved, width=8.0)
    found = power_of(pieces, SOUND, np.interp(pieces.middle, time, speed), steady=False)
    assert found.power.shape == (len(found.time), len(found.frequency)) and found.speed is not None
    assert np.abs(found.frequency[found.power.argmax(axis=1)] - 20 * found.speed).max() <= 12.0


def test_records_that_have_no_spectrum_are_refused() -> None:
    with pytest.raises(SoundError, match="equal steps"):
        segments(np.array([0.0, 1.0, 3.0] * 8).cumsum(), np.zeros((24, 2)))


def test_equivalent_radiated_power_is_that_of_iso_ts_7849() -> None:
    """L_W = L_v + 10 lg(S/S₀) + 10 lg(ρc/400 Ns/m³), L_v re 50 nm/s, S₀ = 1 m² (ISO/TS 7849-1, efficiency 1). By hand:
    a box of .3 × .2 × .1 m moves along z with 1 mm/s rms, two sides of .06 m²: 86.02 − 9.21 + .14 = 76.95 dB."""
    points, faces = box((0.3, 0.2, 0.1), (1, 1, 1))
    sound = radiation(skin_of(points, faces, rigid(points)), np.array([63.0]), count=60)
    time = np.arange(0, 1.0, STEP)
    velocity = np.zeros((len(time), 6))
    velocity[:, 2] = np.sqrt(2) * 1e-3 * np.sin(2 * np.pi * 500 * time)
    found = power_of(segments(time, velocity, moved=False), sound)
    assert found.total(erp=True)[0] == pytest.approx(76.95, abs=0.01)
    assert level(found.third_octaves(erp=True)[0])[9] == pytest.approx(76.95, abs=0.01)  # 500 Hz
