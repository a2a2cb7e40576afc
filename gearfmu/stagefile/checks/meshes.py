"""Can two gears run together and carry the torque? Gear B may be a ring.

Formulas: ISO 21771; interference by form rolls; tip interference in a ring: Colbourne (1987). Nothing here stops at the
first problem.
"""

from __future__ import annotations

from dataclasses import dataclass

from gearfmu.geometry import GearGeometry, PairGeometry, involute
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.geometry.mesh import RingMesh
from gearfmu.stagefile.checks.gears import Found, at_most, gear_problems, millimetres, rounded_down, rounded_up
from gearfmu.stagefile.forms.general import GearBody, ToothedBody
from gearfmu.stagefile.forms.shapes import GearShape, MeshShape, gear_shape, largest_half_width
from gearfmu.stagefile.tables.flanks import TOOTHING

STRIP_PER_HERTZ = 1.5  # the local law needs w > 1.12 b; at 1.5 b its tangent still has a margin
_LARGEST_ALLOWANCE = 0.1  # of the module: more is a wrong centre distance or profile shift
_LARGEST_THICKENING = 0.005  # of the module
_SHAPE_NO_FLANK = {*TOOTHING, "bore_diameter", "rim_diameter", "import"}  # fields that no check of a mesh depends on


@dataclass(frozen=True)
class Meshed:
    """Two gears in mesh. distance, backlash: m; torque: on gear A, N·m (None: its contact is not judged); carried: by a
    planet carrier. Problems are named "bodies.NAME.…", "distance" and "backlash"."""

    gears: tuple[GearBody, ToothedBody]
    distance: float
    backlash: float
    torque: float | None
    carried: bool = False

    @property
    def pinion(self) -> str:
        """The word for gear A in a ring."""
        return "planet" if self.carried else "pinion"


def mesh_problems(mesh: Meshed) -> Found:
    """Everything that is wrong with the gears by themselves, then with their mesh."""
    a, b = [gear_shape(gear) for gear in mesh.gears]
    found = [(gear.name, *problem) for gear in mesh.gears for problem in gear_problems(gear)]
    for name, field, value, remedy in found:
        yield f"bodies.{name}.{field}", value, remedy
    ring = isinstance(b, InternalGearGeometry)
    least, what = (b.r_b - a.r_b, "difference") if ring else (a.r_b + b.r_b, "sum")
    if mesh.distance <= least or least <= 0:
        advice = "check teeth and module" if ring else "check it against module and teeth"
        yield "distance", mesh.distance, f"smaller than the {what} of the base radii, {millimetres(least)}: {advice}"
    elif all(field.split(".")[0] in _SHAPE_NO_FLANK for _, field, *_ in found):
        assert isinstance(a, GearGeometry)
        if isinstance(b, InternalGearGeometry):
            internal = RingMesh(a, b, mesh.distance, mesh.backlash)
            yield from _internal(mesh, internal)
            yield from _load_patches(mesh, internal)
        else:
            external = PairGeometry((a, b), mesh.distance, mesh.backlash)
            yield from _external(mesh, external)
            yield from _load_patches(mesh, external)


def _external(mesh: Meshed, pair: PairGeometry) -> Found:
    for index in (0, 1):
        yield from _interference(mesh, pair, index)
    if pair.contact_ratio < 1:
        remedy = f"the contact ratio is {pair.contact_ratio:.3f}, below 1: larger tip diameters or smaller tip edges"
        yield "distance", mesh.distance, remedy
    allowance, module = mesh.backlash - pair.nominal_backlash, pair.gears[0].m
    facts = f"profile shifts and centre distance give j_wt = {_um(pair.nominal_backlash)}"
    if allowance < -_LARGEST_THICKENING * module:
        remedy = f"{facts}, more than declared: declare that, or correct centre distance or profile shifts"
        yield "backlash", mesh.backlash, remedy
    elif allowance > _LARGEST_ALLOWANCE * module:
        fitting = millimetres(pair.zero_backlash_center_distance)
        remedy = f"{facts}, none at {fitting}; to thin the teeth by {_um(allowance)} is no tolerance: correct it"
        yield "distance", mesh.distance, remedy


