"""Can these gears be made, run together and carry the torque? Every problem names a field and what to write there.

Formulas: ISO 21771; undercut and interference by form rolls. Nothing here stops at the first problem.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from gearfmu.errors import Problem
from gearfmu.geometry import GearGeometry, PairGeometry, involute
from gearfmu.geometry.gear import ReferenceGear
from gearfmu.geometry.hertz import common_width, contact_modulus, half_width, largest_relative_radius
from gearfmu.stagefile.forms.flank_checks import flank_problems
from gearfmu.stagefile.forms.shapes import gear_geometry
from gearfmu.stagefile.tables.flanks import TOOTHING
from gearfmu.stagefile.tables.gear import GearSpec, PairSpec

STRIP_PER_HERTZ = 1.5  # the local law needs w > 1.12 b; at 1.5 b its tangent still has a margin
_LARGEST_ALLOWANCE = 0.1  # of the module: more is a wrong centre distance or profile shift
_LARGEST_THICKENING = 0.005  # of the module
_RIM_PER_TOOTH_HEIGHT = 0.5  # thinner rims are outside the rim thickness factor of ISO 6336-3

Found = Iterator[tuple[str, float | str, str]]


def geometry_problems(file: str, pair: PairSpec, gears: Sequence[GearSpec], torque_max: float | None) -> list[Problem]:
    """Everything that is wrong with pair and gears; without `torque_max` (N·m) the load strip is not judged."""
    shapes = [gear_geometry(gear, pair, hand) for gear, hand in zip(gears, (1, -1), strict=True)]
    found = [
        (f"gears.{gear.name}.{field}", value, remedy)
        for gear, shape in zip(gears, shapes, strict=True)
        for field, value, remedy in gear_problems(gear, shape)
    ]
    sound = not any(_shapes_flanks(field) for field, *_ in found)
    if pair.center_distance <= shapes[0].r_b + shapes[1].r_b:
        least = millimetres(shapes[0].r_b + shapes[1].r_b)
        found.append(
            (
                "pair.center_distance",
                pair.center_distance,
                f"smaller than the sum of the base radii, {least}: check it against module and teeth",
            )
        )
    elif sound:
        geometry = PairGeometry((shapes[0], shapes[1]), pair.center_distance, pair.backlash)
        found += _pair(pair, gears, geometry)
        found += _strips(gears, geometry, torque_max)
    return [
        Problem(file, field, value if isinstance(value, str) else millimetres(value), remedy)
        for field, value, remedy in found
    ]


def _shapes_flanks(field: str) -> bool:
    """Do checks of the mesh depend on this field of a gear?"""
    name = field.split(".")[2]
    return name not in TOOTHING and name not in ("bore_diameter", "import")


def gear_problems(gear: GearSpec, shape: GearGeometry) -> Found:
    """One gear by itself, from the rack outwards; later checks need earlier ones."""
    rack = _rack_problems(gear, shape)
    yield from rack
    yield from _rim_problems(gear, shape)
    yield from import_problems(gear, shape)
    tip = [] if rack else list(_tip_problems(gear, shape))
    yield from tip
    if not rack and not tip:
        yield from flank_problems(gear, shape)


def _rack_problems(gear: GearSpec, shape: GearGeometry) -> list[tuple[str, float | str, str]]:
    """The rack is judged in the normal section, undercut in the transverse one (ISO 21771)."""
    tan, sin, cos = math.tan(shape.alpha), math.sin(shape.alpha), math.cos(shape.alpha)
    found: list[tuple[str, float | str, str]] = []
    largest = min((math.pi / 4 - gear.rack.dedendum * tan) * cos / (1 - sin), gear.rack.dedendum)
    if gear.rack.fillet_radius > largest:
        found.append(
            (
                "rack.fillet_radius",
                f"{gear.rack.fillet_radius:g}",
                f"does not fit the rack's tip: at most {rounded_down(largest):g} for this dedendum",
            )
        )
    elif gear.profile_shift < (least := _least_shift(gear, shape)) - 0.5 * shape.shift_per_tooth:
        found.append(
            (
                "profile_shift",
                f"{gear.profile_shift:g}",
                f"the rack undercuts the flank: at least {rounded_up(least):g}, or more teeth",
            )
        )
    return found


def _least_shift(gear: GearSpec, shape: GearGeometry) -> float:
    """Profile shift without undercut by the rack's addendum.

    The tool's flank may end deeper; it cuts there only into flank that no mating rack reaches, and the tooth is
    modelled as it is cut. The limiting number of teeth is a whole one, as in tables (17 for 20 degrees): the shift of
    half a tooth is no undercut.
    """
    straight = (shape.h_fp - shape.rho_fp * (1 - math.sin(shape.alpha))) / shape.m
    return shape.least_shift(min(gear.rack.addendum, straight))


def _rim_problems(gear: GearSpec, shape: GearGeometry) -> Found:
    least_rim = _RIM_PER_TOOTH_HEIGHT * (shape.r_a - shape.r_f)
    largest = 2 * (shape.r_f - least_rim)
    if gear.bore_diameter > largest:
        yield (
            "bore_diameter",
            gear.bore_diameter,
            f"leaves a rim thinner than half the tooth height: {at_most(largest)}",
        )


def import_problems(gear: Any, shape: ReferenceGear) -> Found:
    """Finite elements made elsewhere, of a gear or a ring."""
    if gear.imported is not None and shape.beta:
        remedy = (
            "finite elements made elsewhere are read for spur gears only: set the helix angle to 0 deg or leave the "
        )
        yield "import", gear.imported.file, remedy + "table away and let the gear be meshed here"


def _tip_problems(gear: GearSpec, shape: GearGeometry) -> Found:
    rack_tip = shape.r + (gear.rack.addendum + gear.profile_shift) * shape.m
    form = float(involute.radius_at_roll(shape.s_form, shape.r_b))
    if shape.r_a > rack_tip * (1 + 1e-9):
        yield (
            "tip_diameter",
            gear.tip_diameter,
            "larger than the basic rack makes, d + 2 m_n (x + addendum): at most "
            f"{millimetres(rounded_down(2 * rack_tip))}",
        )
    if shape.r_a - shape.tip_edge <= form:
        yield (
            "tip_diameter",
            gear.tip_diameter,
            f"no involute is left above the form circle: more than {millimetres(2 * (form + shape.tip_edge))}",
        )
    elif shape.tip_half_angle <= 0:
        largest = _root(lambda radius: float(shape.thickness_angle(radius)), form, shape.r_a)
        yield (
            "tip_diameter",
            gear.tip_diameter,
            f"the tooth is pointed (tip thickness ≤ 0): less than {millimetres(rounded_down(2 * largest))}",
        )
    elif shape.tip_land_half_angle < 0:
        yield (
            "tip_edge_radius",
            gear.tip_edge_radius,
            f"the two roundings overlap on a tip of {millimetres(2 * shape.r_a * shape.tip_half_angle)}: make it "
            "smaller",
        )


def _pair(pair: PairSpec, gears: Sequence[GearSpec], geometry: PairGeometry) -> Found:
    for index in (0, 1):
        yield from _interference(gears, geometry, index)
    if geometry.contact_ratio < 1:
        remedy = (
            f"the contact ratio is {geometry.contact_ratio:.3f}, below 1: larger tip diameters or smaller tip edges"
        )
        yield "pair.center_distance", pair.center_distance, remedy
    allowance, module = pair.backlash - geometry.nominal_backlash, pair.normal_module
    facts = f"profile shifts and centre distance give j_wt = {_um(geometry.nominal_backlash)}"
    if allowance < -_LARGEST_THICKENING * module:
        yield (
            "pair.backlash",
            pair.backlash,
            f"{facts}, more than declared: declare that, or correct centre distance or profile shifts",
        )
    elif allowance > _LARGEST_ALLOWANCE * module:
        fitting = millimetres(geometry.zero_backlash_center_distance)
        remedy = f"{facts}, none at {fitting}; to thin the teeth by {_um(allowance)} is no tolerance: correct it"
        yield "pair.center_distance", pair.center_distance, remedy


def _interference(gears: Sequence[GearSpec], geometry: PairGeometry, index: int) -> Found:
    """Tip of gear `index` in the root of the other."""
    tip, root = geometry.gears[index], geometry.gears[1 - index]
    name, other = gears[index].name, gears[1 - index].name
    field, value = f"gears.{name}.tip_diameter", gears[index].tip_diameter
    if geometry.a - tip.r_a - root.r_f <= 0:
        yield (
            field,
            value,
            f"the tip touches the root circle of {other}: less than "
            f"{millimetres(rounded_down(2 * (geometry.a - root.r_f)))}",
        )
    elif geometry.opposite(tip.s_a) < root.s_form:
        largest = 2 * float(involute.radius_at_roll(max(geometry.opposite(root.s_form), 0.0), tip.r_b))
        yield (
            field,
            value,
            f"interference: the tip meets {other} below its form circle: {at_most(largest)}",
        )


def _strips(gears: Sequence[GearSpec], geometry: PairGeometry, torque_max: float | None) -> Found:
    least = STRIP_PER_HERTZ * largest_half_width(gears, geometry, torque_max) if torque_max else 0.0
    for gear, shape in zip(gears, geometry.gears, strict=True):
        width = gear.body.strip_half_width
        flank = float(involute.arc_length(shape.s_tip, shape.r_b) - involute.arc_length(shape.s_form, shape.r_b))
        field = f"gears.{gear.name}.body.strip_half_width"
        if width < least:
            yield (
                field,
                width,
                "too narrow for the contact at torque_max: at least 1.5 Hertz half-widths, "
                f"{millimetres(rounded_up(least, 3))}",
            )
        elif 2 * width > flank:
            yield field, width, f"the load patch is longer than the flank: {at_most(flank / 2)}"


def largest_half_width(gears: Sequence[GearSpec], geometry: PairGeometry, torque: float) -> float:
    """Largest Hertz half-width b (m) along the path of contact.

    One tooth pair carries the whole pinion torque (N·m) over the common face width. Of helical flanks the normal force
    and the length of its line of contact both grow by 1/cos β_b, the radius of curvature normal to it too.
    """
    load = torque / geometry.gears[0].r_b / common_width(gears)
    a, b = (gear.material for gear in gears)
    e_star = contact_modulus((a.youngs_modulus, b.youngs_modulus), (a.poisson_ratio, b.poisson_ratio))
    path = geometry.path
    radius = largest_relative_radius(geometry.length, path["A"], path["E"])
    return half_width(load, radius / math.cos(geometry.gears[0].beta_b), e_star)


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


def millimetres(value: float) -> str:
    """A length in m as text in mm, six digits."""
    return f"{1e3 * value:.6g} mm"


def _um(value: float) -> str:
    return f"{1e6 * value:.3g} µm"
