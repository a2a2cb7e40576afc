"""A planetary_stage as a planetary set: sun, planets, ring, carrier."""

from __future__ import annotations

import math
from dataclasses import replace

from gearfmu.errors import Problem
from gearfmu.geometry.mesh import HANDS, MOUNTS, RingMesh, set_ratio
from gearfmu.geometry.shifts import sum_of_shifts
from gearfmu.quantities import to_si
from gearfmu.rexs.gears import (
    RexsGear,
    gear_of,
    place_shifts,
    put_external,
    put_rack,
    put_teeth,
    section_diameters,
    shaft_diameters,
    shaft_loads,
)
from gearfmu.rexs.pair import assumed_torque, put_rack_data
from gearfmu.rexs.reading import Component, RexsModel
from gearfmu.stagefile.checks.gears import rounded_up
from gearfmu.stagefile.forms.planetary import RingSpec, SetGearSpec, SetSpec
from gearfmu.stagefile.forms.shapes import gear_geometry, ring_geometry
from gearfmu.stagefile.proposals.draft import BACKLASH_PER_MODULE, PITCH_SPEED, Draft, millimetres
from gearfmu.stagefile.reading.base import validate

_STEP_TOLERANCE = 0.02  # of a step in which planets can be placed


def draft_set(model: RexsModel, stage: Component) -> Draft:
    """The draft of a planetary set; what cannot be read is in the model's problems."""
    meshes = model.related(stage, "cylindrical_stage", relation="assembly")
    found = _parts(model, meshes)
    distance = _distance(model, meshes)
    if found is None or distance is None:
        remedy = (
            "needs cylindrical_stage parts with a center_distance, not zero, that join one sun, planets and a ring_gear"
        )
        model.problems.append(Problem(str(model.path), str(stage), "", remedy))
        return Draft({})
    components, planets = found
    read = [gear_of(model, component) for component in components]
    gears = [gear for gear in read if gear is not None]
    if len(gears) < 3:
        return Draft({})
    _check_planets(model, planets, gears[1])
    draft = Draft.after("helical_set" if gears[0].helix_angle else "planetary54")
    draft.put("set.center_distance", millimetres(abs(distance)), f"REXS cylindrical_stage {meshes[0].id}")
    put_rack_data(draft, "set", gears)
    _put_planets(model, draft, planets, meshes, gears)
    _put_shifts(draft, gears, abs(distance))
    for name, gear in zip(HANDS, gears, strict=True):
        put_teeth(model, draft, name, gear)
    for name, gear in (("sun", gears[0]), ("planet", gears[1])):
        put_external(model, draft, name, gear, 0.0, "d + 2 m_n (1 + x)")
    _put_ring(model, draft, gears[2], abs(distance))
    _put_carrier(model, draft, stage, gears, abs(distance))
    _put_loads(model, draft, stage, gears, planets)
    draft.assume("set.backlash", millimetres(BACKLASH_PER_MODULE * gears[0].module), "2 % of the module")
    draft.assume("carrier.gap", millimetres(rounded_up(0.8 * gears[0].module, 2)), "0.8 m_n")
    draft.drop("set.pin_errors")
    return draft


def _parts(model: RexsModel, meshes: list[Component]) -> tuple[tuple[Component, ...], list[Component]] | None:
    """Sun, one planet and ring; and all planets. The planet is the gear that meshes with sun and ring."""
    pairs = [(mesh, model.related(mesh, "cylindrical_gear", "ring_gear", relation="stage")) for mesh in meshes]
    rings = {gear.id: gear for _, pair in pairs for gear in pair if gear.type == "ring_gear"}
    planets = {
        gear.id: gear
        for _, pair in pairs
        if any(other.id in rings for other in pair)
        for gear in pair
        if gear.type == "cylindrical_gear"
    }
    suns = {gear.id: gear for _, pair in pairs for gear in pair if gear.type != "ring_gear" and gear.id not in planets}
    if len(rings) != 1 or len(suns) != 1 or not planets:
        return None
    return (next(iter(suns.values())), next(iter(planets.values())), next(iter(rings.values()))), list(planets.values())


