"""Profile shifts from the centre distance: balance, limits, and that what is proposed can be made."""

from __future__ import annotations

import math

import pytest

from gearfmu.geometry import involute
from gearfmu.geometry.mesh import RingMesh
from gearfmu.geometry.shifts import (
    CLEARANCE,
    OpenPair,
    Rack,
    distance_of_shifts,
    reach,
    ring_of,
    ring_shortcomings,
    shortcomings,
    specific_sliding,
    sum_of_shifts,
)

SPUR = Rack(2e-3, math.radians(20))
HELICAL = Rack(2.5e-3, math.radians(20), math.radians(22))


def test_sum_of_shifts_and_centre_distance_are_inverse() -> None:
    for total in (-0.4, 0.0, 0.3219, 1.5):
        distance = distance_of_shifts(HELICAL.m, HELICAL.alpha, HELICAL.beta, 104, total)
        assert sum_of_shifts(HELICAL.m, HELICAL.alpha, HELICAL.beta, 104, distance) == pytest.approx(total, abs=1e-12)


@pytest.mark.parametrize(
    ("rack", "teeth", "distance"), [(HELICAL, (31, 73), 0.141), (SPUR, (30, 20), 0.050), (SPUR, (17, 60), 0.0775)]
)
def test_a_balanced_pair_slides_alike_at_both_roots_without_backlash(
    rack: Rack, teeth: tuple[int, int], distance: float
) -> None:
    """Sliding by the velocities at the ends of the path, from radii alone."""
    pair = OpenPair(rack, teeth, distance)
    shift = pair.balanced()
    assert shift is not None
    made = pair.at(shift)
    assert made.nominal_backlash == pytest.approx(0.0, abs=1e-9)
    sliding = []
    for own, other in (made.gears, made.gears[::-1]):
        tip = math.sqrt(other.r_a**2 - other.r_b**2)
        own_roll = made.a * math.sin(made.alpha_wt) - tip
        sliding.append((own_roll / own.z - tip / other.z) / (own_roll / own.z))
    assert sliding == pytest.approx(list(specific_sliding(made)), rel=1e-9)
    assert sliding[0] == pytest.approx(sliding[1], rel=2e-3)  # of a shift rounded to 1e-4


def test_tips_keep_the_racks_clearance_and_no_more_than_rounding() -> None:
    pair = OpenPair(HELICAL, (31, 73), 0.141)
    made = pair.at(pair.balanced() or 0.0)
    for own, other in (made.gears, made.gears[::-1]):
        clearance = made.a - own.r_a - other.r_f
        assert -1e-12 <= clearance - CLEARANCE * HELICAL.m < 5e-6


def test_least_shift_is_where_the_form_point_reaches_the_base_circle() -> None:
    for rack, z in ((SPUR, 12), (HELICAL, 15)):
        gear = rack.gear(z, rack.least_shift(z), 1.0)
        assert gear.s_form == pytest.approx(0.0, abs=1e-12)


def test_few_teeth_are_not_undercut() -> None:
    pair = OpenPair(SPUR, (10, 40), 0.0505)
    shift = pair.balanced()
    assert shift is not None and shift > SPUR.least_shift(10) > 0
    assert not list(shortcomings(pair.at(shift)))


def test_reach_ends_where_nothing_can_be_made() -> None:
    low, high = reach(SPUR, (20, 34)) or (0.0, 0.0)
    assert low < 0.054 < high
    for distance, made in ((0.98 * low, False), (low, True), (high, True), (1.02 * high, False)):
        pair = OpenPair(SPUR, (20, 34), distance)
        assert (not math.isnan(pair.total) and pair.balanced() is not None) is made
        assert made or pair.best_efforts()


def test_a_ring_meets_its_planet_without_backlash_and_above_its_form_circle() -> None:
    planet = OpenPair(SPUR, (30, 20), 0.050).at(-0.1674).gears[1]
    mesh = RingMesh((planet, ring_of(planet, 70, 0.050)), 0.050, 0.0)
    assert mesh.nominal_backlash == pytest.approx(0.0, abs=1e-9) and not list(ring_shortcomings(mesh))
    roll = float(involute.roll_at_radius(mesh.ring.r_a, mesh.ring.r_b)) - mesh.length
    assert roll >= planet.s_form
    assert mesh.ring.r_a >= mesh.a + planet.r_f + CLEARANCE * SPUR.m - 1e-12
