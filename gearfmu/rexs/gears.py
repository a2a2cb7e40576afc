"""Gears of a REXS file as tables of a stage file: what a pair and a planetary set share.

Attributes are those of the components cylindrical_gear, ring_gear, cylindrical_gear_flank (flank_geometry before 1.3),
rack_shaped_tool, cutter_wheel_tool, material, shaft_section and concept_bearing. Formulas: ISO 21771.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gearfmu.geometry.mesh import common_width
from gearfmu.geometry.shifts import sum_of_shifts
from gearfmu.rexs.reading import Component, RexsModel
from gearfmu.stagefile.proposals.draft import STRIP_PER_MODULE, Draft, degrees, millimetres, usual_torque

FLANKS = ("cylindrical_gear_flank", "flank_geometry")
TOOLS = ("rack_shaped_tool", "cutter_wheel_tool")
BEARINGS = ("concept_bearing",)
TOOL_FACTORS = (("addendum_coefficient_reference_profile", "dedendum"), ("tip_radius_factor", "fillet_radius"))
STIFFEST = 1e12  # N/m: beyond, a stiffness in a file means "rigid"
RIGID = 1e12  # Pa: beyond, the modulus of a material means "rigid", as shafts have it
_DEEPEST_TIP = 2.5  # modules below r + x m_n: a smaller tip circle is none, such as the 1 mm of unfilled fields


@dataclass
class RexsGear:
    """A gear and what the file says about its teeth (SI); x is None where the file has none, or the tip diameter."""

    component: Component
    teeth: int
    module: float
    pressure_angle: float
    helix_angle: float
    x: float | None
    tip_diameter: float | None
    face_width: float

    @property
    def reference_radius(self) -> float:
        """r = m_n z / (2 cos β), m."""
        return self.module * self.teeth / math.cos(self.helix_angle) / 2

    def drop_placeholder(self, draft: Draft) -> None:
        """Leaves a tip diameter open that is none, with a note. The profile shift must be known."""
        least = 2 * (self.reference_radius + ((self.x or 0.0) - _DEEPEST_TIP) * self.module)
        if self.tip_diameter is not None and self.tip_diameter < least:
            shown = f"tip_diameter = {millimetres(self.tip_diameter)}"
            draft.notes.append(f"{self.component}: {shown} is a placeholder and computed anew")
            self.tip_diameter = None

    @property
    def origin(self) -> str:
        """The words of a mark."""
        return f"REXS {self.component.type} {self.component.id}"


def gear_of(model: RexsModel, component: Component) -> RexsGear | None:
    """The gear of a component; None, and problems in the model, where its teeth cannot be told."""
    places = [component, *model.related(component, *FLANKS)]
    needed = {
        "normal_module": _agreed(model, places, "normal_module", "m"),
        "normal_pressure_angle": _agreed(model, places, "normal_pressure_angle", "rad"),
        "face_width": _agreed(model, places, "face_width", "m"),
        "number_of_teeth": _agreed(model, places, "number_of_teeth", ""),
    }
    for name, value in needed.items():
        if value is None:
            model.refuse(component, name, "", "this attribute is missing: add it")
        elif value == 0 or (value < 0 and name != "number_of_teeth"):
            model.refuse(component, name, f"{value:g}", "a placeholder: write the value of the gear")
    if any(not value for value in needed.values()):
        return None
    tip = _agreed(model, places, "tip_diameter", "m")
    return RexsGear(
        component,
        teeth=abs(round(needed["number_of_teeth"] or 0)),
        module=needed["normal_module"] or 0.0,
        pressure_angle=needed["normal_pressure_angle"] or 0.0,
        helix_angle=_agreed(model, places, "helix_angle_reference_diameter", "rad") or 0.0,
        x=_agreed(model, places, "addendum_modification_coefficient", ""),
        tip_diameter=None if tip is None else abs(tip),
        face_width=needed["face_width"] or 0.0,
    )


def _agreed(model: RexsModel, places: list[Component], name: str, unit: str) -> float | None:
    """The one value that gear and flanks give, SI; a problem where left and right flank differ."""
    found = [model.si(place, name, unit) for place in places]
    values = [value for value in found if value is not None]
    if values and max(values) - min(values) > 1e-9 * max(abs(value) for value in values):
        shown = ", ".join(f"{value:g}" for value in values)
        remedy = "left and right flank, or gear and flank, differ; gears with unequal flanks are not known here"
        model.refuse(places[0], name, shown, remedy)
    return values[0] if values else None


def put_teeth(model: RexsModel, draft: Draft, place: str, gear: RexsGear) -> None:
    """Teeth, width, tip edge, material, mesh and load patch of a gear at `place` of the draft; not profile shift and
    diameters."""
    draft.put(f"{place}.teeth", gear.teeth, gear.origin)
    draft.put(f"{place}.face_width", millimetres(gear.face_width), gear.origin)
    draft.put_proportions(place, gear.module, gear.face_width)
    draft.assume(f"{place}.body.strip_half_width", millimetres(STRIP_PER_MODULE * gear.module), "0.12 m_n")
    _put_material(model, draft, place, gear.component)


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


def place_shifts(draft: Draft, gears: dict[str, RexsGear], distance: float) -> None:
    """Profile shifts of two external gears by their places, as given; missing ones share what a centre distance (m)
    without backlash leaves."""
    first = next(iter(gears.values()))
    teeth, given = sum(gear.teeth for gear in gears.values()), [gear.x for gear in gears.values() if gear.x is not None]
    total = sum_of_shifts(first.module, first.pressure_angle, first.helix_angle, teeth, distance)
    for place, gear in gears.items():
        if gear.x is not None:
            draft.put(f"{place}.profile_shift", gear.x, f"{gear.origin}, its flanks")
        else:
            gear.x = round((total - sum(given)) / (len(gears) - len(given)), 6) + 0.0
            draft.assume(f"{place}.profile_shift", gear.x, "no backlash at the centre distance, equal shares")


def put_external(model: RexsModel, draft: Draft, place: str, gear: RexsGear, topping: float, rule: str) -> None:
    """Rack, tip diameter, bore and bearing of an external gear whose profile shift is known. topping : k of ISO 21771
    that keeps the tip clearance, for a missing tip diameter d + 2 m_n (h*_aP + x + k); rule : the same in words."""
    put_rack(model, draft, f"{place}.rack", gear)
    gear.drop_placeholder(draft)
    if gear.tip_diameter is not None:
        draft.put(f"{place}.tip_diameter", millimetres(gear.tip_diameter), gear.origin)
    else:
        radius = gear.reference_radius + gear.module * (draft.at(f"{place}.rack.addendum") + (gear.x or 0.0) + topping)
        draft.assume(f"{place}.tip_diameter", millimetres(math.floor(2e5 * radius) / 1e5), rule)
    _put_bore(model, draft, place, gear)
    _put_bearing(model, draft, f"{place}.bearing", gear.component)


def put_rack(model: RexsModel, draft: Draft, place: str, gear: RexsGear) -> None:
    """Dedendum and fillet of the basic rack: the addendum and tip radius of the tool, factors of the module."""
    tools = [t for c in (gear.component, *model.related(gear.component, *FLANKS)) for t in model.related(c, *TOOLS)]
    for tool in tools[:1]:
        origin = f"REXS {tool.type} {tool.id}, tool"
        for name, key in TOOL_FACTORS:
            value = model.si(tool, name, "")
            if value is not None and value > 0:
                draft.put(f"{place}.{key}", value, origin)


def _put_material(model: RexsModel, draft: Draft, place: str, component: Component) -> None:
    shafts = model.related(component, "shaft", relation="assembly")
    found = [m for c in (component, *shafts) for m in model.related(c, "material")]
    elastic = [m for m in found if (model.si(m, "elastic_modulus", "Pa") or 0.0) < RIGID]
    for material in elastic[:1]:
        origin = f"REXS material {material.id}"
        for name, key, unit in (
            ("elastic_modulus", "youngs_modulus", "Pa"), ("density", "density", "kg/m^3"), ("poisson_ratio", "", "")
        ):  # fmt: skip
            size = model.si(material, name, unit)
            if size is not None and size > 0:
                value = model.quantity(material, name, unit) if unit else size
                draft.put(f"{place}.material.{key or name}", value, origin)


def section_diameters(model: RexsModel, component: Component) -> tuple[float, float, str] | None:
    """Inner and outer diameter (m) of the shaft where a gear sits on it, and the words of a mark."""
    at = model.si(component, "u_coordinate_on_shaft", "m")
    for shaft in model.related(component, "shaft", relation="assembly"):
        found = shaft_diameters(model, shaft, at)
        if found is not None:
            return found
    return None


def shaft_diameters(model: RexsModel, shaft: Component, at: float | None = None) -> tuple[float, float, str] | None:
    """Inner and outer diameter (m) of the shaft's section at a place `at` (m) along it, of its first one without."""
    for section in model.related(shaft, "shaft_section", relation="assembly"):
        begin = model.si(section, "u_coordinate_on_shaft", "m") or 0.0
        length = model.si(section, "length", "m") or 0.0
        if at is None or begin - 1e-9 <= at <= begin + length + 1e-9:
            share = 0.0 if at is None or not length else (at - begin) / length
            inner, outer = (_along(model, section, f"{side}_diameter", share) for side in ("inner", "outer"))
            if inner is not None and outer is not None and outer > inner:
                return inner, outer, f"REXS shaft_section {section.id}"
    return None


