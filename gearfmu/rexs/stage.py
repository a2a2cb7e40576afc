"""A stage of a REXS file as a draft: a cylindrical_stage of two external gears as a pair, a planetary_stage as a set of
sun, planets, ring and carrier; and what of the file was not used."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from gearfmu.errors import Problem, SpecError
from gearfmu.geometry.mesh import HANDS, MOUNTS, RingMesh, set_ratio
from gearfmu.geometry.shifts import sum_of_shifts
from gearfmu.quantities import to_si
from gearfmu.rexs.gears import (
    RexsGear,
    assumed_torque,
    gear_of,
    place_shifts,
    put_external,
    put_rack,
    put_rack_data,
    put_teeth,
    section_diameters,
    shaft_diameters,
    shaft_loads,
)
from gearfmu.rexs.reading import Component, RexsModel, read_rexs
from gearfmu.stagefile.checks.gears import STRIP_PER_HERTZ, rounded_up
from gearfmu.stagefile.forms.planetary import SetSpec
from gearfmu.stagefile.forms.shapes import gear_geometry, gears_in_mesh, largest_half_width, ring_geometry
from gearfmu.stagefile.proposals.draft import (
    BACKLASH_PER_MODULE,
    LOAD_RULE,
    PITCH_SPEED,
    STRIP_PER_MODULE,
    Draft,
    Unread,
    millimetres,
)
from gearfmu.stagefile.reading.base import validate
from gearfmu.stagefile.tables.bodies import GearSpec, PairSpec, RingSpec, SetGearSpec

_STEP_TOLERANCE = 0.02  # of a step in which planets can be placed
NAMES = ("pinion", "wheel")


def draft_from_rexs(path: Path, stage: str = "") -> Draft:
    """A draft of the gear stage in a REXS file, or of the one with the identifier or name `stage` where it has several.

    SpecError: the file is none, has no such stage, or does not say what a gear needs; all problems at once.
    """
    model = read_rexs(path)
    chosen = _chosen(model, stage)
    if chosen.type == "planetary_stage":
        draft = _draft_set(model, chosen)
    else:
        draft = _draft_pair(model, chosen)
    if model.problems:
        raise SpecError(model.problems)
    draft.unread = tuple(
        Unread(str(component), attribute.id, attribute.text, attribute.unit) for component, attribute in model.unread()
    )
    return draft


def _chosen(model: RexsModel, wanted: str) -> Component:
    sets = model.of_type("planetary_stage")
    parts = {mesh.id for one in sets for mesh in model.related(one, "cylindrical_stage", relation="assembly")}
    stages = [*sets, *(mesh for mesh in model.of_type("cylindrical_stage") if mesh.id not in parts)]
    fitting = [one for one in stages if wanted in ("", one.id, one.name)]
    if len(fitting) == 1:
        return fitting[0]
    known = "; ".join(str(one) for one in stages) or "none (only cylindrical_stage and planetary_stage are read)"
    remedy = f"say which stage with --stage: {known}" if fitting else f"there is no such stage: {known}"
    raise SpecError.of(model.path, "stage", wanted, remedy)


def _gears(model: RexsModel, stage: Component) -> list[Component]:
    gears = model.related(stage, "cylindrical_gear", "ring_gear", relation="stage")
    if len(gears) != 2 or any(gear.type == "ring_gear" for gear in gears):
        listed = ", ".join(map(str, gears)) or "none"
        remedy = "a pair needs a relation of type stage with two cylindrical_gear; a ring alone is read in a set only"
        raise SpecError.of(model.path, str(stage), listed, remedy)
    return gears


def _draft_pair(model: RexsModel, stage: Component) -> Draft:
    """The draft of a pair; what cannot be read is in the model's problems."""
    read = [gear_of(model, component) for component in _gears(model, stage)]
    distance = model.si(stage, "center_distance", "m")
    if distance is None:
        model.refuse(stage, "center_distance", "", "this attribute is missing: add it")
    elif distance <= 0.0:
        model.refuse(stage, "center_distance", f"{1e3 * distance:g} mm", "must be above zero: both gears are external")
    gears = sorted((gear for gear in read if gear is not None), key=lambda gear: gear.teeth)
    if len(gears) < 2 or distance is None or distance <= 0.0:
        return Draft({})
    draft = Draft.after("helical_demo" if gears[0].helix_angle else "fzg_c")
    _put_pair(model, draft, stage, gears)
    places = dict(zip(("gears.pinion", "gears.wheel"), gears, strict=True))
    place_shifts(draft, places, distance)
    apart = (distance - sum(gear.reference_radius for gear in gears)) / gears[0].module
    topping = min(0.0, apart - sum(gear.x or 0.0 for gear in gears))
    for place, gear in places.items():
        put_teeth(model, draft, place, gear)
        put_external(model, draft, place, gear, topping, "d + 2 m_n (h_aP + x + k), tip clearance kept")
    _even_bearings(draft, gears)
    _put_pair_loads(model, draft, gears)
    _put_what_fits(draft, gears)
    return draft


