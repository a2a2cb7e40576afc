"""How far one run is from another: relative rms of the alternating part, means apart (docs/theory.md, 6).

error      rms of the difference without its mean, over the rms of the reference's alternating part
mean error difference of the means, over the same rms: both errors are in one unit and add as squares
Settled scenes: the alternating part is the signal minus its mean, after settling. Transient scenes: the signal minus
the reference's moving average over 10 ms, whole window.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from gearfmu.cosim.accuracy import alternating, rms
from gearfmu.stage.run.te import set_error
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.forms.general import Stage

OCTAVES = (125.0, 250.0, 500.0, 1000.0, 2000.0)  # Hz, centres


@dataclass(frozen=True)
class Signals:
    """Signals by which a run is judged, sampled every `interval` s from `start` s on.

    te (n,) m, transmission error at the sample; of a train (n, meshes) · force (n,) N, mesh force, mean over the
    interval; of a train or set (n, meshes) · bearing (n, 2 B) N, x and y forces of every bearing (of a set: every pin),
    means over the interval · locked (n,) bool, the clutch, or None · steady: settled scene. A run that stopped early
    has fewer samples.
    """

    te: np.ndarray
    force: np.ndarray
    bearing: np.ndarray
    locked: np.ndarray | None
    interval: float
    start: float
    steady: bool

    def trace(self, meta: dict) -> Trace:
        """The signals as a Trace, to be kept in a file."""
        time = self.start + self.interval * np.arange(len(self.te))
        channels = {f"te_{k}": Channel(column, "m") for k, column in enumerate(np.atleast_2d(self.te.T))}
        channels |= {f"force_{k}": Channel(column, "N") for k, column in enumerate(np.atleast_2d(self.force.T))}
        channels |= {f"bearing_{k}": Channel(column, "N") for k, column in enumerate(self.bearing.T)}
        if self.locked is not None:
            channels["locked"] = Channel(self.locked)
        return Trace(time, channels, meta | {"interval": self.interval, "start": self.start, "steady": self.steady})


def signals_of(trace: Trace, stage: Stage, settle: float) -> Signals:
    """The signals of a coupled run after `settle` (s): transmission errors and forces of all meshes, and forces on all
    bearings but the seats of gears on their shafts; of a planetary set its own transmission error and its pins."""
    part = trace.window(settle * (1.0 - 1e-12))
    te = _set_te(part, stage) if stage.carriers else np.stack([part[f"{m.name}.te"] for m in stage.engagements], 1)
    force = np.stack([part[f"{mesh.name}.force_mean"] for mesh in stage.engagements], 1)
    held = "pin." if stage.carriers else "bearing."
    first = [name for name in part.channels if name.startswith(held) and name.endswith(".fx_mean")]
    names = [name.replace(".fx_", f".{axis}_") for name in first for axis in ("fx", "fy")]
    locked = next((part[name].astype(bool) for name in part.channels if name.endswith(".clutch.locked")), None)
    interval = float(trace.time[1] - trace.time[0])
    bearing = np.stack([part[name] for name in names], 1)
    return Signals(_flat(te), _flat(force), bearing, locked, interval, float(part.time[0]), settle > 0)


def _set_te(part: Trace, stage: Stage) -> np.ndarray:
    """(n,) m, of a planetary set as a whole."""
    r_b, ratio = set_error(stage)
    return np.asarray(r_b * (part["sun.gear.phi"] - ratio * part["carrier.gear.phi"]))


def _flat(columns: np.ndarray) -> np.ndarray:
    """(n,) where there is one column."""
    return columns[:, 0] if columns.shape[1:] == (1,) else columns


def kept_signals(trace: Trace) -> Signals:
    """The signals of a Trace made by `Signals.trace`."""
    te, force, bearing = (_columns(trace, name) for name in ("te", "force", "bearing"))
    locked = trace["locked"].astype(bool) if "locked" in trace else None
    place = (trace.meta[name] for name in ("interval", "start", "steady"))
    return Signals(_flat(te), _flat(force), bearing, locked, *place)


def _columns(trace: Trace, name: str) -> np.ndarray:
    return np.stack([trace[channel] for channel in trace.channels if channel.startswith(f"{name}_")], 1)


@dataclass(frozen=True)
class Errors:
    """Relative errors of transmission errors together, their means, mesh forces together, and bearing forces (the worst
    bearing, x and y together)."""

    te: float
    te_mean: float
    force: float
    bearing: float

    def below(self, share: float, other: Errors) -> bool:
        """Whether every alternating part's error is at most `share` of the other's."""
        return all(getattr(self, f.name) <= share * getattr(other, f.name) for f in fields(self) if f.name != "te_mean")


STOPPED = Errors(float("nan"), float("nan"), float("nan"), float("nan"))


def errors(found: Signals, wanted: Signals) -> Errors:
    """Errors of a run against a reference of the same samples; NaN when it stopped early."""
    if len(found.te) != len(wanted.te):
        return STOPPED
    te, mean = _relative(found.te, wanted.te, wanted)
    force, _ = _relative(found.force, wanted.force, wanted)
    first = range(0, wanted.bearing.shape[1], 2)
    sides = [_relative(found.bearing[:, k : k + 2], wanted.bearing[:, k : k + 2], wanted)[0] for k in first]
    return Errors(te, mean, force, max(sides))


def _relative(found: np.ndarray, wanted: np.ndarray, scale: Signals) -> tuple[float, float]:
    """Errors of alternating part and mean of (n,) or (n, k) components of one quantity, root of the sum of squares."""
    found, wanted = (values.reshape(len(values), -1) for values in (found, wanted))
    ac = [alternating(column, scale.interval, scale.steady) for column in wanted.T]
    size = float(np.sqrt(sum(rms(column) ** 2 for column in ac)))
    difference = found - wanted
    mean = difference.mean(axis=0)
    return float(np.sqrt(np.sum(np.var(difference, axis=0)))) / size, float(mean.sum()) / size


def lock_time(signals: Signals) -> float:
    """Time (s) of the last locking of the clutch; NaN when it is open at the end or there is none."""
    if signals.locked is None or not signals.locked.size or not signals.locked[-1]:
        return float("nan")
    opened = np.flatnonzero(~signals.locked)
    return signals.start + signals.interval * (float(opened[-1]) + 1.0 if opened.size else 0.0)


def band_levels(values: np.ndarray, interval: float) -> dict[float, float]:
    """rms in each octave band (centre Hz) below the sampling limit, of samples (n,), by a Hann window and Parseval."""
    window = np.hanning(values.size)
    centred = (values - np.average(values, weights=window)) * window
    power = 2.0 * np.abs(np.fft.rfft(centred)) ** 2 / (values.size * np.sum(window**2))
    frequency = np.fft.rfftfreq(values.size, interval)
    found = {}
    for centre in OCTAVES:
        inside = (frequency >= centre / np.sqrt(2)) & (frequency < centre * np.sqrt(2))
        if centre * np.sqrt(2) < 0.5 / interval and np.count_nonzero(inside) >= 3:
            found[centre] = float(np.sqrt(power[inside].sum()))
    return found


def band_error(found: Signals, wanted: Signals, window: slice) -> float:
    """Largest difference (dB) of the octave-band levels of the mesh force, of a set of the sum, over these samples; NaN
    when there are none."""
    if found.force.size != wanted.force.size or len(wanted.force[window]) < 32:
        return float("nan")
    both = (found, wanted)
    levels = [band_levels(s.force.reshape(len(s.force), -1).sum(axis=1)[window], s.interval) for s in both]
    return max((abs(20 * np.log10(levels[0][band] / levels[1][band])) for band in levels[1]), default=float("nan"))
