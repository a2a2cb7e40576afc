"""The planet carrier: a plate with a bore beside the planets, and a bolt for each planet."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class CarrierGeometry:
    """Carrier in the set's frame (m): axis z, z = 0 at the planets' mid-width, bolt 0 on +x.

    angles: of the bolts (rad), ascending. a: radius of the bolt circle. r_bore, r_o: bore and outer radius of the
    plate; it lies in z ∈ [plate_low, plate_high]. r_bolt: radius of the bolts, from the plate to z = +seat/2; their
    seats, where the planets' bearings sit, are z ∈ [−seat/2, seat/2].
    """

    angles: tuple[float, ...]
    a: float
    r_bore: float
    r_o: float
    r_bolt: float
    thickness: float
    gap: float
    seat: float

    @property
    def planets(self) -> int:
        """Number of bolts."""
        return len(self.angles)

    @property
    def plate_high(self) -> float:
        return -self.seat / 2 - self.gap

    @property
    def plate_low(self) -> float:
        return self.plate_high - self.thickness

    def bolt_axis(self, bolt: int) -> np.ndarray:
        """(3,) m, middle of the seat of a bolt: its master node."""
        angle = self.angles[bolt]
        return np.array([self.a * math.cos(angle), self.a * math.sin(angle), 0.0])

    @property
    def bore_centre(self) -> np.ndarray:
        """(3,) m, middle of the bore: its master node."""
        return np.array([0.0, 0.0, 0.5 * (self.plate_low + self.plate_high)])

    @property
    def volume(self) -> float:
        """m³."""
        plate = math.pi * (self.r_o**2 - self.r_bore**2) * self.thickness
        return plate + self.planets * math.pi * self.r_bolt**2 * (self.gap + self.seat)
