"""The tooth root that a basic rack (ISO 53) with a rounded tip generates: trochoid and root circle.

The rounding of the rack's tip is run through by the angle τ of its normal: τ = α where it leaves the straight rack
flank (the form point of the involute) and τ = π/2 at its bottom (the root circle). With this parameter the curve is
smooth for any height of the rounding's centre.

A rack whose teeth stand at the helix angle β is, in the transverse section, its normal section stretched by 1/cos β
along the pitch line: the rounding is an ellipse, and the curve it generates there is exact for a tool of rack type
(hob,
rack cutter).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class RackRounding:
    """Rounding of the rack's tip against the gear's reference circle.

    r: reference radius; alpha: rack angle; centre_depth: of the rounding's centre below the pitch line;
    centre_offset: of that centre from the middle of the tooth space; radius: of the rounding, across the depth; all m.
    half_pitch: half the angle of a tooth and a space, π/z, rad. stretch: half-axis along the pitch line over `radius`,
    1/cos β; 1 is a circle. Everything but `radius` in the transverse section.
    """

    r: float
    alpha: float
    centre_depth: float
    centre_offset: float
    radius: float
    half_pitch: float
    stretch: float = 1.0

    @property
    def land_angle(self) -> float:
        """Angle (rad) from the middle of the tooth space to the end of the root circle's arc."""
        return self.centre_offset / self.r

    @property
    def form_roll(self) -> float:
        """Roll s (m) where involute and trochoid have a common tangent. Negative: that point is on the involute's other
        branch, and the trochoid cuts the flank above the base circle."""
        radius = self.radius / self._slant(self.alpha)
        return self.r * np.sin(self.alpha) - self.centre_depth / np.sin(self.alpha) - radius

    def polar(self, tau: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Radius (m) and polar angle (rad, tooth centred on +x, side sg = +1) of the trochoid at τ."""
        tau = np.asarray(tau, float)
        cot, radius = np.cos(tau) / np.sin(tau), self.radius / self._slant(tau)
        across = radius * np.cos(tau) + self.centre_depth * cot
        up = self.r - self.centre_depth - radius * np.sin(tau)
        centre = self.centre_offset + (self.stretch**2 - 1) * radius * np.cos(tau)
        from_space = np.arctan2(across, up) + (centre - self.centre_depth * cot) / self.r
        return np.hypot(across, up), self.half_pitch - from_space

    def _slant(self, tau: ArrayLike) -> np.ndarray:
        """√(k² cos² τ + sin² τ), k = stretch: the ellipse's point with the normal at τ is (k² cos τ, −sin τ) times
        radius over this."""
        return np.sqrt(1 + (self.stretch**2 - 1) * np.cos(tau) ** 2)

    def point(self, tau: ArrayLike) -> np.ndarray:
        """Points (..., 2) in m of the trochoid beside flank sg = +1."""
        radius, angle = self.polar(tau)
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
