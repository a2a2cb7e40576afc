"""Third octaves (IEC 61260-1), A-weighting (IEC 61672-1) and levels of sound power re 1 pW (ISO 80000-8)."""

from __future__ import annotations

import numpy as np

REFERENCE = 1e-12  # W
RATIO = 10**0.3  # an octave, IEC 61260-1, 5.2.1
SERIES = np.array([1, 1.25, 1.6, 2, 2.5, 3.15, 4, 5, 6.3, 8])
BANDS = (63.0, 8000.0)  # Hz, nominal first and last third octave
NONE = -999.0  # dB, of no power at all


def midbands(low: float = 20.0, high: float = 20e3) -> np.ndarray:
    """(B,) Hz: exact midband frequencies 1000 G^(x/3) of third octaves from the band of `low` to that of `high`, which
    may be nominal frequencies; IEC 61260-1, 5.4."""
    first, last = (round(3 * np.log(f / 1000) / np.log(RATIO)) for f in (low, high))
    return 1000 * RATIO ** (np.arange(first, last + 1) / 3)


def bands_of(frequency: np.ndarray) -> np.ndarray:
    """(B,) Hz: midbands of the third octaves of BANDS, less where the lines (F,) Hz of a record end earlier."""
    every = midbands(*BANDS)
    return every[every * 10**0.05 < frequency[-1]]


def nominal(bands: np.ndarray) -> np.ndarray:
    """Hz: nominal frequencies of third octaves `bands` (B,), as 63 or 3150; IEC 61260-1, annex E."""
    number = np.round(10 * np.log10(bands)).astype(int)
    return SERIES[number % 10] * 10.0 ** (number // 10)


def third_octaves(frequency: np.ndarray, power: np.ndarray, bands: np.ndarray) -> np.ndarray:
    """Power (…, B) in bands (B,) of `midbands`, of lines power (…, F) at equally spaced frequency (F,) Hz. A line's
    power is spread evenly over its own width; sums over bands are those of the lines between the outer band edges."""
    half = 0.5 * (frequency[1] - frequency[0])
    low, high = bands * RATIO ** (-1 / 6), bands * RATIO ** (1 / 6)
    upper = np.minimum(frequency[:, None] + half, high)
    share = np.clip(upper - np.maximum(frequency[:, None] - half, low), 0, None) / (2 * half)
    return power @ share


def a_weighting(frequency: np.ndarray) -> np.ndarray:
    """dB at frequencies in Hz, 0 at 1 kHz; IEC 61672-1, annex E."""
    f = np.asarray(frequency, dtype=float)
    return _weight(f) - _weight(np.array(1000.0))


def _weight(f: np.ndarray) -> np.ndarray:
    f1, f2, f3, f4 = 20.598997, 107.65265, 737.86223, 12194.217
    squared = np.maximum(f, 1e-3) ** 2
    gain = f4**2 * squared**2 / ((squared + f1**2) * np.sqrt((squared + f2**2) * (squared + f3**2)) * (squared + f4**2))
    return 20 * np.log10(gain)


def level(power: np.ndarray) -> np.ndarray:
    """dB re 1 pW of power in W; `NONE` where there is none."""
    return np.where(power > 0, 10 * np.log10(np.maximum(power, 1e-300) / REFERENCE), NONE)


def weighted(frequency: np.ndarray, power: np.ndarray) -> np.ndarray:
    """Power (…, F) in W with the A-weighting of its frequencies (F,)."""
    return power * 10 ** (0.1 * a_weighting(frequency))
