"""The involute of a circle over the roll s: length of its tangent from base circle to flank point (ISO 21771).

Flank side sg = +1 is the flank at the larger angle of a tooth centred on +x, sg = −1 its mirror image. All functions
broadcast.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

_INV_SERIES = (1 / 3, 2 / 15, 17 / 315, 62 / 2835, 1382 / 155925, 21844 / 6081075)


def inv(angle: ArrayLike) -> np.ndarray:
    """Involute function tan α − α (ISO 21771), accurate also for small angles."""
    angle = np.asarray(angle, float)
    square = angle * angle
    series = np.zeros_like(square)
    for factor in reversed(_INV_SERIES):
        series = square * series + factor
    return np.where(np.abs(angle) < 0.05, series * angle * square, np.tan(angle) - angle)


def inverse_inv(value: float) -> float:
    """The angle α in [0, π/2) with inv α = `value` ≥ 0 (ValueError otherwise). Newton on t − atan t, t = tan α."""
    if not 0.0 <= value < math.inf:
        raise ValueError(f"inv of no angle: {value}")
    t = (3.0 * value) ** (1 / 3) + value
    for _ in range(60):
        residual = float(inv(math.atan(t))) - value
        step = residual * (1 + t * t) / (t * t) if t > 0 else 0.0
        t = max(t - step, 0.5 * t)
        if abs(step) <= 4e-16 * t:
            break
    return math.atan(t)


def roll_at_radius(radius: ArrayLike, r_b: float) -> np.ndarray:
    """Roll s of the flank point at `radius` ≥ r_b (m)."""
    radius = np.asarray(radius, float)
    return np.sqrt((radius - r_b) * (radius + r_b))


def radius_at_roll(roll: ArrayLike, r_b: float) -> np.ndarray:
    """Radius (m) of the flank point at roll s; hypot(r_b, s)."""
    return np.hypot(r_b, roll)


def arc_length(roll: ArrayLike, r_b: float) -> np.ndarray:
    """Length (m) of the involute from the base circle to roll s: s²/(2 r_b)."""
    return np.square(roll) / (2 * r_b)


def roll_at_arc_length(length: ArrayLike, r_b: float) -> np.ndarray:
    """Roll s (m) at which the involute has run `length` (m) from the base circle."""
    return np.sqrt(2 * r_b * np.asarray(length, float))


def flank_angle(roll: ArrayLike, r_b: float, psi_b: float) -> np.ndarray:
    """Polar angle (rad) of the flank point sg = +1 of the tooth centred on +x: ψ_b − inv(atan(s/r_b))."""
    return psi_b - inv(np.arctan(np.asarray(roll, float) / r_b))


def flank_point(roll: ArrayLike, r_b: float, psi_b: float, sg: int = 1) -> np.ndarray:
    """Flank points (..., 2) in m of the tooth centred on +x."""
    roll = np.asarray(roll, float)
    direction = psi_b - roll / r_b
    x = r_b * np.cos(direction) - roll * np.sin(direction)
    y = r_b * np.sin(direction) + roll * np.cos(direction)
    return np.stack([x, sg * y], axis=-1)


def flank_normal(roll: ArrayLike, r_b: float, psi_b: float, sg: int = 1) -> np.ndarray:
    """Unit normals (..., 2) out of the tooth: sg·e_t(t), e_t(t) = (−sin t, cos t), t = sg (ψ_b − s/r_b)."""
    direction = psi_b - np.asarray(roll, float) / r_b
    return np.stack([-np.sin(direction), sg * np.cos(direction)], axis=-1)


def flank_tangent(roll: ArrayLike, r_b: float, psi_b: float, sg: int = 1) -> np.ndarray:
    """Unit tangents (..., 2) of the flank towards growing roll: e_r(t) = (cos t, sin t), t = sg (ψ_b − s/r_b)."""
    direction = psi_b - np.asarray(roll, float) / r_b
    return np.stack([np.cos(direction), sg * np.sin(direction)], axis=-1)
