"""Sound power of a run: spectra of a body's coordinates by Welch's method, times the radiation matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearfmu.sound.levels import bands_of, level, third_octaves, weighted
from gearfmu.sound.radiation import Radiation
from gearfmu.sound.skin import SoundError

OVERLAP = 0.5  # of neighbouring segments
WIDTH = 4.0  # Hz, spacing of the lines when not given: less than a third of the third octave at 63 Hz


@dataclass(frozen=True)
class Segments:
    """Hann-windowed pieces of a record: middle (S,) s; frequency (F,) Hz; velocity (S, F, N): complex peak amplitudes
    of the coordinates' velocities, scaled so that ½ Σ_F |v|² is the mean square of the piece."""

    middle: np.ndarray
    frequency: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class SoundPower:
    """Of S segments (one, their mean, when steady) at frequency (F,) Hz: power, erp (S, F) W a line; erp: equivalent
    radiated power ½ρc ∫ v_n² dS. time (S,) s, speed (S,) of the channel that says it, or None."""

    frequency: np.ndarray
    power: np.ndarray
    erp: np.ndarray
    time: np.ndarray
    speed: np.ndarray | None = None

    @property
    def bands(self) -> np.ndarray:
        """(B,) Hz: midbands of the third octaves from 63 Hz to 8 kHz, less where the record ends earlier."""
        return bands_of(self.frequency)

    def third_octaves(self, erp: bool = False) -> np.ndarray:
        """(S, B) W."""
        return third_octaves(self.frequency, self.erp if erp else self.power, self.bands)

    def total(self, erp: bool = False) -> np.ndarray:
        """(S,): sound power level, dB re 1 pW."""
        return level((self.erp if erp else self.power).sum(axis=-1))

    def total_a(self, erp: bool = False) -> np.ndarray:
        """(S,): A-weighted sound power level, dB(A) re 1 pW."""
        return level(weighted(self.frequency, self.erp if erp else self.power).sum(axis=-1))


def segments(time: np.ndarray, coordinates: np.ndarray, width: float = WIDTH, moved: bool = True) -> Segments:
    """Segments of 1/`width` s (the whole record where it is shorter), half overlapping. time (T,) s, equally spaced;
    coordinates (T, N): displacements, or velocities where not `moved`.

    Raises SoundError for a record that is not equally spaced or has fewer than 16 samples.
    """
    step = np.diff(time)
    if len(time) < 16 or np.ptp(step) > 1e-3 * step.mean():
        raise SoundError("sound needs at least 16 samples at equal steps: record every communication step")
    interval = (time[-1] - time[0]) / (len(time) - 1)
    size = min(len(time), max(16, round(1 / (width * interval))))
    count = 1 + int((len(time) - size) / (size * (1 - OVERLAP)))
    begins = np.linspace(0, len(time) - size, count).round().astype(int)
    window = np.hanning(size + 1)[:-1]
    frequency = np.fft.rfftfreq(size, interval)
    scale = 2 / (size * np.sqrt((window**2).mean()))
    pieces = np.stack([_straightened(coordinates[begin : begin + size]) for begin in begins])
    amplitude = scale * np.fft.rfft(window[:, None] * pieces, axis=1)
    if moved:
        amplitude *= 2j * np.pi * frequency[:, None]
    amplitude[:, [0, -1] if size % 2 == 0 else [0]] /= np.sqrt(2)
    return Segments(time[begins] + 0.5 * (size - 1) * interval, frequency, amplitude)


def _straightened(piece: np.ndarray) -> np.ndarray:
    """Without mean and slope."""
    along = np.linspace(-1, 1, len(piece))[:, None]
    slope = (along * piece).sum(axis=0) / (along**2).sum()
    return piece - piece.mean(axis=0) - along * slope


def power_of(pieces: Segments, sound: Radiation, speed: np.ndarray | None = None, steady: bool = True) -> SoundPower:
    """Sound power of segments, their mean where `steady`; speed (S,): of each."""
    power = np.stack([radiated(pieces.frequency, own, sound) for own in pieces.velocity])
    erp = np.stack([0.5 * sound.impedance * _form(own, sound.gram) for own in pieces.velocity])
    time = pieces.middle
    if steady:
        power, erp, time = (own.mean(axis=0, keepdims=True) for own in (power, erp, time))
        speed = None if speed is None else np.atleast_1d(np.mean(speed))
    return SoundPower(pieces.frequency, power, erp, time, speed)


def radiated(frequency: np.ndarray, velocity: np.ndarray, sound: Radiation) -> np.ndarray:
    """(F,) W: ½ vᴴ R v of complex amplitudes velocity (F, N) at frequency (F,) Hz.

    Between two lines of R the sound power of these velocities follows a power law of the frequency, exact for any one
    multipole; the law of the first two lines holds below them, and R is constant above the last one.
    """
    lines, last = sound.frequency, len(sound.frequency) - 1
    found = np.zeros(len(frequency))
    after = np.clip(np.searchsorted(lines, frequency), 1, max(last, 1))
    for line in np.unique(after):
        own = np.flatnonzero((after == line) & (frequency > 0))
        low, high = (0.5 * _form(velocity[own], sound.resistance[min(i, last)]) for i in (line - 1, line))
        low, high = np.maximum(low, 1e-300), np.maximum(high, 1e-300)
        ends = np.log(lines[[line - 1, min(line, last)]])
        part = (np.log(frequency[own]) - ends[0]) / (ends[1] - ends[0] or 1.0)
        found[own] = np.exp(np.log(low) + np.minimum(part, 1.0) * np.log(high / low))
    return found


def _form(velocity: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """(F,): vᴴ R v, R real and symmetric."""
    return sum((part @ matrix * part).sum(axis=1) for part in (velocity.real, velocity.imag))
