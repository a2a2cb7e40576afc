"""Numbers an NVH engineer reads from a signal: spectra, order cuts, band levels, spectrograms.

Amplitudes are root-mean-square values of the single spectral line, levels are 20·lg(amplitude / reference), the
reference 1 N for forces: a sine of peak value 1 N has −3.01 dB. Windows are Hann, whose coherent gain (1/2) and noise
bandwidth (3/2 lines) are taken out. Source: Bendat, Piersol, Random Data, 4th ed., ch. 11; Brandt, Noise and Vibration
Analysis, ch. 9–10 (spectra) and 12 (order tracking).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import firwin, resample_poly

from gearfmu.errors import GearfmuError

FLOOR = 1e-12
OVERSAMPLING, FILTER_REACH = 4, 32  # FILTER_REACH: samples on either side
HANN_NOISE_BANDWIDTH = 1.5
OCTAVES = tuple((c / np.sqrt(2), c, c * np.sqrt(2)) for c in (63, 125, 250, 500, 1000, 2000, 4000, 8000, 16000))


class MetricsError(GearfmuError):
    """A signal is too short or not evenly sampled for the metric asked for."""


@dataclass(frozen=True)
class Spectrum:
    """Amplitudes (F,), rms, in the signal's unit at frequency (F,) Hz, averaged over `segments` Hann windows."""

    frequency: np.ndarray
    amplitude: np.ndarray
    segments: int

    @property
    def resolution(self) -> float:
        """Distance of two lines, Hz."""
        return float(self.frequency[1])


@dataclass(frozen=True)
class Spectrogram:
    """Amplitudes (T, F), rms, at window centres time (T,) s and frequency (F,) Hz."""

    time: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray


@dataclass(frozen=True)
class OrderCuts:
    """Amplitudes (K, T), rms, of the mesh orders (K,) at time (T,) s; NaN where an order lies above the sampling limit.

    mesh_frequency (T,) Hz is that of the first order.
    """

    time: np.ndarray
    mesh_frequency: np.ndarray
    orders: np.ndarray
    amplitude: np.ndarray


@dataclass(frozen=True)
class OrderMap:
    """Amplitudes (T, O), rms, at orders (O,) of a shaft, over windows centred at time (T,) s at its speed (T,)
    rad/s."""

    time: np.ndarray
    speed: np.ndarray
    order: np.ndarray
    amplitude: np.ndarray


def level(amplitude: np.ndarray | float, reference: float = 1.0) -> np.ndarray:
    """Level in dB re `reference`; −240 dB at most below it for a signal that is zero."""
    return 20 * np.log10(np.maximum(np.asarray(amplitude, dtype=float) / reference, FLOOR))


def sample_step(time: np.ndarray) -> float:
    """The even sampling interval of `time` (n,), s; raises MetricsError when steps differ by more than 1e-3 of it."""
    if time.size < 2:
        raise MetricsError("one sample has no spectrum; record a longer run")
    steps = np.diff(time)
    step = float(time[-1] - time[0]) / (time.size - 1)
    if np.max(np.abs(steps - step)) > 1e-3 * step:
        raise MetricsError("the samples are not evenly spaced in time; record at a constant interval")
    return step


def undo_mean(amplitude: np.ndarray, frequency: np.ndarray, averaged: float) -> np.ndarray:
    """Amplitudes at frequency (Hz) of a signal whose samples are means over `averaged` s, as they are without: such a
    mean multiplies a vibration by sin(π f T)/(π f T). 0: samples, as they are."""
    return amplitude / np.sinc(frequency * averaged)