def _interference(mesh: Meshed, pair: PairGeometry, index: int) -> Found:
    """Tip of gear `index` in the root of the other."""
    tip, root = pair.gears[index], pair.gears[1 - index]
    gear, other = mesh.gears[index], mesh.gears[1 - index].name
    field, value = f"bodies.{gear.name}.tip_diameter", gear.tip_diameter
    if pair.a - tip.r_a - root.r_f <= 0:
        largest = millimetres(rounded_down(2 * (pair.a - root.r_f)))
        yield field, value, f"the tip touches the root circle of {other}: less than {largest}"
    elif pair.opposite(tip.s_a) < root.s_form:
        form = 2 * float(involute.radius_at_roll(max(pair.opposite(root.s_form), 0.0), tip.r_b))
        yield field, value, f"interference: the tip meets {other} below its form circle: {at_most(form)}"


def _internal(mesh: Meshed, shape: RingMesh) -> Found:
    """Form circles, tips, contact ratio and backlash of the pinion in the ring."""
    (pinion, ring), word = mesh.gears, mesh.pinion
    own, of_ring = f"bodies.{pinion.name}", f"bodies.{ring.name}"
    if shape.ring.r_a < shape.least_tip_radius:
        least = rounded_up(2 * shape.least_tip_radius, 5)
        remedy = (
            f"interference: the tip meets the {word} below its form circle; at least {millimetres(least)} "
            f"(tip radius {millimetres(least / 2)})"
        )
        yield f"{of_ring}.tip_diameter", ring.tip_diameter, remedy
    if shape.a + shape.planet.r_a >= shape.ring.r_f:
        largest = millimetres(rounded_down(2 * (shape.ring.r_f - shape.a), 5))
        yield f"{own}.tip_diameter", pinion.tip_diameter, f"touches the ring's root: less than {largest}"
    elif shape.planet.r_a > shape.largest_planet_tip_radius:
        largest = at_most(2 * shape.largest_planet_tip_radius, 5)
        remedy = f"interference: the tip meets the ring in its root fillet; {largest}"
        yield f"{own}.tip_diameter", pinion.tip_diameter, remedy
    if shape.tip_clearance_angle < 0:
        remedy = f"{word} and ring collide with their tips outside the line of action: make it larger, or more teeth"
        yield f"{of_ring}.tip_diameter", ring.tip_diameter, remedy
    if shape.contact_ratio < 1:
        remedy = f"the contact ratio of {word} and ring is {shape.contact_ratio:.3f}, below 1: make it smaller"
        yield f"{of_ring}.tip_diameter", ring.tip_diameter, remedy
    allowance = mesh.backlash - shape.nominal_backlash
    if not -_LARGEST_THICKENING * shape.planet.m <= allowance <= _LARGEST_ALLOWANCE * shape.planet.m:
        remedy = (
            f"profile shifts and centre distance give j_wt = {millimetres(shape.nominal_backlash)} of {word} and ring, "
            f"not the declared {millimetres(mesh.backlash)}: correct it"
        )
        yield f"{of_ring}.profile_shift", f"{ring.profile_shift:g}", remedy


def _load_patches(mesh: Meshed, shape: MeshShape) -> Found:
    """Load patches, wider than the contact at the torque and shorter than the flank."""
    internal = isinstance(shape, RingMesh)
    least = STRIP_PER_HERTZ * largest_half_width(mesh.gears, shape, mesh.torque) if mesh.torque else 0.0
    whose, share = ("the ring's contact", "") if internal else ("the contact", "1.5 Hertz half-widths, ")
    shapes: tuple[GearShape, ...] = shape.gears
    for gear, own in zip(mesh.gears, shapes, strict=True):
        width, field = gear.body.strip_half_width, f"bodies.{gear.name}.body.strip_half_width"
        flank = abs(float(involute.arc_length(own.s_tip, own.r_b) - involute.arc_length(own.s_form, own.r_b)))
        if width < least:
            remedy = f"too narrow for {whose} at torque_max: at least {share}{millimetres(rounded_up(least, 3))}"
            yield field, width, remedy
        elif 2 * width > flank:
            yield field, width, f"the load patch is longer than the flank: {at_most(flank / 2)}"


def _um(value: float) -> str:
    return f"{1e6 * value:.3g} µm"
