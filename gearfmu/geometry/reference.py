"""Reference data that external and internal gears share (ISO 21771 symbols).

A helical gear is seen in its transverse section at mid-width, z = 0: circles, rolls and angles are those of that
section, while module, pressure angle, profile shift and basic rack are given in the normal section. The section at z
is that at mid-width turned by z·twist about +z. At β = 0 both sections are one and every number is that of the spur
gear, to the last bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from gearfmu.geometry import involute


@dataclass(frozen=True)
class ReferenceGear:
    """Teeth z, normal module m (m), normal pressure angle alpha (rad), profile-shift coefficient x, helix angle beta
    (rad, at the reference circle, positive for a right-handed gear), and what follows from them."""

    z: int
    m: float
    alpha: float
    x: float
    beta: float = field(default=0.0, kw_only=True)

    @property
    def m_t(self) -> float:
        """Transverse module m_n / cos β, m."""
        return self.m / math.cos(self.beta)

    @property
    def alpha_t(self) -> float:
        """Transverse pressure angle, rad: tan α_t = tan α_n / cos β."""
        return math.atan(math.tan(self.alpha) / math.cos(self.beta)) if self.beta else self.alpha

    @property
    def beta_b(self) -> float:
        """Base helix angle, rad, with the sign of β: sin β_b = sin β cos α_n."""
        return math.asin(math.sin(self.beta) * math.cos(self.alpha))

    @property
    def twist(self) -> float:
        """Angle by which the transverse section turns about +z per metre of face width, tan β / r, rad/m."""
        return math.tan(self.beta) / self.r

    def overlap_ratio(self, face_width: float) -> float:
        """ε_β = b sin |β| / (π m_n) of a face width b (m)."""
        return face_width * math.sin(abs(self.beta)) / (math.pi * self.m)

    @property
    def z_virtual(self) -> float:
        """Virtual number of teeth z_n = z / (cos² β_b cos β) of the spur gear that the normal section resembles."""
        return self.z / (math.cos(self.beta_b) ** 2 * math.cos(self.beta))

    @property
    def r(self) -> float:
        """Reference radius, m."""
        return self.m_t * self.z / 2

    @property
    def r_b(self) -> float:
        """Base radius, m."""
        return self.r * math.cos(self.alpha_t)

    @property
    def half_pitch(self) -> float:
        """Half the angle of a tooth and a space, π/z."""
        return math.pi / self.z

    @property
    def psi_b(self) -> float:
        """Half angle at the base circle, rad, of an external gear's tooth or an internal gear's space: ψ + inv α
        (ISO 21771). In the transverse section, where s_t = s_n / cos β and m_t = m_n / cos β leave ψ as it is."""
        return (math.pi / 2 + 2 * self.x * math.tan(self.alpha)) / self.z + float(involute.inv(self.alpha_t))

    def flank_point(self, roll: ArrayLike, sg: int = 1) -> np.ndarray:
        """Points (..., 2) in m of the flank of tooth 0, in a ring of space 0."""
        return involute.flank_point(roll, self.r_b, self.psi_b, sg)

    def thickness_angle(self, radius: ArrayLike) -> np.ndarray:
        """Half angle (rad) of the tooth, of a ring's space, on a circle of `radius` (m) between form and tip circle."""
        return involute.flank_angle(involute.roll_at_radius(radius, self.r_b), self.r_b, self.psi_b)