def _put_pair(model: RexsModel, draft: Draft, stage: Component, gears: list[RexsGear]) -> None:
    origin = f"REXS {stage.type} {stage.id}"
    draft.put("pair.center_distance", model.quantity(stage, "center_distance", "m"), origin)
    put_rack_data(draft, "pair", gears)
    if abs(gears[0].helix_angle + gears[1].helix_angle) > 1e-9:
        shown = ", ".join(f"{math.degrees(gear.helix_angle):g} deg" for gear in gears)
        remedy = "the helix angles of an external pair are equal and opposite"
        model.refuse(stage, "helix_angle_reference_diameter", shown, remedy)
    draft.drop("pair.misalignment")


def _even_bearings(draft: Draft, gears: list[RexsGear]) -> None:
    """Spur gears move along their axes and tilt either both or not at all."""
    tables = [draft.tables["gears"][name]["bearing"] for name in NAMES]
    for key in ("axial", "tilt"):
        if gears[0].helix_angle == 0 and not all({"axial", "tilt"} <= set(table) for table in tables):
            for name in NAMES:
                draft.drop(f"gears.{name}.bearing.{key}")


def _put_pair_loads(model: RexsModel, draft: Draft, gears: list[RexsGear]) -> None:
    ratio = gears[1].teeth / gears[0].teeth
    torques, speeds = zip(*(shaft_loads(model, gear.component) for gear in gears), strict=True)
    found = torques[0] or (torques[1] / ratio if torques[1] else None)
    known = (found and rounded_up(found, 3), "REXS external_load, the largest of all load cases")
    torque = draft.put_limit("torque_max", known, (assumed_torque(gears), LOAD_RULE))
    draft.put_shafts(dict(zip(NAMES, (torque, torque * ratio), strict=True)))
    found = speeds[0] or (speeds[1] * ratio if speeds[1] else None)
    known = (found and rounded_up(found, 4), "REXS shaft, the largest of all load cases")
    draft.put_limit("speed_max", known, (PITCH_SPEED / gears[0].reference_radius, "20 m/s at the reference circle"))


def _put_what_fits(draft: Draft, gears: list[RexsGear]) -> None:
    """Backlash and load strips, which need the whole pair; where it cannot be formed the loader says why."""
    module = gears[0].module
    draft.assume("pair.backlash", millimetres(BACKLASH_PER_MODULE * module), "2 % of the module")
    pair, _ = validate(PairSpec, draft.tables["pair"], "")
    specs = [validate(GearSpec, draft.tables["gears"][name] | {"name": name}, "")[0] for name in NAMES]
    known = [spec for spec in specs if spec is not None]
    if pair is None or len(known) < 2:
        return
    try:
        geometry = gears_in_mesh(pair, known)
        if any(gear.r_a <= gear.r_b for gear in geometry.gears):
            return
        nominal = geometry.nominal_backlash
        width = STRIP_PER_HERTZ * largest_half_width(known, geometry, to_si(draft.tables["torque_max"], "N*m"))
    except (ValueError, ZeroDivisionError):
        return
    if nominal > BACKLASH_PER_MODULE * module:
        draft.assume("pair.backlash", millimetres(rounded_up(nominal, 3)), "as profile shifts and centre distance give")
    if width > STRIP_PER_MODULE * module:
        for name in NAMES:
            text = millimetres(rounded_up(width, 2))
            draft.assume(f"gears.{name}.body.strip_half_width", text, "1.5 Hertz half-widths at torque_max")


def _draft_set(model: RexsModel, stage: Component) -> Draft:
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
    _put_set_loads(model, draft, stage, gears, planets)
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


def _put_set_loads(
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
