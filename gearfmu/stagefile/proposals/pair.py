"""A pair from its numbers of teeth, module, face width and centre distance."""

from __future__ import annotations

import math

from gearfmu.errors import SpecError
from gearfmu.geometry.mesh import PairGeometry
from gearfmu.geometry.shifts import OpenPair, Rack, distance_of_shifts, reach
from gearfmu.stagefile.checks.gears import rounded_down, rounded_up
from gearfmu.stagefile.proposals.draft import LOAD_RULE, PITCH_SPEED, Draft, millimetres, usual_torque
from gearfmu.stagefile.proposals.numbers import (
    GIVEN,
    Wish,
    begun,
    distance_of,
    put_center,
    put_gear,
    put_patch,
    put_slices,
)

NAMES = ("pinion", "wheel")
SHIFT_RULE = "equal specific sliding at both ends of the path of contact"


def draft_pair(wish: Wish) -> Draft:
    """The draft of a pair; SpecError where the centre distance is out of reach."""
    rack, teeth, width = wish.rack, (wish.teeth[0], wish.teeth[1]), wish.width or 0.0
    distance = distance_of(wish, reference_distance(rack, sum(teeth)))
    pair = OpenPair(rack, teeth, distance)
    shift = None if math.isnan(pair.total) else wish.shifts[0] if wish.shifts else pair.balanced()
    if shift is None:
        raise SpecError.of("", "center", millimetres(distance), out_of_reach(pair))
    geometry = pair.at(shift)
    draft = begun("helical_demo" if rack.beta else "fzg_c", wish, "pair", tuple(f"gears.{name}" for name in NAMES))
    why = "of the given profile shifts" if wish.shifts else "no sum of profile shifts"
    put_center(draft, wish, "pair", distance, why)
    rules = (SHIFT_RULE, f"sum of both {pair.total:.6f} from the centre distance")
    rules = (GIVEN, GIVEN) if wish.shifts else rules
    for k, name in enumerate(NAMES):
        put_gear(draft, wish, k, f"gears.{name}", geometry.gears[k], rules[k])
    _put_loads(draft, wish, geometry, width)
    put_slices(draft, rack, width)
    return draft


def _put_loads(draft: Draft, wish: Wish, geometry: PairGeometry, width: float) -> None:
    """Torque, speed, load patches and shafts."""
    pinion, wheel = geometry.gears
    ratio = wheel.z / pinion.z
    torque = draft.put_limit("torque_max", (wish.torque, GIVEN), (usual_torque(2 * pinion.r, ratio, width), LOAD_RULE))
    draft.put_limit("speed_max", (wish.speed, GIVEN), (PITCH_SPEED / pinion.r, "20 m/s at the reference circle"))
    radius = geometry.largest_relative_radius()
    for name, gear in zip(NAMES, geometry.gears, strict=True):
        put_patch(draft, f"gears.{name}", gear, torque / pinion.r_b / width, radius)
    draft.put_shafts(dict(zip(NAMES, (torque, torque * ratio), strict=True)))


def reference_distance(rack: Rack, teeth: int) -> float:
    """Centre distance (m) of teeth (z₁ + z₂, or z_ring − z_planet) without a sum of profile shifts."""
    return distance_of_shifts(rack.m, rack.alpha, rack.beta, teeth, 0.0)


def out_of_reach(pair: OpenPair) -> str:
    """Why no pair of gears can be made at a centre distance, and at which it can."""
    found = reach(pair.rack, pair.teeth)
    gears = f"gears of {pair.teeth[0]} and {pair.teeth[1]} teeth"
    if found is None:
        return f"no centre distance suits {gears}: give more teeth"
    if math.isnan(pair.total):
        why = "it is within the base circles"
    elif abs(pair.total) > 6:
        why = f"the sum of profile shifts would be {pair.total:.2f}"
    else:
        why = ", ".join(pair.best_efforts())
    low, high = (millimetres(limit) for limit in (rounded_up(found[0], 5), rounded_down(found[1], 5)))
    return f"out of reach, {why}: {gears} can be made from {low} to {high}"
