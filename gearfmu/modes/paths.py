"""Transfer paths: what every direction of a bearing contributes to the acceleration of one sensor of a housing.

Forces F_i of the bearings on their seats reach a sensor as a_i(ω) = −ω² H_i(ω) F_i(ω), and a = Σ a_i (theory 11, 39).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.body import Body
from gearfmu.errors import near_or_all
from gearfmu.modes.housed import paths
from gearfmu.modes.housing import placed_housing
from gearfmu.sound import SoundError, bands_of, midbands, segments, third_octaves
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage

SENSOR = "sensor."


@dataclass(frozen=True)
class TransferPaths:
    """At one sensor, of s directions of bearings at F lines: sensor, its channel; names (s,) of the forces; frequency
    (F,) Hz; alone, joint (F, s) (m/s²)² a line: mean square of each contribution, and its part ½ Re a_i a* of the mean
    square of their sum. A path below 0 makes the sensor quieter."""

    sensor: str
    names: tuple[str, ...]
    frequency: np.ndarray
    alone: np.ndarray
    joint: np.ndarray

    @property
    def bands(self) -> np.ndarray:
        """(B,) Hz: midbands of the third octaves from 63 Hz to 8 kHz, less where the record ends earlier."""
        return bands_of(self.frequency)

    def share(self, band: float | None = None) -> np.ndarray:
        """(s,): part of every path in the mean square of the sensor, sum 1, in the third octave of a nominal frequency
        (Hz), or in all of them when None."""
        own = self._in(self.joint, band)
        return np.asarray(own / own.sum())

    def rms(self, band: float | None = None) -> np.ndarray:
        """(s,) m/s²: of every contribution alone, in a third octave or in all."""
        return np.sqrt(self._in(self.alone, band))

    def octaves(self) -> tuple[np.ndarray, np.ndarray]:
        """`alone`, `joint` (s, B) by third octaves, (m/s²)²."""
        alone, joint = (third_octaves(self.frequency, own.T, self.bands) for own in (self.alone, self.joint))
        return alone, joint

    def _in(self, lines: np.ndarray, band: float | None) -> np.ndarray:
        bands = self.bands if band is None else midbands(band, band)
        if not np.isin(np.round(bands), np.round(self.bands)).all():
            known = f"{self.bands[0]:.0f} to {self.bands[-1]:.0f} Hz"
            raise SoundError(f"no third octave at {band:g} Hz: the record has {known}")
        return np.asarray(third_octaves(self.frequency, lines.T, bands).sum(axis=-1))


def paths_of(run: Trace, stage: Stage, bodies: Sequence[Body], sensor: str, start: float = 0.0) -> TransferPaths:
    """Paths to `sensor`, "top.ay" or "sensor.top.ay", of a run of a housed stage or a trace of `house` from `start` on.

    Raises SoundError for an unknown sensor and a record without equal steps, TraceError for forces that were not
    recorded, ModelError for a stage without a housing.
    """
    placed, name = placed_housing(stage, bodies), f"{SENSOR}{sensor.removeprefix(SENSOR)}"
    if name not in placed.sensors:
        raise SoundError(f"no sensor '{name}': {near_or_all(name, placed.sensors, 'there are')}")
    means = all(f"{own}_mean" in run for own in placed.seats)
    force = np.stack([run[f"{own}_mean" if means else own] for own in placed.seats], axis=1)
    heard = run.time >= start
    pieces = segments(run.time[heard], force[heard], moved=False)
    lines = pieces.frequency[1:]
    averaging = np.sinc(lines * (run.time[1] - run.time[0])) if means else np.ones(len(lines))
    own = paths(placed.housing, 2 * np.pi * lines, pieces.velocity[:, 1:], placed.sensors.index(name))
    own = own / averaging[:, None]
    joint = (own * own.sum(axis=2, keepdims=True).conj()).real
    alone, joint = (0.5 * np.pad(part.mean(axis=0), ((1, 0), (0, 0))) for part in (np.abs(own) ** 2, joint))
    return TransferPaths(name, placed.seats, pieces.frequency, alone, joint)
