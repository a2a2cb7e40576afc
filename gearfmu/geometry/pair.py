"""A pair of external gears, spur or helical, at its working centre distance (ISO 21771): transverse sections at z =
0."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from gearfmu.geometry import involute
from gearfmu.geometry.gear import GearGeometry
from gearfmu.geometry.hertz import largest_relative_radius


class HasGeometry(Protocol):
    """A stage that is a pair."""

    @property
    def geometry(self) -> PairGeometry:
        """Its pair."""


@dataclass(frozen=True)
class PairGeometry:
    """Pinion and wheel at centre distance `a` (m) with circumferential backlash j_wt (m) on the working pitch circles.

    Gears of a helical pair have helix angles of opposite sign. Rolls along the path of contact are those of gear 0;
    the other gear's is `length` − s. Gears must reach each
    other's base circles' common tangent: a > r_b1 + r_b2 (ValueError otherwise).
    """

    gears: tuple[GearGeometry, GearGeometry]
    a: float
    backlash: float

    def __post_init__(self) -> None:
        if not self.a > self.gears[0].r_b + self.gears[1].r_b:
            raise ValueError("the centre distance is smaller than the sum of the base radii")

    @classmethod
    def of(cls, stage: HasGeometry) -> PairGeometry:
        """The pair of a stage: another name of its `geometry`, for scripts of release 0.2."""
        return stage.geometry

    @property
    def alpha_wt(self) -> float:
        """Working transverse pressure angle, rad."""
        return math.atan2(self.length, self.gears[0].r_b + self.gears[1].r_b)

    @property
    def length(self) -> float:
        """Distance (m) of the tangent points of the line of action with the base circles, a sin α_wt."""
        base = self.gears[0].r_b + self.gears[1].r_b
        return math.sqrt((self.a - base) * (self.a + base))

    @property
    def r_w(self) -> tuple[float, float]:
        """Working pitch radii, m."""
        teeth = self.gears[0].z + self.gears[1].z
        return self.a * self.gears[0].z / teeth, self.a * self.gears[1].z / teeth

    @property
    def base_pitch(self) -> float:
        """Transverse base pitch p_bt = p_et = π m_t cos α_t, m."""
        return math.pi * self.gears[0].m_t * math.cos(self.gears[0].alpha_t)

    def overlap_ratio(self, face_width: float) -> float:
        """ε_β = b sin |β| / (π m_n) of the common face width b (m)."""
        return self.gears[0].overlap_ratio(face_width)

    def opposite(self, roll: float) -> float:
        """Roll (m) on the other gear at the contact point that has `roll` (m) on this one."""
        return self.length - roll

    @property
    def path(self) -> dict[str, float]:
        """Rolls (m) of gear 0 at the points of the path of contact.

        A, E: ends, where the tip edge roundings begin; B, D: limits of single contact; C: pitch point.
        """
        start, end = self.opposite(self.gears[1].s_tip), self.gears[0].s_tip
        pitch = self.gears[0].r_b * math.tan(self.alpha_wt)
        return {"A": start, "B": end - self.base_pitch, "C": pitch, "D": start + self.base_pitch, "E": end}

    def largest_relative_radius(self) -> float:
        """Largest relative radius of curvature s (L − s)/L (m) along the path of contact."""
        path = self.path
        return largest_relative_radius(self.length, path["A"], path["E"])

    @property
    def contact_ratio(self) -> float:
        """Transverse contact ratio of the usable flanks, up to where the tip edge roundings begin."""
        path = self.path
        return (path["E"] - path["A"]) / self.base_pitch

    @property
    def tip_circle_contact_ratio(self) -> float:
        """Transverse contact ratio of the tip circles, edge roundings left away (the number that catalogues state)."""
        return (self.gears[0].s_a + self.gears[1].s_a - self.length) / self.base_pitch

    def outer_single_contact(self, gear: int) -> float:
        """Roll (m) on `gear` (0 or 1) of its outer point of single contact."""
        return self.opposite(self.gears[1 - gear].s_tip) + self.base_pitch

    def inner_single_contact(self, gear: int) -> float:
        """Roll (m) on `gear` (0 or 1) of its inner point of single contact."""
        return self.gears[gear].s_tip - self.base_pitch

    @property
    def nominal_backlash(self) -> float:
        """Circumferential backlash (m) on the working pitch circle that profile shifts and centre distance give."""
        inv_w = float(involute.inv(self.alpha_wt))
        thickness = [2 * r_w * (gear.psi_b - inv_w) for r_w, gear in zip(self.r_w, self.gears, strict=True)]
        return 2 * math.pi * self.r_w[0] / self.gears[0].z - sum(thickness)

    @property
    def normal_backlash(self) -> float:
        """Gap (m) of the coast flanks along their normal while the drive flanks touch, j_bn = j_wt cos α_wt cos β_b."""
        return self.backlash * math.cos(self.alpha_wt) * math.cos(self.gears[0].beta_b)

    @property
    def wheel_phase(self) -> float:
        """Angle (rad) of the wheel's frame at which the nominal drive flanks touch while the pinion's tooth 0 is on +x.

        φ_B = π − ψ_bB + inv(α_wt)(1 + i) − ψ_bA·i with i = r_bA/r_bB: the zero of the gap L − s_A − s_B.
        """
        ratio = self.gears[0].r_b / self.gears[1].r_b
        inv_w = float(involute.inv(self.alpha_wt))
        return math.pi - self.gears[1].psi_b + inv_w * (1 + ratio) - self.gears[0].psi_b * ratio

    @property
    def zero_backlash_center_distance(self) -> float:
        """Centre distance (m) at which the nominal teeth would have no backlash."""
        first, second = self.gears
        inv_w = float(involute.inv(first.alpha_t)) + 2 * (first.x + second.x) * math.tan(first.alpha) / (
            first.z + second.z
        )
        return (first.r_b + second.r_b) / math.cos(involute.inverse_inv(max(inv_w, 0.0)))
