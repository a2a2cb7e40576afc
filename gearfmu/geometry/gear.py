"""One external gear, spur or helical: reference data, and flank, root and cross-section of its transverse section."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from gearfmu.geometry import involute
from gearfmu.geometry.reference import ReferenceGear
from gearfmu.geometry.root import RackRounding

_CLOSE = 3e-4  # of the base radius


@dataclass(frozen=True)
class GearGeometry(ReferenceGear):
    """An external gear in its body frame: tooth 0 centred on +x at z = 0 (ISO 21771 symbols; lengths m, angles rad).

    z, m, alpha, x, beta: teeth, normal module, normal pressure angle, profile-shift coefficient, helix angle. r_b, r,
    r_a: base, reference and tip radius. r_bore: bore radius. tip_edge: radius of the tip edge rounding in the
    transverse section. h_fp, rho_fp: dedendum and tip rounding of the basic rack (m, not factors). Outlines are those
    of the transverse section at mid-width.
    """

    r_a: float
    r_bore: float
    tip_edge: float
    h_fp: float
    rho_fp: float

    @property
    def r_f(self) -> float:
        """Root radius r − h_fP + x m (ISO 21771)."""
        return self.r - self.h_fp + self.x * self.m

    @property
    def rounding(self) -> RackRounding:
        """The rack's tip rounding that generates the root."""
        height = self.h_fp - self.rho_fp
        offset = self.m * math.pi / 4 - height * math.tan(self.alpha) - self.rho_fp / math.cos(self.alpha)
        return RackRounding(
            r=self.r,
            alpha=self.alpha_t,
            centre_depth=height - self.x * self.m,
            centre_offset=offset / math.cos(self.beta),
            radius=self.rho_fp,
            half_pitch=self.half_pitch,
            stretch=1 / math.cos(self.beta),
        )

    @property
    def s_form(self) -> float:
        """Roll of the root form point, where the trochoid takes over."""
        tangent = float(self.rounding.form_roll)
        if tangent >= -_CLOSE * self.r_b:
            return max(tangent, -tangent / 2)
        return float(involute.roll_at_radius(self.rounding.polar(self.form_angle)[0], self.r_b))

    @property
    def form_angle(self) -> float:
        """Angle τ (rad) of the trochoid's end at the flank: α_t where both have a common tangent, else where the
        trochoid of an undercut tooth crosses the involute."""
        return self.alpha_t if self.rounding.form_roll >= 0 else _crossing(self)

    def least_shift(self, addendum: float) -> float:
        """Profile shift without undercut by a rack whose straight flank ends `addendum` modules below its pitch line:
        h − z sin² α_t/(2 cos β) (ISO 21771)."""
        return addendum - self.z * self.shift_per_tooth

    @property
    def shift_per_tooth(self) -> float:
        """Decrease of the least profile shift per tooth, sin² α_t/(2 cos β)."""
        return math.sin(self.alpha_t) ** 2 / (2 * math.cos(self.beta))

    @property
    def s_a(self) -> float:
        """Roll of the involute's intersection with the tip circle."""
        return float(involute.roll_at_radius(self.r_a, self.r_b))

    @property
    def s_tip(self) -> float:
        """Roll of the tip form point, where the tip edge rounding (tangent to flank and tip circle) begins."""
        return self.tip_edge + float(involute.roll_at_radius(self.r_a - self.tip_edge, self.r_b))

    @property
    def tip_half_angle(self) -> float:
        """Half tooth-thickness angle at the tip circle, edge rounding left away; negative for a pointed tooth."""
        return float(involute.flank_angle(self.s_a, self.r_b, self.psi_b))

    @property
    def tip_land_half_angle(self) -> float:
        """Half angle of the tip land between the two edge roundings; negative when they do not fit."""
        roll = self.s_tip - self.tip_edge
        return self.psi_b - self.s_tip / self.r_b + math.atan2(roll, self.r_b)

    def flank_normal(self, roll: ArrayLike, sg: int = 1) -> np.ndarray:
        """Unit normals (..., 2) out of tooth 0 in the transverse section."""
        return involute.flank_normal(roll, self.r_b, self.psi_b, sg)

    def tip_edge_centre(self, sg: int = 1) -> np.ndarray:
        """Centre (2,) in m of the tip edge rounding."""
        return self.flank_point(self.s_tip, sg) - self.tip_edge * self.flank_normal(self.s_tip, sg)


@lru_cache(maxsize=64)
def _crossing(gear: GearGeometry) -> float:
    """Angle τ (rad) at which the trochoid of an undercut tooth crosses its flank (ISO 21771).

    From the root, the trochoid passes through the flank once and ends on the involute's other branch, at a roll s < 0.
    Close to the limit of undercut, where angles between the two vanish as s³, the crossing is at the roll −s/2.
    """
    rounding, nearly = gear.rounding, math.hypot(gear.r_b, gear.rounding.form_roll / 2)
    close = -rounding.form_roll < _CLOSE * gear.r_b

    def outside(tau: float) -> bool:
        radius, angle = (float(part) for part in rounding.polar(tau))
        if close or radius < gear.r_b:
            return radius > nearly
        roll = involute.roll_at_radius(radius, gear.r_b)
        return angle > float(involute.flank_angle(roll, gear.r_b, gear.psi_b))

    low, high = gear.alpha_t, math.pi / 2
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if outside(middle) else (low, middle)
    return low
