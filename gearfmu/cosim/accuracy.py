"""What the coupling costs: Richardson's estimate of its error from a run with half the communication step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gearfmu.stage.run.trace import Trace

AVERAGE_OVER = 10e-3  # s: in transient runs AC is the signal minus this moving average of the reference


@dataclass(frozen=True)
class Window:
    """From when signals are compared, s; steady: AC is the signal minus its mean, else minus a 10 ms moving average."""

    start: float
    steady: bool


class ChannelError(NamedTuple):
    """Estimated coupling error of a channel: rms in its unit, and that over the rms of the channel's AC part."""

    rms: float
    relative: float


def coupling_errors(coarse: Trace, fine: Trace, order: int, window: Window) -> dict[str, ChannelError]:
    """Error of `coarse` (communication step H) by channel: 2^p/(2^p − 1)·rms(y_H − y_{H/2}).

    fine : the same scene with H/2. Only real-valued channels with an AC part, at the common times; not the means and
    maxima over a communication step, which are other quantities when the step is another one.
    """
    index = 2 * np.flatnonzero(coarse.time >= window.start)
    index = index[index < fine.time.size]
    factor, interval = 2.0**order / (2.0**order - 1.0), float(coarse.time[1] - coarse.time[0])
    found = {}
    for name in _comparable(coarse, fine) if index.size > 1 else ():
        reference = fine[name][index]
        ac = rms(alternating(reference, interval, window.steady))
        if ac > 1e-9 * rms(reference):
            error = factor * rms(coarse[name][index // 2] - reference)
            found[name] = ChannelError(error, error / ac)
    return found


def _comparable(coarse: Trace, fine: Trace) -> list[str]:
    real = [name for name in coarse.channels if name in fine.channels and coarse[name].dtype == np.float64]
    return [name for name in real if not name.endswith(("_mean", "_max"))]


def alternating(values: np.ndarray, interval: float, steady: bool) -> np.ndarray:
    """AC part (n,) of samples `interval` s apart: minus the mean, or minus the centred 10 ms moving average (shorter
    at the ends)."""
    if steady:
        return values - values.mean()
    width = max(1, round(AVERAGE_OVER / interval)) | 1
    ones = np.ones(min(width, values.size | 1))
    count = np.convolve(np.ones(values.size), ones, mode="same")[: values.size]
    return values - np.convolve(values, ones, mode="same")[: values.size] / count


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0
