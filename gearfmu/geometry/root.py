"""The tooth root that a basic rack (ISO 53) with a rounded tip generates: trochoid and root circle.

The rounding of the rack's tip is run through by the angle τ of its normal: τ = α where it leaves the straight rack
flank (the form point of the involute) and τ = π/2 at its bottom (the root circle). With this parameter the curve is
smooth for any height of the rounding's centre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class RackRounding:
    """Rounding of the rack's tip against the gear's reference circle.

    r: reference radius; alpha: rack angle; centre_depth: of the rounding's centre below the pitch line;
    centre_offset: of that centre from the middle of the tooth space; radius: of the rounding; all m. half_pitch: half
    the angle of a tooth and a space, π/z, rad.
    """

    r: float
    alpha: float
    centre_depth: float
    centre_offset: float
    radius: float
    half_pitch: float

    @property
    def root_radius(self) -> float:
        return self.r - self.centre_depth - self.radius

    @property
    def land_angle(self) -> float:
        """Angle (rad) from the middle of the tooth space to the end of the root circle's arc."""
        return self.centre_offset / self.r

    @property
    def form_roll(self) -> float:
        """Roll s (m) where involute and trochoid meet with a common tangent; negative: the rack undercuts the flank."""
        return self.r * np.sin(self.alpha) - self.centre_depth / np.sin(self.alpha) - self.radius

    def polar(self, tau: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Radius (m) and polar angle (rad, tooth centred on +x, side sg = +1) of the trochoid at τ."""
        tau = np.asarray(tau, float)
        cot = np.cos(tau) / np.sin(tau)
        across = self.radius * np.cos(tau) + self.centre_depth * cot
        up = self.r - self.centre_depth - self.radius * np.sin(tau)
        from_space = np.arctan2(across, up) + (self.centre_offset - self.centre_depth * cot) / self.r
        return np.hypot(across, up), self.half_pitch - from_space

    def point(self, tau: ArrayLike) -> np.ndarray:
        """Points (..., 2) in m of the trochoid beside flank sg = +1."""
        radius, angle = self.polar(tau)
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
