"""Can this gear, or this ring, be made? Every problem names a field of its table and what to write there.

Formulas: ISO 21771; undercut by form rolls. Nothing here stops at the first problem.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import accumulate

from gearfmu.geometry import GearGeometry, involute
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.ranges import kernel_limits
from gearfmu.stagefile.forms.general import GearBody, RingBody, ToothedBody
from gearfmu.stagefile.forms.shapes import GearShape, gear_shape

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
        pointed = _root(lambda radius: float(shape.thickness_angle(radius)), form, shape.r_a)
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


def _amounts(gear: ToothedBody, shape: GearShape) -> Found:
    """Lengths that a module bounds."""
    most = _LARGEST * shape.m
    given = {
        "tip_relief.amount": gear.tip_relief and gear.tip_relief.amount,
        "root_relief.amount": gear.root_relief and gear.root_relief.amount,
        "profile.slope": gear.profile and gear.profile.slope,
        "profile.crowning": gear.profile and gear.profile.crowning,
        "lead.slope": gear.lead and gear.lead.slope,
        "lead.crowning": gear.lead and gear.lead.crowning,
        "lead.end_relief.amount": gear.lead and gear.lead.end_relief and gear.lead.end_relief.amount,
        "eccentricity.amount": gear.eccentricity and gear.eccentricity.amount,
    }
    for field, value in given.items():
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


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a falling function passes zero between low and high, by bisection."""
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) > 0 else (low, middle)
    return low


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
