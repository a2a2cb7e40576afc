"""Profile shifts and tip circles for a given centre distance: what a designer fills in after teeth and module.

The sum of the profile shifts follows from the centre distance (ISO 21771, no backlash). It is shared so that the
specific sliding at both ends of the path of contact is equal, the balance of DIN 3992, among the shifts with which the
teeth can be made and meet: no undercut, no interference, tips of at least 0.2 m_n, a contact ratio of at least 1.
Tip circles leave the tip clearance of the basic rack (ISO 21771, k* m_n).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from gearfmu.geometry import involute
from gearfmu.geometry.gear import GearGeometry, InternalGearGeometry
from gearfmu.geometry.mesh import PairGeometry, RingMesh

ADDENDUM, DEDENDUM, FILLET = 1.0, 1.25, 0.38  # of the basic rack (ISO 53, profile A); the fillet where it fits
CLEARANCE = DEDENDUM - ADDENDUM
RING_FILLET = 0.3
LEAST_TIP = 0.2  # of the module: thinner tips break out
TIP_EDGE = 0.05  # of the module
_STEP = 0.01  # of a profile shift, in the search
_FINE = 1e-4


def sum_of_shifts(module: float, alpha: float, beta: float, teeth: int, distance: float) -> float:
    """Σx of a pair without backlash at the centre distance (m), ISO 21771: (inv α_wt − inv α_t) Σz / (2 tan α_n); nan
    where the base circles leave no line of action.

    teeth: z₁ + z₂, of an internal pair z_ring − z_pinion (then it is x_ring − x_pinion, positive outwards).
    """
    alpha_t = math.atan(math.tan(alpha) / math.cos(beta))
    cosine = module * teeth / math.cos(beta) / 2 * math.cos(alpha_t) / distance
    if not cosine < 1:
        return math.nan
    working = float(involute.inv(math.acos(cosine)))
    return (working - float(involute.inv(alpha_t))) * teeth / (2 * math.tan(alpha))


def distance_of_shifts(module: float, alpha: float, beta: float, teeth: int, total: float) -> float:
    """Centre distance (m) at which teeth with Σx = `total` have no backlash: the inverse of `sum_of_shifts`."""
    alpha_t = math.atan(math.tan(alpha) / math.cos(beta))
    working = float(involute.inv(alpha_t)) + 2 * total * math.tan(alpha) / teeth
    return module * teeth / math.cos(beta) / 2 * math.cos(alpha_t) / math.cos(involute.inverse_inv(max(working, 0.0)))


@dataclass(frozen=True)
class Rack:
    """What all gears of a stage share: normal module m (m), pressure angle alpha, helix angle beta (rad)."""

    m: float
    alpha: float
    beta: float = 0.0

    @property
    def fillet(self) -> float:
        """Tip rounding of the rack in factors of the module: the usual one, or what a large pressure angle leaves."""
        room = (math.pi / 4 - DEDENDUM * math.tan(self.alpha)) * math.cos(self.alpha) / (1 - math.sin(self.alpha))
        return min(FILLET, math.floor(100 * room) / 100)

    def gear(self, z: int, x: float, r_a: float) -> GearGeometry:
        """An external gear made by this rack, tip circle of radius r_a (m)."""
        return GearGeometry(
            z=z, m=self.m, alpha=self.alpha, x=x, r_a=r_a, r_bore=0.0, tip_edge=TIP_EDGE * self.m,
            h_fp=DEDENDUM * self.m, rho_fp=self.fillet * self.m, beta=self.beta,
        )  # fmt: skip

    def least_shift(self, z: int) -> float:
        """Smallest profile shift without undercut."""
        straight = DEDENDUM - self.fillet * (1 - math.sin(self.alpha))
        return self.gear(z, 0.0, self.m).least_shift(straight)


@dataclass(frozen=True)
class OpenPair:
    """Two external gears of teeth (z₁, z₂) at centre distance a (m) whose profile shifts are still open."""

    rack: Rack
    teeth: tuple[int, int]
    a: float

    @property
    def total(self) -> float:
        """Σx; nan where the centre distance is within the base circles."""
        return sum_of_shifts(self.rack.m, self.rack.alpha, self.rack.beta, sum(self.teeth), self.a)

    def at(self, x: float) -> PairGeometry:
        """The pair with profile shift x of gear 0, tips with the rack's clearance, no backlash."""
        m, shifts = self.rack.m, (x, self.total - x)
        bare = [self.rack.gear(z, s, m) for z, s in zip(self.teeth, shifts, strict=True)]
        tips = [
            math.floor(2e5 * min(gear.r + (ADDENDUM + gear.x) * m, self.a - other.r_f - CLEARANCE * m)) / 2e5
            for gear, other in zip(bare, bare[::-1], strict=True)
        ]
        first, second = (replace(gear, r_a=tip) for gear, tip in zip(bare, tips, strict=True))
        return PairGeometry((first, second), self.a, 0.0)

    def balanced(self) -> float | None:
        """x of gear 0 with equal specific sliding at both ends of the path, within what can be made; None: nothing
        can."""
        low, high = self.range_of_shifts()
        near = self._most_even(_steps(low, high, _STEP))
        if near is None:
            return None
        fine = self._most_even(_steps(max(near - _STEP, low), min(near + _STEP, high), _FINE))
        return round(near if fine is None else fine, 6)

    def _most_even(self, shifts: list[float]) -> float | None:
        """Of the shifts with which both gears can be made, the one of the most even sliding."""
        sound = [x for x in shifts if not list(shortcomings(self.at(x)))]
        return min(sound, key=self._unevenness) if sound else None

    def range_of_shifts(self) -> tuple[float, float]:
        """Smallest and largest x of gear 0 with which neither gear is undercut; the first is larger where there is
        none."""
        least = [self.rack.least_shift(z) + _FINE for z in self.teeth]
        low, high = max(least[0], -3.0), min(self.total - least[1], 3.0)
        return math.ceil(low / _FINE) * _FINE, high

    def best_efforts(self) -> list[str]:
        """Why nothing can be made: shortcomings of the split that has the fewest."""
        low, high = self.range_of_shifts()
        if low > high:
            need = distance_of_shifts(
                self.rack.m, self.rack.alpha, self.rack.beta, sum(self.teeth), self.total + low - high
            )
            return [f"the rack undercuts the teeth below a centre distance of {1e3 * need:.5g} mm"]
        found = [list(shortcomings(self.at(x))) for x in _steps(low, high, 0.05)]
        return min(found, key=len)

    def _unevenness(self, x: float) -> float:
        first, second = specific_sliding(self.at(x))
        return abs(first - second)


