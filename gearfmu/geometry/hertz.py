"""Hertz's line contact, and the width that it has."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol


class Wide(Protocol):
    """Anything with a face width, m."""

    @property
    def face_width(self) -> float: ...


def common_width(gears: Iterable[Wide]) -> float:
    """Common face width (m) of gears in mesh."""
    return min(float(gear.face_width) for gear in gears)


def contact_modulus(modulus: tuple[float, float], poisson: tuple[float, float]) -> float:
    """E* (Pa) with 1/E* = (1−ν₁²)/E₁ + (1−ν₂²)/E₂."""
    return 1.0 / sum((1 - nu * nu) / e for e, nu in zip(modulus, poisson, strict=True))


def half_width(load: float, radius: float, e_star: float) -> float:
    """Half width b (m) of the contact of cylinders, √(4 w ρ/(π E*)): load w in N/m, relative radius ρ in m.

    Johnson, *Contact Mechanics*, eq. 4.43.
    """
    return math.sqrt(4 * load * radius / (math.pi * e_star))


def largest_relative_radius(length: float, low: float, high: float) -> float:
    """Largest relative radius of curvature s (L − s)/L (m) of two involutes for rolls s in [low, high]."""
    roll = min(max(length / 2, low), high)
    return roll * (length - roll) / length
