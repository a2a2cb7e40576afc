"""Reference data that external and internal spur gears share (ISO 21771 symbols)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gearfmu.geometry import involute


@dataclass(frozen=True)
class ReferenceGear:
    """Teeth z, module m (m), pressure angle alpha (rad), profile-shift coefficient x, and what follows from them."""

    z: int
    m: float
    alpha: float
    x: float

    @property
    def r(self) -> float:
        """Reference radius, m."""
        return self.m * self.z / 2

    @property
    def r_b(self) -> float:
        """Base radius, m."""
        return self.r * math.cos(self.alpha)

    @property
    def half_pitch(self) -> float:
        """Half the angle of a tooth and a space, π/z."""
        return math.pi / self.z

    @property
    def psi_b(self) -> float:
        """Half angle at the base circle, rad, of an external gear's tooth or an internal gear's space: ψ + inv α
        (ISO 21771)."""
        return (math.pi / 2 + 2 * self.x * math.tan(self.alpha)) / self.z + float(involute.inv(self.alpha))