def _steps(low: float, high: float, step: float) -> list[float]:
    """From `low` to `high`; none where `low` is larger or `high` is nan."""
    count = max(math.floor((high - low) / step + 1e-9), 0) if high >= low else -1
    return [low + k * step for k in range(count + 1)]


def specific_sliding(pair: PairGeometry) -> tuple[float, float]:
    """Specific sliding at the roots of gear 0 and gear 1 where the other's tip circle ends the path, 1 − v_t2/v_t1
    (negative); −inf where that point is at or below the base circle."""
    found = []
    for own, other in (pair.gears, pair.gears[::-1]):
        roll = pair.length - other.s_a
        found.append(1 - own.z * other.s_a / (other.z * roll) if roll > 0 else -math.inf)
    return found[0], found[1]


def shortcomings(pair: PairGeometry) -> Iterator[str]:
    """What keeps the gears of a pair from being made or from meeting, in words."""
    if any(gear.r_a - gear.tip_edge <= gear.r_b for gear in pair.gears):
        yield "teeth without an involute"
        return
    for gear, other in (pair.gears, pair.gears[::-1]):
        name = f"of {gear.z} teeth (x = {gear.x:.3f})"
        if gear.rounding.form_roll <= 0:
            yield f"undercut of the gear {name}"
        elif gear.tip_half_angle * 2 * gear.r_a * math.cos(gear.beta) < LEAST_TIP * gear.m:
            yield f"pointed teeth of the gear {name}"
        elif pair.opposite(other.s_a) < gear.s_form:
            yield f"interference at the root of the gear {name}"
    if pair.contact_ratio < 1:
        yield f"a contact ratio of {pair.contact_ratio:.2f}, below 1"


def reach(rack: Rack, teeth: tuple[int, int]) -> tuple[float, float] | None:
    """Smallest and largest centre distance (m) at which `OpenPair.balanced` finds something; None: nowhere."""
    found = []
    for step in range(-40, 61):
        distance = distance_of_shifts(rack.m, rack.alpha, rack.beta, sum(teeth), 0.1 * step)
        pair = OpenPair(rack, teeth, distance)
        if distance > 0 and any(not list(shortcomings(pair.at(x))) for x in _steps(*pair.range_of_shifts(), 0.1)):
            found.append(distance)
    return (min(found), max(found)) if found else None


def flank_length(gear: GearGeometry | InternalGearGeometry) -> float:
    """Arc length (m) of the involute between form point and tip edge."""
    ends = (float(involute.arc_length(roll, gear.r_b)) for roll in (gear.s_form, gear.s_tip))
    return abs(next(ends) - next(ends))


def ring_of(planet: GearGeometry, z: int, a: float) -> InternalGearGeometry:
    """The ring of z teeth without backlash around a planet at centre distance a (m): tips with the rack's clearance in
    the planet's root and above its form circle, roots that clear its tips."""
    m = planet.m
    x = round(planet.x + sum_of_shifts(m, planet.alpha, planet.beta, z - planet.z, a), 6)
    reference = m * z / math.cos(planet.beta) / 2
    root = m * (z / 2 / math.cos(planet.beta) + x + DEDENDUM)
    ring = InternalGearGeometry(
        z=z, m=m, alpha=planet.alpha, x=x, r_a=reference, r_f=root, r_rim=root, tip_edge=TIP_EDGE * m,
        fillet=RING_FILLET * m, beta=planet.beta,
    )  # fmt: skip
    tips = (
        reference - m * (ADDENDUM - x),
        a + planet.r_f + CLEARANCE * m,
        RingMesh((planet, ring), a, 0.0).least_tip_radius,
    )
    return replace(ring, r_a=math.ceil(2e5 * max(tips)) / 2e5)


def ring_shortcomings(mesh: RingMesh) -> Iterator[str]:
    """What keeps a ring from being made or from meeting its planet, in words."""
    ring, planet = mesh.ring, mesh.planet
    if ring.s_tip <= 0 or ring.s_form <= ring.s_tip or ring.tip_land_half_angle < 0 or ring.fillet_centre[1] <= 0:
        yield "no ring tooth is left between tip and root"
    elif planet.r_a > mesh.largest_planet_tip_radius or mesh.a + planet.r_a >= ring.r_f:
        yield "interference of the planet's tip with the ring's root"
    elif mesh.tip_clearance_angle < 0:
        yield "tips of planet and ring that collide"
    elif mesh.contact_ratio < 1:
        yield f"a contact ratio of planet and ring of {mesh.contact_ratio:.2f}, below 1"
