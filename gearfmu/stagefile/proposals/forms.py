"""A pair and a planetary set from their numbers of teeth and planets, module and face width."""

from __future__ import annotations

import math
from collections.abc import Iterator

from gearfmu.errors import Problem, SpecError
from gearfmu.geometry.gear import GearGeometry
from gearfmu.geometry.mesh import MOUNTS, PairGeometry, RingMesh, least_apart, set_ratio
from gearfmu.geometry.shifts import (
    DEDENDUM,
    RING_FILLET,
    OpenPair,
    Rack,
    distance_of_shifts,
    reach,
    ring_of,
    ring_shortcomings,
    sum_of_shifts,
)
from gearfmu.quantities import range_of
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

PAIR, SET = ("pinion", "wheel"), ("sun", "planet", "ring")
_SHARING = {2: 1.1, 3: 1.1, 4: 1.25, 5: 1.35, 6: 1.44}  # mesh load factor of IEC 61400-4 by the number of planets
_CARRIER_SCALE = 0.75
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
    draft = begun("helical_demo" if rack.beta else "fzg_c", wish, "pair", tuple(f"gears.{name}" for name in PAIR))
    why = "of the given profile shifts" if wish.shifts else "no sum of profile shifts"
    put_center(draft, wish, "pair", distance, why)
    rules = (SHIFT_RULE, f"sum of both {pair.total:.6f} from the centre distance")
    rules = (GIVEN, GIVEN) if wish.shifts else rules
    for k, name in enumerate(PAIR):
        put_gear(draft, wish, k, f"gears.{name}", geometry.gears[k], rules[k])
    _put_pair_loads(draft, wish, geometry, width)
    put_slices(draft, rack, width)
    return draft


def _put_pair_loads(draft: Draft, wish: Wish, geometry: PairGeometry, width: float) -> None:
    """Torque, speed, load patches and shafts."""
    pinion, wheel = geometry.gears
    ratio = wheel.z / pinion.z
    torque = draft.put_limit("torque_max", (wish.torque, GIVEN), (usual_torque(2 * pinion.r, ratio, width), LOAD_RULE))
    draft.put_limit("speed_max", (wish.speed, GIVEN), (PITCH_SPEED / pinion.r, "20 m/s at the reference circle"))
    radius = geometry.largest_relative_radius()
    for name, gear in zip(PAIR, geometry.gears, strict=True):
        put_patch(draft, f"gears.{name}", gear, torque / pinion.r_b / width, radius)
    draft.put_shafts(dict(zip(PAIR, (torque, torque * ratio), strict=True)))


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


def draft_set(wish: Wish) -> Draft:
    """The draft of a planetary set. SpecError lists everything that is wrong with the numbers."""
    rack, (sun, planet, ring) = wish.rack, wish.teeth
    distances = [reference_distance(rack, teeth) for teeth in (sun + planet, max(ring - planet, 1))]
    distance = distance_of(wish, max(distances))
    pair = OpenPair(rack, (sun, planet), distance)
    problems, mesh = [*_assembly(wish)], None
    shift = None if math.isnan(pair.total) else wish.shifts[0] if wish.shifts else pair.balanced()
    if shift is None:
        problems.append(Problem("", "center", millimetres(distance), f"of sun and planet {out_of_reach(pair)}"))
    else:
        mesh, found = _ring_mesh(wish, pair.at(shift).gears[1], distance)
        problems += found
    tip = mesh.planet.r_a if mesh is not None else reference_distance(rack, planet) + rack.m
    problems += _room(wish, distance, tip)
    if problems or mesh is None or shift is None:
        raise SpecError(problems)
    draft = begun("helical_set" if rack.beta else "planetary54", wish, "set", SET)
    why = "no sums of profile shifts" if math.isclose(*distances) else "the larger one of both meshes"
    put_center(draft, wish, "set", distance, why)
    _put_planets(draft, wish)
    put_gear(draft, wish, 0, "sun", pair.at(shift).gears[0], SHIFT_RULE)
    put_gear(draft, wish, 1, "planet", mesh.planet, f"sum of sun and planet {pair.total:.6f} from the centre distance")
    _put_ring(draft, mesh)
    _put_carrier(draft, wish, mesh)
    _put_set_loads(draft, wish, pair, shift, mesh)
    put_slices(draft, rack, wish.width or 0.0)
    return draft


def _assembly(wish: Wish) -> Iterator[Problem]:
    """Whether the planets can be put between sun and ring."""
    (sun, _, ring), count = wish.teeth, wish.planets or 1
    teeth = sun + ring
    if wish.unequal or teeth % count == 0:
        return
    fitting = [str(n) for n in range(2, int(range_of("planets").high) + 1) if teeth % n == 0]
    sums = f"{teeth - teeth % count} or {teeth - teeth % count + count}"
    remedy = (
        f"equally spaced planets cannot be mounted: (z_sun + z_ring)/planets = {teeth}/{count} is no integer; nearest "
        f"are z_sun + z_ring = {sums}, {' or '.join(fitting) or 'no other number of'} planets, or planets that are "
        "not equally spaced (unequal)"
    )
    yield Problem("", "planets", str(count), remedy)


def _room(wish: Wish, distance: float, tip: float) -> Iterator[Problem]:
    """Whether neighbouring planets of tip radius `tip` (m) stay apart."""
    apart = 2 * distance * math.sin(least_apart(_angles(wish)) / 2)
    if apart > 2 * tip:
        return
    most = math.floor(math.pi / math.asin(min(tip / distance, 1.0)) - 1e-9)
    fewer = f"at most {most} of this size" if most > 1 else "smaller planets"
    remedy = (
        f"neighbouring planets touch: axes {millimetres(apart)} apart, tip diameter {millimetres(2 * tip)}; {fewer}"
    )
    yield Problem("", "planets", str(wish.planets), remedy)


