"""One internal gear, spur or helical: reference data, and flank, root and cross-section of its transverse section.

A ring's tooth space is bounded by the same involutes as the tooth of the external gear that would fill it, so space 0
is centred on +x, ψ_b is the half angle of the *space* at the base circle, and flank sg = +1 is that at its larger
angle. Roll s and radius mean what they mean outside; along a flank both grow from the tip to the root, and the normal
out of the material points into the space: −sg e_t(t). ISO 21771 gives diameters of internal gears a minus sign; here
all are positive. The hand of a helical ring is that of the gear that would fill its spaces, and of the planet in mesh
with it: both are turned by z·twist in one direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gearfmu.geometry import involute
from gearfmu.geometry.gear import ReferenceGear


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