def _along(model: RexsModel, section: Component, name: str, share: float) -> float | None:
    """A diameter (m) of a section, which may be a cone, at a share of its length."""
    begin, end = (model.si(section, f"{name}_{place}", "m") for place in ("begin", "end"))
    return begin if begin is None or end is None else begin + share * (end - begin)


def _put_bore(model: RexsModel, draft: Draft, place: str, gear: RexsGear) -> None:
    """The bore: the shaft's outer diameter where the gear sits on it, its inner one where both are one piece."""
    root = 2 * (gear.reference_radius - gear.module * (draft.at(f"{place}.rack.dedendum") - (gear.x or 0.0)))
    largest, field = root - 2 * gear.module, f"{place}.bore_diameter"
    found = section_diameters(model, gear.component)
    if found is not None:
        inner, outer, origin = found
        if outer <= largest:
            draft.put(field, millimetres(outer), f"{origin}, outer diameter")
            return
        if 0 < inner <= largest:
            draft.put(field, millimetres(inner), f"{origin}, inner diameter: gear and shaft of one piece")
            return
    draft.assume(field, millimetres(round(0.5 * root, 4)), "half the root diameter")


def _put_bearing(model: RexsModel, draft: Draft, place: str, component: Component) -> None:
    """Stiffness of the bearings of a gear's shaft as one bearing at the gear, the shaft being rigid."""
    shafts = model.related(component, "shaft", relation="assembly")
    bearings = [b for shaft in shafts for b in model.related(shaft, *BEARINGS, relation="side")]
    radial = [(b, model.si(b, "radial_stiffness", "N/m")) for b in bearings]
    known = [(b, k) for b, k in radial if k is not None and 0 < k < STIFFEST]
    if not known or len(known) < len(bearings):
        return
    origin = f"REXS bearings {', '.join(b.id for b, _ in known)}, shaft rigid"
    draft.put(f"{place}.stiffness", f"{sum(k for _, k in known):.6g} N/m", origin)
    axial = sum(k for b in bearings if (k := model.si(b, "axial_stiffness", "N/m")) is not None and k < STIFFEST)
    if axial > 0:
        draft.put(f"{place}.axial", f"{axial:.6g} N/m", origin)
    at = model.si(component, "u_coordinate_on_shaft", "m")
    arms = [(k, model.si(b, "u_coordinate_on_shaft_inner_side", "m")) for b, k in known]
    if at is not None and all(u is not None for _, u in arms):
        tilt = sum(k * ((u or 0.0) - at) ** 2 for k, u in arms)
        if tilt > 0:
            draft.put(f"{place}.tilt", f"{tilt:.6g} N*m/rad", origin)


def shaft_loads(model: RexsModel, component: Component) -> tuple[float | None, float | None]:
    """Largest torque (N·m) that an external load brings into the shaft of a gear, and largest speed (rad/s) of that
    shaft, over all load cases."""
    shafts = model.related(component, "shaft", relation="assembly")
    loads = [load for shaft in shafts for load in model.related(shaft, "external_load")]
    torques = [m for load in loads if (m := model.largest(load, "torque_around_u_axis", "N*m"))]
    speeds = [v for shaft in shafts if (v := model.largest(shaft, "rotational_speed", "rad/s"))]
    return max(torques, default=None), max(speeds, default=None)


def assumed_torque(gears: list[RexsGear]) -> float:
    """Torque (N·m) on the first gear at the usual load K."""
    width = common_width(gears)
    return usual_torque(2 * gears[0].reference_radius, gears[1].teeth / gears[0].teeth, width)
