"""How far a run is from the full model, in budgets: 1 is an error as large as was asked for.

Spectra X (run) and Y (full model) of the same Hann-weighted samples; sums go over the lines in the band:

    level      |10 lg(Σ|X|²/Σ|Y|²)|                 over the budget in dB
    waveform   min over τ of √(Σ|X e^{iωτ} − Y|²/Σ|Y|²)   over the budget; τ: a delay common to all of an output

An error is the largest over the outputs. It is taken over nested windows 0.4 W, 0.7 W and W, and what is compared with
1 is the bound B = e(W) + 2 std of the three.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearfmu.planning.request import Output, Request
from gearfmu.stage import Trace

NESTED = (0.4, 0.7, 1.0)
SAFETY, SAFETY_LOSS = 1.25, 2.0  # without and with loss of contact
FAILED = float("inf")
DELAYS = 41  # looked at, over plus and minus two samples
SILENT = 1e-9  # of the largest value of a signal: rounding, no signal
LEAST_LINES = 3  # of the spectrum in the band


@dataclass(frozen=True)
class Signals:
    """values: output → (n,), samples `interval` s apart."""

    values: dict[str, np.ndarray]
    interval: float

    def part(self, start: float, end: float) -> Signals:
        """From a share of the samples to another."""
        cut = {name: v[round(start * v.size) : round(end * v.size)] for name, v in self.values.items()}
        return Signals(cut, self.interval)


def signals_of(part: Trace, request: Request, interval: float) -> Signals:
    """The judged outputs of a trace whose samples are `interval` s apart."""
    values = {o.name: np.sum([f * part[name] for name, f in o.channels], axis=0) for o in request.outputs}
    return Signals(values, interval)


@dataclass(frozen=True)
class Error:
    """In budgets: bound, and error over the whole window."""

    bound: float
    whole: float


def error(found: Signals, wanted: Signals, request: Request) -> Error:
    """How far `found` is from `wanted`; infinite where a run did not reach the end or is not finite."""
    sizes = {v.size for v in wanted.values.values()}
    if not found.values or {v.size for v in found.values.values()} != sizes:
        return Error(FAILED, FAILED)
    each = [_worst(found.part(0, w), wanted.part(0, w), request) for w in NESTED]
    bound = each[-1] + 2.0 * float(np.std(each)) if np.all(np.isfinite(each)) else FAILED
    return Error(bound, each[-1])


def _worst(found: Signals, wanted: Signals, request: Request) -> float:
    return max(_distance(found, wanted, output, request) for output in request.outputs)


def _distance(found: Signals, wanted: Signals, output: Output, request: Request) -> float:
    """Error of one output, in budgets."""
    if not np.all(np.isfinite(found.values[output.name])):
        return FAILED
    omega, x, y = _lines(found, wanted, output, request)
    powers = np.sum(np.abs(x) ** 2), np.sum(np.abs(y) ** 2)
    each = []
    if request.level is not None:
        each.append(abs(10 * np.log10(max(powers[0], 1e-300) / max(powers[1], 1e-300))) / request.level)
    if request.waveform is not None:
        each.append(waveform_error(omega, x, y, found.interval) / request.waveform)
    return float(max(each))


def _lines(
    found: Signals, wanted: Signals, output: Output, request: Request
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """ω and complex lines of both in the band, with the mean over the sampling interval taken out."""
    size, interval = wanted.values[output.name].size, wanted.interval
    frequency = np.fft.rfftfreq(size, interval)
    inside = (frequency >= request.band[0]) & (frequency <= request.band[1])
    undo = 1.0 / np.sinc(frequency[inside] * interval) if output.averaged else 1.0
    x, y = (_spectrum(part.values[output.name])[inside] * undo for part in (found, wanted))
    return 2 * np.pi * frequency[inside], x, y


def _spectrum(values: np.ndarray) -> np.ndarray:
    """Hann-weighted, straight line taken out."""
    time = np.linspace(-1.0, 1.0, values.size)
    line = np.polynomial.polynomial.polyfit(time, values, 1)
    return np.fft.rfft((values - line[0] - line[1] * time) * np.hanning(values.size))


def waveform_error(omega: np.ndarray, x: np.ndarray, y: np.ndarray, interval: float) -> float:
    """Relative rms distance of two spectra after the common delay, at most two samples, that makes it least."""
    cross, powers = np.conj(y) * x, np.sum(np.abs(x) ** 2) + np.sum(np.abs(y) ** 2)
    scale = max(float(np.sum(np.abs(y) ** 2)), 1e-300)
    delays = interval * np.linspace(-2.0, 2.0, DELAYS)
    for _ in range(3):
        left = powers - 2.0 * np.real(np.exp(1j * np.outer(delays, omega)) @ cross)
        best, width = delays[int(np.argmin(left))], delays[1] - delays[0]
        delays = best + width * np.linspace(-1.0, 1.0, DELAYS)
    return float(np.sqrt(max(float(left.min()), 0.0) / scale))


def split_half_noise(wanted: Signals, request: Request) -> float:
    """Difference of the levels of the two halves of the full model's window, in budgets of the level (of 1 dB where
    only a waveform is asked for), the largest of the outputs: what a window of half the length does not know."""
    level = Request(request.outputs, request.band, request.level or 1.0)
    first, second = wanted.part(0, 0.5), wanted.part(0.5, 1.0)
    size = min(v.size for part in (first, second) for v in part.values.values())
    first, second = (Signals({k: v[:size] for k, v in p.values.items()}, p.interval) for p in (first, second))
    return _worst(second, first, level)


def silent_outputs(wanted: Signals, request: Request) -> list[str]:
    """Outputs without a signal in the band: rounding, or fewer lines than say anything."""
    found = []
    for output in request.outputs:
        _, _, y = _lines(wanted, wanted, output, request)
        values = wanted.values[output.name]
        rms = np.sqrt(np.sum(np.abs(y) ** 2)) / values.size
        if y.size < LEAST_LINES or rms <= SILENT * np.abs(values).max():
            found.append(output.name)
    return found


def trend(values: Signals, request: Request, parts: int = 8) -> float:
    """Slow growth: how far the level of the worst output rises over the window along a straight line through its parts,
    in dB, less twice what the parts scatter about it."""
    rises = []
    for output in request.outputs:
        cut = [values.part(k / parts, (k + 1) / parts) for k in range(parts)]
        levels = np.array([10 * np.log10(_power(part, output, request)) for part in cut])
        at = np.linspace(0.0, 1.0, parts)
        slope, start = np.polyfit(at, levels, 1)
        rises.append(abs(float(slope)) - 2.0 * float(np.std(levels - start - slope * at)))
    return max(0.0, *rises)


def _power(values: Signals, output: Output, request: Request) -> float:
    _, x, _ = _lines(values, values, output, request)
    return max(float(np.sum(np.abs(x) ** 2)), 1e-300)
