"""Can these gears be made, run together and carry the torque? Gear B of a mesh may be a ring.

Every problem names a field and its remedy; nothing here stops at the first one. Formulas: ISO 21771; undercut
and interference by form rolls; tip interference in a ring: Colbourne (1987)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import accumulate
from typing import Any

from scipy.optimize import brentq

from gearfmu.geometry import GearGeometry, PairGeometry, involute
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.geometry.mesh import RingMesh
from gearfmu.geometry.shifts import distance_of_shifts
from gearfmu.quantities import kernel_limits
from gearfmu.stagefile.forms.general import GearBody, RingBody, ToothedBody
from gearfmu.stagefile.forms.shapes import GearShape, MeshShape, gear_shape, largest_half_width
from gearfmu.stagefile.tables.bodies import TOOTHING

_LARGEST = 0.1  # of the module: reliefs, crownings, slopes, eccentricity
_LARGEST_INDEX_DEVIATION = 0.05  # of the module: coarser than every tolerance class of ISO 1328-1
_ROUND = 1e-6  # m: by how much single pitch deviations may miss their sum, zero
_RIM_PER_TOOTH_HEIGHT = 0.5  # thinner rims are outside the rim thickness factor of ISO 6336-3

Found = Iterator[tuple[str, float | str, str]]  # field, value (m, or text), remedy


def gear_problems(body: ToothedBody) -> Found:
    """One gear or ring by itself; later checks need earlier ones."""
    shape = gear_shape(body)
    if isinstance(body, RingBody):
        assert isinstance(shape, InternalGearGeometry)
        yield from _ring_problems(body, shape)
        return
    assert isinstance(shape, GearGeometry)
    rack = _rack_problems(body, shape)
    yield from rack
    yield from _rim_problems(body, shape)
    yield from _import_problems(body)
    tip = [] if rack else list(_tip_problems(body, shape))
    yield from tip
    if not rack and not tip:
        yield from _flank_problems(body, shape)


def _rack_problems(gear: GearBody, shape: GearGeometry) -> list[tuple[str, float | str, str]]:
    """The rack is judged in the normal section, undercut in the transverse one (ISO 21771)."""
    tan, sin, cos = math.tan(shape.alpha), math.sin(shape.alpha), math.cos(shape.alpha)
    largest = min((math.pi / 4 - gear.rack.dedendum * tan) * cos / (1 - sin), gear.rack.dedendum)
    if gear.rack.fillet_radius > largest:
        remedy = f"does not fit the rack's tip: at most {rounded_down(largest):g} for this dedendum"
        return [("rack.fillet_radius", f"{gear.rack.fillet_radius:g}", remedy)]
    if gear.profile_shift < (least := _least_shift(gear, shape)) - 0.5 * shape.shift_per_tooth:
        remedy = f"the rack undercuts the flank: at least {rounded_up(least):g}, or more teeth"
        return [("profile_shift", f"{gear.profile_shift:g}", remedy)]
    return []


def _least_shift(gear: GearBody, shape: GearGeometry) -> float:
    """Profile shift without undercut by the rack's addendum.

    The tool's flank may end deeper; it cuts there only into flank that no mating rack reaches, and the tooth is
    modelled as it is cut. The limiting number of teeth is a whole one, as in tables (17 for 20 degrees): the shift of
    half a tooth is no undercut.
    """
    straight = (shape.h_fp - shape.rho_fp * (1 - math.sin(shape.alpha))) / shape.m
    return shape.least_shift(min(gear.rack.addendum, straight))


def _rim_problems(gear: GearBody, shape: GearGeometry) -> Found:
    largest = 2 * (shape.r_f - _RIM_PER_TOOTH_HEIGHT * (shape.r_a - shape.r_f))
    if gear.bore_diameter > largest:
        remedy = f"leaves a rim thinner than half the tooth height: {at_most(largest)}"
        yield "bore_diameter", gear.bore_diameter, remedy


def _import_problems(body: ToothedBody) -> Found:
    """Finite elements made elsewhere."""
    if body.imported is not None and body.helix_angle:
        remedy = (
            "finite elements made elsewhere are read for spur gears only: set the helix angle to 0 deg or leave the "
        )
        yield "import", body.imported.file, remedy + "table away and let the gear be meshed here"


def _tip_problems(gear: GearBody, shape: GearGeometry) -> Found:
    rack_tip = shape.r + (gear.rack.addendum + gear.profile_shift) * shape.m
    form = float(involute.radius_at_roll(shape.s_form, shape.r_b))
    if shape.r_a > rack_tip * (1 + 1e-9):
        largest = millimetres(rounded_down(2 * rack_tip))
        remedy = f"larger than the basic rack makes, d + 2 m_n (x + addendum): at most {largest}"
        yield "tip_diameter", gear.tip_diameter, remedy
    if shape.r_a - shape.tip_edge <= form:
        remedy = f"no involute is left above the form circle: more than {millimetres(2 * (form + shape.tip_edge))}"
        yield "tip_diameter", gear.tip_diameter, remedy
    elif shape.tip_half_angle <= 0:
        pointed = form if shape.thickness_angle(form) <= 0 else brentq(shape.thickness_angle, form, shape.r_a)
        remedy = f"the tooth is pointed (tip thickness ≤ 0): less than {millimetres(rounded_down(2 * pointed))}"
        yield "tip_diameter", gear.tip_diameter, remedy
    elif shape.tip_land_half_angle < 0:
        land = millimetres(2 * shape.r_a * shape.tip_half_angle)
        yield "tip_edge_radius", gear.tip_edge_radius, f"the two roundings overlap on a tip of {land}: make it smaller"


def _ring_problems(ring: RingBody, shape: InternalGearGeometry) -> Found:
    """A ring, from the root inwards."""
    yield from _import_problems(ring)
    if shape.fillet_centre[1] <= 0:
        yield "fillet_radius", f"{ring.fillet_radius:g}", "the two fillets of a space overlap: make it smaller"
    if shape.s_tip <= 0:
        least = millimetres(2 * (shape.r_b + 1e-3 * shape.m))
        remedy = f"the tip reaches inside the base circle, where there is no involute: above {least}"
        yield "tip_diameter", ring.tip_diameter, remedy
    elif shape.s_form <= shape.s_tip:
        yield "tip_diameter", ring.tip_diameter, "no involute is left between tip and fillet: make it smaller"
    elif shape.tip_half_angle <= 0:
        yield "tip_diameter", ring.tip_diameter, "the tooth is pointed (tip thickness ≤ 0): make it larger"
    elif shape.tip_land_half_angle < 0:
        land = millimetres(2 * shape.r_a * shape.tip_half_angle)
        yield "tip_edge_radius", ring.tip_edge_radius, f"the two roundings overlap on a tip of {land}"
    else:
        yield from _flank_problems(ring, shape)
    thinnest = shape.r_f + _RIM_PER_TOOTH_HEIGHT * (shape.r_f - shape.r_a)
    if shape.r_rim < thinnest:
        remedy = f"leaves a rim thinner than half the tooth height: at least {millimetres(rounded_up(2 * thinnest))}"
        yield "rim_diameter", ring.rim_diameter, remedy


def _flank_problems(gear: ToothedBody, shape: GearShape) -> Found:
    """Everything that cannot be of the teeth of one gear or ring."""
    yield from _amounts(gear, shape)
    yield from _reliefs(gear, shape)
    yield from _pitches(gear, shape)
    if gear.lead is not None and gear.lead.end_relief is not None and 2 * gear.lead.end_relief.length > gear.face_width:
        remedy = f"the reliefs of both ends meet: at most half the face width, {millimetres(gear.face_width / 2)}"
        yield "lead.end_relief.length", gear.lead.end_relief.length, remedy


_AMOUNTS = (
    "tip_relief.amount root_relief.amount profile.slope profile.crowning lead.slope lead.crowning "
    "lead.end_relief.amount eccentricity.amount"
).split()


def _amounts(gear: ToothedBody, shape: GearShape) -> Found:
    """Lengths that a module bounds."""
    most = _LARGEST * shape.m
    for field in _AMOUNTS:
        value: Any = reduce(lambda table, key: table and getattr(table, key), field.split("."), gear)
        if value and abs(value) > most:
            yield field, value, f"more than a tenth of the module: at most {millimetres(most)}"


def _reliefs(gear: ToothedBody, shape: GearShape) -> Found:
    """Beginnings of reliefs lie on the flank."""
    low, high = sorted((shape.s_form, shape.s_a))
    for field, relief in (("tip_relief", gear.tip_relief), ("root_relief", gear.root_relief)):
        if relief is None or isinstance(relief.start_roll, str):
            continue
        end = shape.s_a if field == "tip_relief" else shape.s_form
        if not low <= relief.start_roll <= high or relief.start_roll == end:
            remedy = f"outside the flank: from {millimetres(low)} to {millimetres(high)}"
            yield f"{field}.start_roll", relief.start_roll, remedy
            continue
        steepest = kernel_limits()["RELIEF"][1]
        if relief.amount > steepest * (end - relief.start_roll) ** 2:
            least = millimetres(math.sqrt(relief.amount / steepest))
            yield f"{field}.start_roll", relief.start_roll, f"too near the end of the flank: at least {least} from it"


def _pitches(gear: ToothedBody, shape: GearShape) -> Found:
    """Deviations of teeth that there are, within what a gear can have."""
    largest = _LARGEST_INDEX_DEVIATION * shape.m
    for tooth, deviation in gear.index_deviation.items():
        field = f"index_deviation.{tooth}"
        if tooth >= gear.teeth:
            yield field, deviation, f"there is no such tooth: they are numbered 0 to {gear.teeth - 1}"
        elif abs(deviation) > largest:
            yield field, deviation, f"more than a twentieth of the module: at most {millimetres(largest)}"
    single = gear.pitch_deviation
    if single and len(single) != gear.teeth:
        yield "pitch_deviation", f"{len(single)} values", f"a gear has as many pitches as teeth: give {gear.teeth}"
    elif single and abs(math.fsum(single)) > _ROUND:
        remedy = "single pitch deviations of all teeth sum to zero: correct them, or give index_deviation"
        yield "pitch_deviation", f"sum {millimetres(math.fsum(single))}", remedy
    elif single and max(map(abs, single)) > largest:
        remedy = f"more than a twentieth of the module: at most {millimetres(largest)}"
        yield "pitch_deviation", max(single, key=abs), remedy
    elif single and (most := max(accumulate(single), key=abs)) and abs(most) > largest:
        remedy = f"they sum to more than a twentieth of the module: at most {millimetres(largest)}"
        yield "pitch_deviation", f"sum {millimetres(most)}", remedy


def rounded_down(value: float, digits: int = 4) -> float:
    """The largest number of so many significant digits that is not above `value`."""
    step = 10.0 ** max(math.floor(math.log10(abs(value))) - digits + 1, -300) if value else 1.0
    return math.floor(value / step) * step


def rounded_up(value: float, digits: int = 4) -> float:
    """The smallest number of so many significant digits that is not below `value`."""
    return -rounded_down(-value, digits)


def at_most(limit: float, digits: int = 4) -> str:
    """The largest length (m) that is allowed, or that there is none."""
    if limit <= 0:
        return "no value fits: another number of this gear is wrong, teeth, module, profile shift or a diameter"
    return f"at most {millimetres(rounded_down(limit, digits))}"


def shown(value: float | str) -> str:
    """The value of a problem as text: a length in m in mm."""
    return value if isinstance(value, str) else millimetres(value)


def millimetres(value: float) -> str:
    """A length in m as text in mm, six digits."""
    return f"{1e3 * value:.6g} mm"


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
            internal = RingMesh((a, b), mesh.distance, mesh.backlash)
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
        a, b = pair.gears
        fitting = millimetres(distance_of_shifts(a.m, a.alpha, a.beta, a.z + b.z, a.x + b.x))
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
