"""A cylindrical_stage of two external gears as an external pair."""

from __future__ import annotations

import math

from gearfmu.geometry.mesh import common_width
from gearfmu.quantities import to_si
from gearfmu.rexs.gears import RexsGear, gear_of, place_shifts, put_external, put_teeth, shaft_loads
from gearfmu.rexs.reading import Component, RexsModel
from gearfmu.stagefile.checks.gears import STRIP_PER_HERTZ, rounded_up
from gearfmu.stagefile.forms.shapes import gears_in_mesh, largest_half_width
from gearfmu.stagefile.proposals.draft import (
    BACKLASH_PER_MODULE,
    LOAD_RULE,
    PITCH_SPEED,
    STRIP_PER_MODULE,
    Draft,
    degrees,
    millimetres,
    usual_torque,
)
from gearfmu.stagefile.reading.base import validate
from gearfmu.stagefile.tables.bodies import GearSpec, PairSpec

NAMES = ("pinion", "wheel")


def draft_pair(model: RexsModel, stage: Component, pair: tuple[Component, Component]) -> Draft:
    """The draft of a pair; what cannot be read is in the model's problems."""
    read = [gear_of(model, component) for component in pair]
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
    _put_loads(model, draft, gears)
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


def put_rack_data(draft: Draft, place: str, gears: list[RexsGear]) -> None:
    """Module, pressure and helix angle that the gears share; those of the first one."""
    first = gears[0]
    draft.put(f"{place}.normal_module", millimetres(first.module), first.origin)
    draft.put(f"{place}.pressure_angle", degrees(first.pressure_angle), f"{first.origin}, its flanks")
    draft.put(f"{place}.helix_angle", degrees(first.helix_angle), first.origin)
    for gear in gears[1:]:
        for name, value, own in (
            ("normal module", gear.module, first.module),
            ("normal pressure angle", gear.pressure_angle, first.pressure_angle),
        ):
            if abs(value - own) > 1e-9 * own:
                draft.notes.append(f"{gear.component} has another {name} than {first.component}: that one is taken")
        gear.module, gear.pressure_angle = first.module, first.pressure_angle


def assumed_torque(gears: list[RexsGear]) -> float:
    """Torque (N·m) on the first gear at the usual load K."""
    width = common_width(gears)
    return usual_torque(2 * gears[0].reference_radius, gears[1].teeth / gears[0].teeth, width)


def _put_loads(model: RexsModel, draft: Draft, gears: list[RexsGear]) -> None:
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
        text = millimetres(rounded_up(nominal, 3))
        draft.assume("pair.backlash", text, "as profile shifts and centre distance give")
    if width > STRIP_PER_MODULE * module:
        for name in NAMES:
            text = millimetres(rounded_up(width, 2))
            draft.assume(f"gears.{name}.body.strip_half_width", text, "1.5 Hertz half-widths at torque_max")
