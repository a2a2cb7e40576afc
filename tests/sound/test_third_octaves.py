"""Third octaves and A-weighting against the printed tables of the standards."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfilt

from gearfmu.sound import a_weighting, level, midbands, nominal, segments, third_octaves

PRINTED = {  # IEC 61672-1, table 3: nominal frequency, dB
    20: -50.5, 25: -44.7, 31.5: -39.4, 40: -34.6, 50: -30.2, 63: -26.2, 80: -22.5, 100: -19.1, 125: -16.1, 160: -13.4,
    200: -10.9, 250: -8.6, 315: -6.6, 400: -4.8, 500: -3.2, 630: -1.9, 800: -0.8, 1000: 0.0, 1250: 0.6, 1600: 1.0,
    2000: 1.2, 2500: 1.3, 3150: 1.2, 4000: 1.0, 5000: 0.5, 6300: -0.1, 8000: -1.1, 10000: -2.5, 12500: -4.3,
    16000: -6.6, 20000: -9.3,
}  # fmt: skip
EXACT = [63.096, 79.433, 100.0, 125.89, 158.49, 199.53, 251.19, 316.23, 398.11, 501.19, 630.96, 794.33, 1000.0, 1258.9]


def test_midbands_are_those_of_iec_61260() -> None:
    bands = midbands(63, 8000)
    assert len(bands) == 22
    assert np.abs(bands[: len(EXACT)] / EXACT - 1).max() < 5e-5
    assert nominal(midbands()).tolist() == list(PRINTED)


def test_a_weighting_is_that_of_iec_61672() -> None:
    """The table is rounded to .1 dB, at exact frequencies."""
    assert np.abs(a_weighting(midbands()) - list(PRINTED.values())).max() <= 0.05 + 1e-3
    assert a_weighting(np.array([1000.0]))[0] == 0


def test_bands_share_the_power_of_lines_and_lose_none() -> None:
    frequency = np.arange(0, 2000, 4.0)
    power = np.random.default_rng(1).random((3, frequency.size))
    bands = midbands(50, 1000)
    low, high = bands[0] * 10**-0.05, bands[-1] * 10**0.05
    found = third_octaves(frequency, power, bands)
    inside = np.clip(np.minimum(frequency + 2, high) - np.maximum(frequency - 2, low), 0, 4) / 4
    assert np.abs(found.sum(axis=1) / (power @ inside) - 1).max() < 1e-12
    flat = third_octaves(frequency, np.ones(frequency.size), bands)
    assert np.abs(flat * 4 / (bands * (10**0.05 - 10**-0.05)) - 1).max() < 1e-12


def test_a_picowatt_is_zero_decibel() -> None:
    assert level(np.array([1e-12, 1e-6])).tolist() == [0.0, 60.0]
    assert level(np.array([0.0]))[0] < -900


def test_bands_are_those_of_filters_in_time() -> None:
    """Pink noise through Butterworth filters with the edges of IEC 61260-1, 5.5: .2 dB (measured .1)."""
    step, rng = 1 / 25600, np.random.default_rng(5)
    lines = np.fft.rfftfreq(2**18, step)
    values = np.fft.irfft(rng.normal(size=(2, len(lines))).T @ [1, 1j] / np.sqrt(np.maximum(lines, 1.0)))
    pieces = segments(step * np.arange(len(values)), values[:, None], moved=False)
    bands = midbands(500, 4000)
    found = third_octaves(pieces.frequency, 0.5 * (np.abs(pieces.velocity[:, :, 0]) ** 2).mean(axis=0), bands)
    for band, own in zip(bands, found, strict=True):
        edges = [band * 10**-0.05, band * 10**0.05]
        filtered = sosfilt(butter(8, edges, "bandpass", fs=1 / step, output="sos"), values)
        assert abs(10 * np.log10(own / (filtered[2000:] ** 2).mean())) < 0.2, band
