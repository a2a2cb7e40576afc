"""One gear, external or internal, spur or helical: reference data (ISO 21771 symbols), flank, root and cross-section.

A helical gear is seen in its transverse section at mid-width, z = 0: circles, rolls and angles are those of that
section, while module, pressure angle, profile shift and basic rack are given in the normal section. The section at z
is that at mid-width turned by z·twist about +z. At β = 0 both sections are one and every number is that of the spur
gear, to the last bit.

The root of an external gear is what a basic rack (ISO 53) with a rounded tip generates. That rounding is run through by
the angle τ of its normal: τ = α where it leaves the straight rack flank (the form point of the involute) and τ = π/2 at
its bottom (the root circle). With this parameter the curve is smooth for any height of the rounding's centre. A rack
whose teeth stand at the helix angle β is, in the transverse section, its normal section stretched by 1/cos β along the
pitch line: the rounding is an ellipse, and the curve it generates there is exact for a tool of rack type (hob, rack
cutter).

A ring's tooth space is bounded by the same involutes as the tooth of the external gear that would fill it, so space 0
is centred on +x, ψ_b is the half angle of the *space* at the base circle, and flank sg = +1 is that at its larger
angle. Roll s and radius mean what they mean outside; along a flank both grow from the tip to the root, and the normal
out of the material points into the space: −sg e_t(t). ISO 21771 gives diameters of internal gears a minus sign; here
all are positive. The hand of a helical ring is that of the gear that would fill its spaces, and of the planet in mesh
with it: both are turned by z·twist in one direction."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

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


@dataclass(frozen=True)
class InternalGearGeometry(ReferenceGear):
    """An internal gear in its body frame: tooth space 0 centred on +x at z = 0 (lengths m, angles rad).

    z, m, alpha, x, beta: teeth, normal module, normal pressure angle, profile-shift coefficient (positive outwards),
    helix angle. r_a: tip radius, the smallest; r_f: root radius; r_rim: outer radius. tip_edge: radius of the tip edge
    rounding. fillet: radius of the root fillet, an arc tangent to flank and root circle (as a shaping cutter with that
    tip rounding leaves it, up to its motion along the trochoid). Both radii are those of the transverse section.
    """

    r_a: float
    r_f: float
    r_rim: float
    tip_edge: float
    fillet: float

    @property
    def s_a(self) -> float:
        """Roll of the involute's intersection with the tip circle; negative where that lies inside the base circle."""
        return _signed_root(self.r_a, self.r_b)

    @property
    def s_tip(self) -> float:
        """Roll of the tip form point, where the tip edge rounding (tangent to flank and tip circle) begins."""
        return _signed_root(self.r_a + self.tip_edge, self.r_b) - self.tip_edge

    @property
    def s_form(self) -> float:
        """Roll of the root form point, where the fillet takes over; the largest of the flank."""
        return _signed_root(self.r_f - self.fillet, self.r_b) + self.fillet

    @property
    def fillet_centre(self) -> tuple[float, float]:
        """Radius (m) and polar angle (rad, side sg = +1) of the fillet's centre; at or below 0 the two fillets of a
        space overlap."""
        roll = self.s_form - self.fillet
        return self.r_f - self.fillet, self.psi_b - self.s_form / self.r_b + math.atan2(roll, self.r_b)

    @property
    def tip_half_angle(self) -> float:
        """Half tooth-thickness angle at the tip circle, edge rounding left away; negative for a pointed tooth."""
        return self.half_pitch - float(involute.flank_angle(self.s_a, self.r_b, self.psi_b))

    @property
    def tip_land_half_angle(self) -> float:
        """Half angle of the tip land between the two edge roundings; negative when they do not fit."""
        roll = self.s_tip + self.tip_edge
        return self.half_pitch - (self.psi_b - self.s_tip / self.r_b + math.atan2(roll, self.r_b))

    def flank_normal(self, roll: ArrayLike, sg: int = 1) -> np.ndarray:
        """Unit normals (..., 2) out of the ring's material, into space 0."""
        return -involute.flank_normal(roll, self.r_b, self.psi_b, sg)

    def fillet_point(self, share: ArrayLike) -> np.ndarray:
        """Points (..., 2) in m of the fillet of flank sg = +1 at shares 0 (form point) … 1 (root circle) of its arc."""
        radius, angle = self.fillet_centre
        centre = radius * np.array([math.cos(angle), math.sin(angle)])
        start = -self.flank_normal(self.s_form)
        begin, turn = math.atan2(start[1], start[0]), self._fillet_turn
        towards = begin + np.asarray(share, float) * turn
        return centre + self.fillet * np.stack([np.cos(towards), np.sin(towards)], axis=-1)

    @property
    def _fillet_turn(self) -> float:
        """Angle (rad, negative) of the fillet's arc from the flank's normal to the radial direction."""
        start = -self.flank_normal(self.s_form)
        return self.fillet_centre[1] - math.atan2(start[1], start[0])

    @property
    def fillet_length(self) -> float:
        """Length of one fillet, m."""
        return abs(self._fillet_turn) * self.fillet


def _signed_root(radius: float, r_b: float) -> float:
    """√(r² − r_b²), negative √(r_b² − r²) inside the base circle, so that checks can go on."""
    square = (radius - r_b) * (radius + r_b)
    return math.copysign(math.sqrt(abs(square)), square)
