"""Flank tolerances of ISO 1328-1:2013, and sets of deviations within a class, drawn by seed.

Lengths are metres here and in the standard millimetres and micrometres: of d = 100 mm, m_n = 2 mm, b = 20 mm class 5
allows f_pT = 6 µm. The standard defines a tolerance as that of class 5 times √2^(A − 5), not rounded in between, and
rounds at last: above 10 µm to 1 µm, from 5 µm to 0.5 µm, below to 0.1 µm (5.2).
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_MM, _UM = 1e-3, 1e-6


@dataclass(frozen=True)
class Tolerances:
    """Of one gear and class, m: single pitch f_pT, total cumulative pitch F_pT, profile slope f_HαT (±), helix slope
    f_HβT (±)."""

    single_pitch: float
    cumulative_pitch: float
    profile_slope: float
    helix_slope: float

    @classmethod
    def of(cls, tolerance_class: int, reference_diameter: float, module: float, face_width: float) -> Tolerances:
        """Class A = 1 … 11, reference diameter d, normal module m_n and face width b in m: formulas (5)
        to (7) and (10)."""
        d, m, b = (length / _MM for length in (reference_diameter, module, face_width))
        step = math.sqrt(2.0) ** (tolerance_class - 5)
        cumulative = 0.002 * d + 0.55 * math.sqrt(d) + 0.7 * m + 12
        profile, helix = 0.4 * m + 0.001 * d + 4, 0.05 * math.sqrt(d) + 0.35 * math.sqrt(b) + 4
        return cls(*(_UM * rounded(step * value) for value in (0.001 * d + 0.4 * m + 5, cumulative, profile, helix)))


def rounded(tolerance: float) -> float:
    """A tolerance in µm as the standard rounds it (5.2.3)."""
    unit = 1.0 if tolerance > 10 else 0.5 if tolerance >= 5 else 0.1
    return math.floor(tolerance / unit + 0.5) * unit


@dataclass(frozen=True)
class Draw:
    """Deviations of one gear. index (2 flanks, z) m: individual index deviations F_pi, arc on the reference circle,
    positive counter-clockwise; profile, helix (2 flanks, z) m: slopes, positive where material grows towards the tip
    and towards +z."""

    index: np.ndarray
    profile: np.ndarray
    helix: np.ndarray


def draw(
    tolerances: Tolerances, teeth: int, pressure_angle: float, seed: Sequence[int], per_tooth: bool = True
) -> Draw:
    """A gear of these tolerances, the same for the same seed (integers) on every machine and with every numpy.

    Pitch: what an eccentric toothing gives, F_i = ½ A sin(2πi/z − ψ ∓ α_t), − on flank sg = +1, and independent errors
    of every tooth, Gaussian with f_pT/4; then all of it is scaled so that neither the largest single pitch deviation
    exceeds f_pT nor the range of F_i exceeds F_pT on either flank, and one of them is reached. A lies between 0.6 and
    0.9 F_pT before. Slopes: 0.6 a + 0.25 sin(2πi/z − χ) + 0.15 b_i of the tolerance, a of the flank and b_i of the
    tooth even between ±1, which is never more than the tolerance; not per_tooth: a alone.
    """
    numbers = Stream(seed)
    turn = 2 * math.pi * np.arange(teeth) / teeth
    first = tolerances.cumulative_pitch * 0.5 * (0.6 + 0.3 * numbers.even())
    phase = 2 * math.pi * numbers.even()
    own = 0.25 * tolerances.single_pitch * np.array([numbers.normal() for _ in range(teeth)])
    index = np.array([first * np.sin(turn - phase - sg * pressure_angle) + own for sg in (1, -1)])
    single = np.abs(index - np.roll(index, 1, axis=1)).max()
    index *= min(tolerances.single_pitch / single, tolerances.cumulative_pitch / np.ptp(index, axis=1).max())
    slopes = [
        np.array([_slopes(numbers, turn, per_tooth) for _ in (0, 1)]) * limit
        for limit in (tolerances.profile_slope, tolerances.helix_slope)
    ]
    return Draw(index, *slopes)


def _slopes(numbers: Stream, turn: np.ndarray, per_tooth: bool) -> np.ndarray:
    """Slopes of all teeth of one flank, parts of the tolerance."""
    mean, phase = 2 * numbers.even() - 1, 2 * math.pi * numbers.even()
    own = np.array([2 * numbers.even() - 1 for _ in turn])
    if not per_tooth:
        return np.full(turn.size, mean)
    return 0.6 * mean + 0.25 * np.sin(turn - phase) + 0.15 * own


class Stream:
    """Random numbers from the raw bits of numpy's PCG64, whose stream numpy keeps for ever (NEP 19); even and normal
    numbers are made of them here, because numpy may change how it does."""

    def __init__(self, seed: Sequence[int]):
        self._bits = np.random.PCG64(np.random.SeedSequence(list(seed)))

    def even(self) -> float:
        """Even between 0 and 1, 53 bits."""
        return (int(self._bits.random_raw()) >> 11) * 2.0**-53

    def normal(self) -> float:
        """Standard normal (Box and Muller)."""
        radius = math.sqrt(-2 * math.log(1 - self.even()))
        return radius * math.cos(2 * math.pi * self.even())


def seed_of(seed: int, name: str) -> tuple[int, int]:
    """The seed of one gear: those of one stage differ by their names."""
    return seed, zlib.crc32(name.encode())