def _distance(model: RexsModel, meshes: list[Component]) -> float | None:
    """The centre distance (m) that all meshes have in common; a problem where they differ."""
    found = [abs(a) for mesh in meshes if (a := model.si(mesh, "center_distance", "m")) is not None]
    if found and max(found) - min(found) > 1e-9:
        shown = f"{1e3 * min(found):g} to {1e3 * max(found):g} mm"
        remedy = "sun and ring have the same distance to all planets here"
        model.refuse(meshes[0], "center_distance", shown, remedy)
    return found[0] if found and all(found) else None


def _check_planets(model: RexsModel, planets: list[Component], first: RexsGear) -> None:
    """All planets are equal here."""
    for planet in planets:
        gear = gear_of(model, planet)
        if gear is not None and replace(gear, component=first.component) != first:
            remedy = f"differs from {first.component}; the planets of a set are equal"
            model.problems.append(Problem(str(model.path), str(planet), "", remedy))


def _put_planets(
    model: RexsModel, draft: Draft, planets: list[Component], meshes: list[Component], gears: list[RexsGear]
) -> None:
    """Number and places of the planets: by the angle of their meshes with the ring, else equally spaced."""
    count, teeth = len(planets), gears[0].teeth + gears[2].teeth
    draft.put("set.planets", count, "REXS planets that mesh with the ring")
    draft.drop("set.positions")
    draft.put("carrier.coupling", {"bore": "rigid", **{f"bolt{k}": "rigid" for k in range(count)}}, "assumed, rigid")
    angles = []
    for planet in planets:
        own = model.related(planet, "cylindrical_stage", relation="stage")
        found = [model.si(mesh, "rotating_angle_around_neg_u_axis", "rad") for mesh in own if mesh in meshes]
        angles.append(next((angle for angle in found if angle is not None), None))
    if any(angle is None for angle in angles):
        return
    steps = sorted(((angle or 0.0) - (angles[0] or 0.0)) % (2 * math.pi) * teeth / (2 * math.pi) for angle in angles)
    if all(abs(step - k * teeth / count) < 0.1 for k, step in enumerate(steps)) and teeth % count == 0:
        return
    if any(abs(step - round(step)) > _STEP_TOLERANCE for step in steps):
        shown = ", ".join(f"{360 * step / teeth:.3f} deg" for step in steps)
        draft.notes.append(f"the planets are at {shown}, where teeth do not fit: the nearest places are taken")
    draft.put("set.positions", [round(step) % teeth for step in steps], "REXS rotating_angle_around_neg_u_axis")


def _put_shifts(draft: Draft, gears: list[RexsGear], distance: float) -> None:
    """Profile shifts; the ring's is positive outwards here. ISO 21771 counts it the other way: the sign that fits the
    centre distance is taken."""
    sun, planet, ring = gears
    alpha, beta, module = sun.pressure_angle, sun.helix_angle, sun.module
    place_shifts(draft, {"sun": sun, "planet": planet}, distance)
    fitting = (planet.x or 0.0) + sum_of_shifts(module, alpha, beta, ring.teeth - planet.teeth, distance)
    if ring.x is None:
        ring.x = round(fitting, 6) + 0.0
        draft.assume("ring.profile_shift", ring.x, "no backlash at the centre distance")
        return
    inwards = abs(-ring.x - fitting) <= abs(ring.x - fitting)
    ring.x = (-ring.x if inwards else ring.x) + 0.0
    side = f", there positive {'inwards' if inwards else 'outwards'}, as the centre distance shows" if ring.x else ""
    draft.put("ring.profile_shift", ring.x, f"{ring.origin}, its flanks{side}")


def _put_ring(model: RexsModel, draft: Draft, ring: RexsGear, distance: float) -> None:
    put_rack(model, draft, "ring", ring)
    ring.drop_placeholder(draft)
    if ring.tip_diameter is not None:
        draft.put("ring.tip_diameter", millimetres(ring.tip_diameter), ring.origin)
    else:
        radius = ring.reference_radius - ring.module * (1 - (ring.x or 0.0))
        radius = max(radius, _tip_that_clears(draft, distance))
        draft.assume("ring.tip_diameter", millimetres(rounded_up(2 * radius, 5)), "d - 2 m_n (1 - x), clear of planets")
    root = 2 * (ring.reference_radius + ring.module * (draft.at("ring.dedendum") + (ring.x or 0.0)))
    found = section_diameters(model, ring.component)
    if found is not None and found[1] > root + 2 * ring.module:
        draft.put("ring.rim_diameter", millimetres(found[1]), f"{found[2]}, outer diameter")
    else:
        draft.assume("ring.rim_diameter", millimetres(rounded_up(root + 7 * ring.module, 3)), "a rim of 3.5 m_n")
    draft.assume("ring.mounts.points", MOUNTS, "evenly round the rim")


