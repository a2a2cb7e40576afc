"""Gears in mesh, spur or helical (ISO 21771): an external pair, a planet in its ring, and a planetary set. A set has a
carrier, a plate with a bore beside the planets and a bolt for each of them. Hertz's line contact of flanks is here too.

All of it is seen in the transverse section at mid-width, z = 0. Sun and planets have opposite hands, planets and ring
the same: the helix angle of a set is that of its sun."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeVar

import numpy as np

from gearfmu.geometry import involute
from gearfmu.geometry.gear import GearGeometry, InternalGearGeometry

HANDS = {"sun": 1, "planet": -1, "ring": -1}  # sign of the helix angle over that of the set
Rolls = TypeVar("Rolls", float, np.ndarray)
MOUNTS = 6  # of a ring, where nothing says how many


@dataclass(frozen=True)
class GearMesh:
    """Two gears at centre distance `a` (m) with circumferential backlash j_wt (m) on the working pitch circles.

    Rolls along the path of contact are those of gear 0. It is external; gear 1 is external too (`PairGeometry`), or a
    ring (`RingMesh`). side: 1 where the radii of both add up to the centre distance, -1 where gear 0 is inside gear 1.
    """

    gears: tuple[GearGeometry, GearGeometry | InternalGearGeometry]
    a: float
    backlash: float
    side: ClassVar[int]

    @property
    def base(self) -> float:
        """Sum of the base radii, of a ring their difference, m."""
        return self.gears[1].r_b + self.side * self.gears[0].r_b

    @property
    def alpha_wt(self) -> float:
        """Working transverse pressure angle, rad."""
        return math.atan2(self.length, self.base)

    @property
    def length(self) -> float:
        """Distance (m) of the tangent points of the line of action with the base circles, a sin α_wt."""
        return math.sqrt((self.a - self.base) * (self.a + self.base))

    @property
    def r_w(self) -> tuple[float, float]:
        """Working pitch radii, m."""
        teeth = self.gears[1].z + self.side * self.gears[0].z
        return self.a * self.gears[0].z / teeth, self.a * self.gears[1].z / teeth

    @property
    def base_pitch(self) -> float:
        """Transverse base pitch p_bt = p_et = π m_t cos α_t, m."""
        return math.pi * self.gears[0].m_t * math.cos(self.gears[0].alpha_t)

    def opposite(self, roll: Rolls) -> Rolls:
        """Roll (m) on gear 1 at the contact point that has `roll` (m) on gear 0; of a pair also the other way round."""
        return self.length - self.side * roll

    @property
    def start(self) -> float:
        """Roll (m) of gear 0 at the beginning of the path of contact, where the tip edge rounding of gear 1 begins."""
        return self.side * (self.length - self.gears[1].s_tip)

    def largest_relative_radius(self) -> float:
        """Largest relative radius of curvature s s'/L (m) along the path of contact, s' the roll on gear 1."""
        path = self.path
        roll = path["E"] if self.side < 0 else min(max(self.length / 2, path["A"]), path["E"])
        return roll * self.opposite(roll) / self.length

    @property
    def path(self) -> dict[str, float]:
        """Rolls (m) of gear 0 at the points of the path of contact.

        A, E: ends, where the tip edge roundings begin; B, D: limits of single contact; C: pitch point.
        """
        start, end = self.start, self.gears[0].s_tip
        pitch = self.gears[0].r_b * math.tan(self.alpha_wt)
        return {"A": start, "B": end - self.base_pitch, "C": pitch, "D": start + self.base_pitch, "E": end}

    @property
    def contact_ratio(self) -> float:
        """Transverse contact ratio of the usable flanks, up to where the tip edge roundings begin."""
        path = self.path
        return (path["E"] - path["A"]) / self.base_pitch

    @property
    def normal_backlash(self) -> float:
        """Gap (m) of the coast flanks along their normal while the drive flanks touch, j_bn = j_wt cos α_wt cos β_b."""
        return self.backlash * math.cos(self.alpha_wt) * math.cos(self.gears[0].beta_b)


@dataclass(frozen=True)
class PairGeometry(GearMesh):
    """Pinion and wheel, of a helical pair with helix angles of opposite sign. The roll of the wheel is `length` − s.

    Gears must reach each other's base circles' common tangent: a > r_b1 + r_b2 (ValueError otherwise).
    """

    gears: tuple[GearGeometry, GearGeometry]
    side = 1

    def __post_init__(self) -> None:
        if not self.a > self.base:
            raise ValueError("the centre distance is smaller than the sum of the base radii")

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
    def wheel_phase(self) -> float:
        """Angle (rad) of the wheel's frame at which the nominal drive flanks touch while the pinion's tooth 0 is on +x.

        φ_B = π − ψ_bB + inv(α_wt)(1 + i) − ψ_bA·i with i = r_bA/r_bB: the zero of the gap L − s_A − s_B.
        """
        ratio = self.gears[0].r_b / self.gears[1].r_b
        inv_w = float(involute.inv(self.alpha_wt))
        return math.pi - self.gears[1].psi_b + inv_w * (1 + ratio) - self.gears[0].psi_b * ratio


def mount_spaces(teeth: int, points: int) -> list[int]:
    """Tooth spaces of a ring that are nearest to its mounts, which are spaced evenly from space 0 on."""
    return [(2 * k * teeth + points) // (2 * points) for k in range(points)]


@dataclass(frozen=True)
class RingMesh(GearMesh):
    """A planet in its ring. Along the line of action the ring's roll is that of the planet plus `length`.
    a > r_b,ring − r_b,planet > 0 is needed (ValueError otherwise)."""

    gears: tuple[GearGeometry, InternalGearGeometry]
    side = -1

    def __post_init__(self) -> None:
        if not self.a > self.base > 0:
            raise ValueError("the centre distance is smaller than the difference of the base radii")

    @property
    def planet(self) -> GearGeometry:
        """The gear in the ring."""
        return self.gears[0]

    @property
    def ring(self) -> InternalGearGeometry:
        """The ring."""
        return self.gears[1]

    def outer_single_contact(self, gear: int) -> float:
        """Roll (m) of the point of single contact that is nearer to the tip of the planet (0) or of the ring (1)."""
        return (self.path["A"] + self.base_pitch, self.path["E"] - self.base_pitch + self.length)[gear]

    def inner_single_contact(self, gear: int) -> float:
        """Roll (m) of the point of single contact that is nearer to the root of the planet (0) or of the ring (1)."""
        return (self.path["E"] - self.base_pitch, self.path["A"] + self.base_pitch + self.length)[gear]

    def ring_phase(self, planet_angle: float, direction: float) -> float:
        """Angle (rad) of the ring's space 0 at which its drive flank touches that of the planet's tooth 0 at the angle
        `planet_angle`; direction (rad): that from the ring's axis to the planet's. The zero of the gap s_B − s_A − L.
        """
        t = direction - self.alpha_wt
        roll = self.planet.r_b * (planet_angle + self.planet.psi_b - t)
        return t - self.ring.psi_b + (roll + self.length) / self.ring.r_b

    def planet_angle(self, ring_phase: float, direction: float) -> float:
        """The inverse of `ring_phase` (rad)."""
        return (ring_phase - self.ring_phase(0.0, direction)) * self.ring.r_b / self.planet.r_b

    @property
    def least_tip_radius(self) -> float:
        """Smallest tip radius (m) of the ring whose flank does not meet the planet below its form circle."""
        return float(involute.radius_at_roll(self.opposite(self.planet.s_form), self.ring.r_b))

    @property
    def largest_planet_tip_radius(self) -> float:
        """Largest tip radius (m) of the planet that stays below the ring's fillet; its base radius when none does."""
        return float(involute.radius_at_roll(max(self.ring.s_form - self.length, 0.0), self.planet.r_b))

    @property
    def tip_clearance_angle(self) -> float:
        """Angle (rad) by which the tips pass each other outside the line of action; negative: they collide.

        Colbourne, The Geometry of Involute Gears (1987), ch. 9: tip interference of internal gear pairs.
        """
        r_p, r_r, a = self.planet.r_a, self.ring.r_a, self.a
        at_planet = (r_r * r_r - a * a - r_p * r_p) / (2 * a * r_p)
        at_ring = (r_r * r_r + a * a - r_p * r_p) / (2 * a * r_r)
        if not (-1 < at_planet < 1 and -1 < at_ring < 1):
            return math.inf  # the tip circles do not cross
        planet_turn = math.acos(at_planet) + float(involute.inv(math.acos(self.planet.r_b / r_p)))
        ring_turn = math.acos(at_ring) + float(involute.inv(math.acos(min(self.ring.r_b / r_r, 1.0))))
        inv_w = float(involute.inv(self.alpha_wt))
        ratio = self.planet.z / self.ring.z
        return ratio * (planet_turn - inv_w) - (ring_turn - inv_w)

    @property
    def nominal_backlash(self) -> float:
        """Circumferential backlash (m) on the working pitch circle that profile shifts and centre distance give."""
        inv_w = float(involute.inv(self.alpha_wt))
        pitch = self.a / (self.ring.z - self.planet.z)
        return 2 * pitch * (self.ring.z * (self.ring.psi_b - inv_w) - self.planet.z * (self.planet.psi_b - inv_w))