def amplitude_spectrum(values: np.ndarray, step: float, segment: int | None = None, averaged: float = 0.0) -> Spectrum:
    """Hann spectrum of values (n,) sampled every `step` s, mean removed, segments overlapping by half.

    segment : samples a window; all of them when None. Powers are averaged over segments. averaged : `undo_mean`.
    Raises MetricsError for fewer than 16 samples.
    """
    size = min(segment or values.size, values.size)
    frames = _frames(values, size, max(size // 2, 1))
    power = np.mean(_amplitudes(frames) ** 2, axis=0)
    frequency = np.fft.rfftfreq(size, step)
    return Spectrum(frequency, undo_mean(np.sqrt(power), frequency, averaged), frames.shape[0])


def spectrogram(values: np.ndarray, step: float, segment: int, hop: int, averaged: float = 0.0) -> Spectrogram:
    """Hann spectra of windows of `segment` samples every `hop` samples, mean of each window removed; averaged:
    `undo_mean`."""
    frames = _frames(values, segment, hop)
    centres = (np.arange(frames.shape[0]) * hop + (segment - 1) / 2) * step
    frequency = np.fft.rfftfreq(segment, step)
    return Spectrogram(centres, frequency, undo_mean(_amplitudes(frames), frequency, averaged))


def band_rms(spectrum: Spectrum, low: float, high: float) -> float:
    """Root mean square of what lies between `low` and `high` Hz, window bandwidth taken out (Parseval)."""
    inside = (spectrum.frequency >= low) & (spectrum.frequency < high)
    return float(np.sqrt(np.sum(spectrum.amplitude[inside] ** 2) / HANN_NOISE_BANDWIDTH))


def octave_levels(spectrum: Spectrum) -> dict[float, float]:
    """Level in dB re 1 of each octave band (IEC 61260 centres, 63 Hz … 16 kHz) that lies in the spectrum and holds ≥ 3
    lines."""
    top = spectrum.frequency[-1]
    return {
        float(centre): float(level(band_rms(spectrum, low, high)))
        for low, centre, high in OCTAVES
        if high <= top * 1.0001 and (high - low) >= 3 * spectrum.resolution
    }


def mesh_angle(time: np.ndarray, speed: np.ndarray, teeth: int) -> np.ndarray:
    """Angle (n,) rad of the first mesh order: teeth · ∫|speed| dt by the trapezoidal rule; speed (n,) in rad/s."""
    rate = np.abs(speed) * teeth
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))))


def order_cuts(
    time: np.ndarray, values: np.ndarray, angle: np.ndarray, orders: int = 5, periods: int = 8, averaged: float = 0.0
) -> OrderCuts:
    """Follow mesh orders 1 … `orders` of values (n,) along the mesh angle (n,) rad (from `mesh_angle`).

    Each point is a Fourier coefficient over a Hann window of `periods` mesh periods *in angle*, so that a signal of
    constant order keeps its amplitude while the speed changes. Points lie half a window apart. averaged : `undo_mean`.
    Raises MetricsError when the record holds less than one window.
    """
    width = 2 * np.pi * periods
    if angle[-1] < width:
        raise MetricsError(f"the record holds {angle[-1] / (2 * np.pi):.1f} mesh periods, order cuts need {periods}")
    centres = np.arange(width / 2, angle[-1] - width / 2 * 0.999, width / 4)
    found = np.array(range(1, orders + 1))
    step = sample_step(time)
    amplitude = np.full((orders, centres.size), np.nan)
    centre_time = np.interp(centres, angle, time)
    frequency = np.gradient(angle, time) / (2 * np.pi)
    mesh_frequency = np.interp(centres, angle, frequency)
    for column, centre in enumerate(centres):
        a, b = np.searchsorted(angle, [centre - width / 2, centre + width / 2])
        usable = found * np.max(frequency[a:b]) < 0.45 / step if b - a > 2 * periods else np.zeros(orders, dtype=bool)
        amplitude[usable, column] = _coefficients(angle[a:b] - centre, values[a:b], found[usable], width)
    amplitude = undo_mean(amplitude, found[:, None] * mesh_frequency, averaged)
    return OrderCuts(centre_time, mesh_frequency, found, amplitude)


