"""Hertz's point contact of a ball in a groove, and line contact of a roller on a ring.

Sources: ISO/TS 16281:2008, 4.2 (curvatures, stiffness); Johnson, *Contact Mechanics*, 4.2 and 4.3 (pressures).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

YOUNGS_MODULUS = 207e9  # Pa, of bearing steel in ISO/TS 16281
POISSON_RATIO = 0.3
_POINT = math.pi * math.sqrt(2) / 3  # of Hertz's theory; ISO/TS 16281 rounds it to 1.48
_SLENDEREST = 1e4  # ratio of the axes of a contact ellipse


@dataclass(frozen=True)
class Point:
    """Contact of a ball with one ring. curvature: sum of the curvatures, 1/m; axes: ratio of the axes of the contact
    ellipse; first, second: complete elliptic integrals of that ratio."""

    curvature: float
    axes: float
    first: float
    second: float

    @property
    def approach(self) -> float:
        """1/m^(1/3): what the contact adds to the approach of the rings, K (Σρ/(χ² E))^(1/3)."""
        return self.first * float((self.curvature / (self.axes**2 * self.second)) ** (1 / 3))

    def pressure(self, load: float, modulus: float = YOUNGS_MODULUS) -> float:
        """Largest pressure, Pa, under a load in N. modulus: Young's, Pa."""
        if load <= 0.0:
            return 0.0
        plane = modulus / (1 - POISSON_RATIO**2)
        a = (6 * self.axes**2 * self.second * load / (math.pi * self.curvature * plane)) ** (1 / 3)
        return 1.5 * load * self.axes / (math.pi * a * a)


def point(ball: float, groove: float, gamma: float) -> Point:
    """Contact of a ball of that diameter (m) with a groove of that radius (m). gamma: D_w cos α / D_pw of the inner
    ring, its negative of the outer."""
    ring = 2 / ball * gamma / (1 - gamma)
    total = 4 / ball + ring - 1 / groove
    difference = (ring + 1 / groove) / total
    axes = brentq(lambda chi: _difference(chi) - difference, 1 + 1e-9, _SLENDEREST, xtol=1e-12, rtol=1e-13)
    first, second = _integrals(axes)
    return Point(total, axes, first, second)


def point_stiffness(inner: Point, outer: Point, modulus: float = YOUNGS_MODULUS) -> float:
    """c_P, N/m^1.5, of Q = c_P δ^1.5: load of a ball between both rings. modulus: Young's, Pa."""
    return _POINT * modulus / (1 - POISSON_RATIO**2) * (inner.approach + outer.approach) ** -1.5


def line_pressure(load: float, radius: float) -> float:
    """Largest pressure, Pa, of a line contact under a load in N/m. radius: relative radius of curvature, m."""
    return math.sqrt(max(load, 0.0) * YOUNGS_MODULUS / (2 * (1 - POISSON_RATIO**2) * math.pi * radius))


def _integrals(axes: float) -> tuple[float, float]:
    """Complete elliptic integrals K and E of the modulus √(1 − 1/χ²)."""
    parameter = 1 - 1 / axes**2
    return float(ellipk(parameter)), float(ellipe(parameter))


def _difference(axes: float) -> float:
    """F(ρ), relative difference of the curvatures, of an ellipse with that ratio of the axes."""
    first, second = _integrals(axes)
    return 1 - 2 / (axes**2 - 1) * (first / second - 1)