@dataclass(frozen=True)
class PlanetaryGeometry:
    """Sun, planets and ring of a set: the two meshes and the angles (rad) of the planets."""

    sun_mesh: PairGeometry
    ring_mesh: RingMesh
    angles: tuple[float, ...]

    @property
    def ratio(self) -> float:
        """Speed of the sun over that of the carrier with the ring at rest, 1 + z_r/z_s."""
        return set_ratio(self.sun_mesh.gears[0].z, self.ring_mesh.ring.z)

    @property
    def neighbour_clearance(self) -> float:
        """Gap (m) between the tip circles of neighbouring planets; negative: they touch."""
        return 2 * self.sun_mesh.a * math.sin(least_apart(self.angles) / 2) - 2 * self.ring_mesh.planet.r_a


def set_ratio(sun: int, ring: int) -> float:
    """1 + z_r/z_s: speed of the sun over that of the carrier with the ring at rest; numbers of teeth."""
    return 1 + ring / sun


def least_apart(angles: tuple[float, ...]) -> float:
    """Smallest angle (rad) between neighbours of ascending `angles`."""
    return min(b - a for a, b in zip(angles, (*angles[1:], angles[0] + 2 * math.pi), strict=True))


@dataclass(frozen=True)
class CarrierGeometry:
    """Carrier in the set's frame (m): axis z, z = 0 at the planets' mid-width, bolt 0 on +x.

    angles: of the bolts (rad), ascending. a: radius of the bolt circle. r_bore, r_o: bore and outer radius of the
    plate; it lies in z ∈ [plate_low, plate_high]. r_bolt: radius of the bolts, from the plate to z = +seat/2; their
    seats, where the planets' bearings sit, are z ∈ [−seat/2, seat/2].
    """

    angles: tuple[float, ...]
    a: float
    r_bore: float
    r_o: float
    r_bolt: float
    thickness: float
    gap: float
    seat: float

    @property
    def planets(self) -> int:
        """Number of bolts."""
        return len(self.angles)

    @property
    def plate_high(self) -> float:
        return -self.seat / 2 - self.gap

    @property
    def plate_low(self) -> float:
        return self.plate_high - self.thickness

    def bolt_axis(self, bolt: int) -> np.ndarray:
        """(3,) m, middle of the seat of a bolt: its master node."""
        angle = self.angles[bolt]
        return np.array([self.a * math.cos(angle), self.a * math.sin(angle), 0.0])

    @property
    def bore_centre(self) -> np.ndarray:
        """(3,) m, middle of the bore: its master node."""
        return np.array([0.0, 0.0, 0.5 * (self.plate_low + self.plate_high)])

    @property
    def volume(self) -> float:
        """m³."""
        plate = math.pi * (self.r_o**2 - self.r_bore**2) * self.thickness
        return plate + self.planets * math.pi * self.r_bolt**2 * (self.gap + self.seat)


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