def order_map(
    time: np.ndarray, values: np.ndarray, angle: np.ndarray, highest: float, turns: int = 4, averaged: float = 0.0
) -> OrderMap:
    """Orders up to `highest` of values (n,) along the angle (n,) rad of a shaft, which grows all the time.

    The signal is taken at equal steps of the angle, so that an order stays a line while the speed
    changes; Hann windows of `turns` revolutions, one revolution apart: lines 1/turns of an order apart. Orders above
    0.45 of the sampling rate at the window's speed are NaN. averaged : `undo_mean`. Raises MetricsError where the angle
    turns round or the record holds less than one window.
    """
    steps, interval = np.diff(angle), sample_step(time)
    if np.any(steps <= 0):
        raise MetricsError("the shaft is at rest or reverses: it has no orders")
    if angle[-1] - angle[0] < 2 * np.pi * turns:
        held = (angle[-1] - angle[0]) / (2 * np.pi)
        raise MetricsError(f"the record holds {held:.1f} revolutions, an order map needs {turns}; record a longer run")
    each = int(np.ceil(2 * np.pi / steps.min()))  # samples a revolution: none is left out where the shaft is slowest
    even = angle[0] + np.arange(int((angle[-1] - angle[0]) / (2 * np.pi) * each)) * (2 * np.pi / each)
    frames = _frames(_oversampled(angle, values)(even), turns * each, each)
    centres = angle[0] + 2 * np.pi * (np.arange(len(frames)) + 0.5 * turns)
    ends = [np.interp(centres + side * np.pi / 2, angle, time) for side in (-1, 1)]
    speed = np.pi / (ends[1] - ends[0])  # mean over half a revolution: free of the shaft's vibration
    order = np.arange(frames.shape[1] // 2 + 1) / turns
    kept = order <= highest
    amplitude = _amplitudes(frames)[:, kept]
    limit = 0.45 / interval * 2 * np.pi / speed
    amplitude[order[None, kept] > limit[:, None]] = np.nan
    amplitude = undo_mean(amplitude, order[None, kept] * speed[:, None] / (2 * np.pi), averaged)
    return OrderMap(np.interp(centres, angle, time), speed, order[kept], amplitude)


def _oversampled(angle: np.ndarray, values: np.ndarray) -> CubicSpline:
    """The signal over the angle by a spline through OVERSAMPLING times as many points, which a band-limited filter puts
    between the samples: a spline through the samples alone weakens what lies above a fifth of their rate."""
    count = OVERSAMPLING * (angle.size - 1) + 1
    between = firwin(2 * FILTER_REACH * OVERSAMPLING + 1, 1 / OVERSAMPLING, window=("kaiser", 8.0))  # ripple 1e-4
    fine = resample_poly(values, OVERSAMPLING, 1, window=between, padtype="line")[:count]
    places = np.arange(count) / OVERSAMPLING
    return CubicSpline(CubicSpline(np.arange(angle.size), angle)(places), fine)


def _coefficients(angle: np.ndarray, values: np.ndarray, orders: np.ndarray, width: float) -> np.ndarray:
    """Rms amplitude of each order by Hann-weighted least squares in angle  (docs/theory eq. 14)."""
    weight = np.cos(np.pi * angle / width) * np.sqrt(np.gradient(angle))
    harmonics = np.outer(angle, orders)
    basis = np.column_stack([np.ones_like(angle), np.cos(harmonics), np.sin(harmonics)]) * weight[:, None]
    solution = np.linalg.solve(basis.T @ basis, basis.T @ (values * weight))  # columns are all but orthogonal
    k = orders.size
    return np.hypot(solution[1 : k + 1], solution[k + 1 :]) / np.sqrt(2)


def _frames(values: np.ndarray, size: int, hop: int) -> np.ndarray:
    if size < 16 or values.size < size:
        raise MetricsError(
            f"{values.size} samples are too few for a window of {size} (at least 16); record a longer run"
        )
    return np.lib.stride_tricks.sliding_window_view(values.astype(float), size)[::hop]


def _amplitudes(frames: np.ndarray) -> np.ndarray:
    """Rms amplitude of every line of every frame (mean removed with the window's weights, so that it does not leak)."""
    size = frames.shape[-1]
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(size) / size)
    centred = frames - np.average(frames, axis=-1, weights=window)[..., None]
    lines = np.abs(np.fft.rfft(centred * window)) / window.sum()
    lines[..., 1 : (size + 1) // 2] *= np.sqrt(2)
    return lines