def _tip_that_clears(draft: Draft, distance: float) -> float:
    """Smallest tip radius (m) of the ring that does not meet the planet below its form circle; 0 where that cannot be
    told before the rest is put right."""
    ring_table = {"tip_diameter": "1 mm", "rim_diameter": "1 m"} | {
        key: value for key, value in draft.tables["ring"].items() if key not in ("tip_diameter", "rim_diameter")
    }
    shared, _ = validate(SetSpec, draft.tables["set"], "")
    planet, _ = validate(SetGearSpec, draft.tables["planet"] | {"name": "planet"}, "")
    ring, _ = validate(RingSpec, ring_table, "")
    if shared is None or planet is None or ring is None:
        return 0.0
    shapes = (gear_geometry(planet, shared, HANDS["planet"]), ring_geometry(ring, shared, HANDS["ring"]))
    try:
        return RingMesh(shapes, distance, 0.0).least_tip_radius
    except ValueError:
        return 0.0


def _put_carrier(model: RexsModel, draft: Draft, stage: Component, gears: list[RexsGear], distance: float) -> None:
    carriers = model.related(stage, "planet_carrier", relation="assembly")
    plates = [plate for carrier in carriers for plate in model.related(carrier, "side_plate", relation="assembly")]
    bore = _bolt(model, draft, stage)
    values: dict[str, tuple[float, str]] = {
        "bore_diameter": (rounded_up(distance, 2), "the centre distance"),
        "outer_diameter": (rounded_up(2 * distance + 2 * bore, 3), "the bolt circle and two bolt diameters"),
        "thickness": (rounded_up(0.5 * gears[1].face_width, 2), "half the planets' width"),
    }
    names = {"bore_diameter": "inner_diameter", "outer_diameter": "outer_diameter", "thickness": "length"}
    for key, (assumed, why) in values.items():
        found = model.si(plates[0], names[key], "m") if plates else None
        if found:
            draft.put(f"carrier.{key}", millimetres(found), f"REXS side_plate {plates[0].id}")
        else:
            draft.assume(f"carrier.{key}", millimetres(assumed), why)
    if len(plates) > 1:
        others = ", ".join(plate.id for plate in plates[1:])
        draft.notes.append(f"a carrier has one plate here: side_plate {others} is left out, the carrier is too soft")


def _bolt(model: RexsModel, draft: Draft, stage: Component) -> float:
    """Diameter (m) of the bolts: that of the planet pins, which must fit the planets' bores."""
    largest = to_si(draft.tables["planet"]["bore_diameter"], "m")
    for pin in model.related(stage, "shaft", relation="planet_pin"):
        found = shaft_diameters(model, pin)
        if found is not None and found[1] < largest:
            draft.put("carrier.bolt_diameter", millimetres(found[1]), f"{found[2]}, planet pin")
            return found[1]
    assumed = math.floor(0.75e4 * largest) / 1e4
    draft.assume("carrier.bolt_diameter", millimetres(assumed), "three quarters of the planets' bore")
    return assumed


def _put_loads(
    model: RexsModel, draft: Draft, stage: Component, gears: list[RexsGear], planets: list[Component]
) -> None:
    sun, planet, ring = gears
    ratio = set_ratio(sun.teeth, ring.teeth)
    torque, speed = shaft_loads(model, sun.component)
    sharing = draft.at("set.load_sharing")
    known = (torque and rounded_up(torque * ratio, 3), "REXS external_load on the sun's shaft, times 1 + z_ring/z_sun")
    assumed = assumed_torque([sun, planet]) * len(planets) / sharing * ratio
    draft.put_limit("torque_max", known, (assumed, "4 N/mm2 in the mesh of the sun (K of a pair)"))
    known = (speed and rounded_up(speed / ratio, 4), "REXS shaft of the sun, over 1 + z_ring/z_sun")
    assumed = PITCH_SPEED / sun.reference_radius / ratio
    draft.put_limit("speed_max", known, (assumed, "20 m/s at the sun's reference circle"))