def _places(wish: Wish) -> list[int]:
    """Places of the planets in steps of 2π/(z_s + z_r), nearest to even ones."""
    teeth, count = wish.teeth[0] + wish.teeth[2], wish.planets or 1
    return [round(k * teeth / count) for k in range(count)]


def _angles(wish: Wish) -> tuple[float, ...]:
    count = wish.planets or 1
    if not wish.unequal:
        return tuple(2 * math.pi * k / count for k in range(count))
    return tuple(2 * math.pi * place / (wish.teeth[0] + wish.teeth[2]) for place in _places(wish))


def _ring_mesh(wish: Wish, planet: GearGeometry, distance: float) -> tuple[RingMesh | None, list[Problem]]:
    """Planet and ring, or what is wrong with them."""
    sun, _, ring = wish.teeth
    coaxial = f"sun and planets of {sun} and {planet.z} teeth suit a ring of about {sun + 2 * planet.z}"
    difference = sum_of_shifts(planet.m, planet.alpha, planet.beta, ring - planet.z, distance)
    if ring <= planet.z or not abs(difference) < 3:
        return None, [Problem("", "teeth", wish.shown, f"sun and ring have no common centre distance: {coaxial}")]
    mesh = RingMesh((planet, ring_of(planet, ring, distance)), distance, 0.0)
    if found := list(ring_shortcomings(mesh)):
        return None, [Problem("", "teeth", wish.shown, f"{', '.join(found)}; {coaxial}, the ring has {ring}")]
    return mesh, []


def _put_planets(draft: Draft, wish: Wish) -> None:
    count = wish.planets or 1
    draft.put("set.planets", count, GIVEN)
    draft.drop("set.positions")
    if wish.unequal and (wish.teeth[0] + wish.teeth[2]) % count:
        draft.assume("set.positions", _places(wish), "the places nearest to even ones at which teeth fit")
    draft.assume("set.load_sharing", _SHARING[count], "IEC 61400-4 for this number of planets")
    draft.drop("set.pin_errors")
    held = {"bore": "rigid", **{f"bolt{k}": "rigid" for k in range(count)}}
    draft.put("carrier.coupling", held, "proposed: bolts and bore on stiff shafts")


def _put_ring(draft: Draft, mesh: RingMesh) -> None:
    ring, m = mesh.ring, mesh.ring.m
    draft.put("ring.teeth", ring.z, GIVEN)
    draft.assume("ring.profile_shift", ring.x, "no backlash at the centre distance; positive outwards")
    why = f"clear of the planets' roots; root diameter {millimetres(round(2 * ring.r_f, 6))}"
    draft.assume("ring.tip_diameter", millimetres(2 * ring.r_a), why)
    draft.assume("ring.rim_diameter", millimetres(rounded_up(2 * ring.r_f + 7 * m, 3)), "a rim of 3.5 m_n")
    draft.assume("ring.dedendum", DEDENDUM, "ISO 53")
    draft.assume("ring.fillet_radius", RING_FILLET, "of a shaping cutter")
    draft.assume("ring.mounts.points", MOUNTS, "evenly round the rim")


def _put_carrier(draft: Draft, wish: Wish, mesh: RingMesh) -> None:
    bore = wish.bores[1] if wish.bores else mesh.planet.r_f
    bolt = math.floor(0.75e4 * bore) / 1e4
    draft.assume("carrier.bolt_diameter", millimetres(bolt), "three quarters of the planets' bore")
    draft.assume("carrier.bore_diameter", millimetres(rounded_up(mesh.a, 2)), "the centre distance")
    outer = rounded_up(2 * mesh.a + 2 * bolt, 3)
    draft.assume("carrier.outer_diameter", millimetres(outer), "the bolt circle and two bolt diameters")
    thickness = rounded_up(0.6 * (wish.width or 0.0), 2)
    draft.assume("carrier.thickness", millimetres(thickness), "0.6 of the face width")
    draft.assume("carrier.gap", millimetres(rounded_up(0.8 * mesh.planet.m, 2)), "0.8 m_n")
    draft.assume(
        "carrier.mesh.scale", _CARRIER_SCALE, "two fifths of the memory of 1, frequencies 0.8 % above a finer mesh"
    )
    inputs = 6 * ((wish.planets or 1) + 1)
    draft.assume("carrier.modes", max(4 * inputs, 120), "four moments of every bolt and the bore")


def _put_set_loads(draft: Draft, wish: Wish, pair: OpenPair, shift: float, mesh: RingMesh) -> None:
    """Torque and speed of the carrier, load patches of all gears."""
    geometry, width = pair.at(shift), wish.width or 0.0
    sun, planet = geometry.gears
    ratio, count = set_ratio(sun.z, mesh.ring.z), wish.planets or 1
    usual = usual_torque(2 * sun.r, planet.z / sun.z, width) * count / _SHARING[count] * ratio
    torque = draft.put_limit("torque_max", (wish.torque, GIVEN), (usual, LOAD_RULE))
    speed = (PITCH_SPEED / sun.r / ratio, "20 m/s at the reference circle")
    draft.put_limit("speed_max", (wish.speed, GIVEN), speed)
    load = _SHARING[count] * torque / ratio / count / sun.r_b / width
    outer, inner = geometry.largest_relative_radius(), mesh.largest_relative_radius()
    put_patch(draft, "sun", sun, load, outer)
    put_patch(draft, "planet", planet, load, max(outer, inner))
    put_patch(draft, "ring", mesh.ring, load, inner)
