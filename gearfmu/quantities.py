"""Numbers at the border: text such as "600 N*m" to SI floats and back, and the range of every number.

Only readers of stage and scene files and the command line deal with text; all behind them is SI. Every number that a
file or an option may hold has a range with a remedy. A range that the kernel checks too is read from the kernel's
header (gk_ranges.h), the others are here alone. Ranges are plausible, not good, values: a number beyond them is a wrong
unit or a slip of the pen."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from gearfmu.errors import Problem, SpecError, UnitError

if TYPE_CHECKING:
    import pint

NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$")
_UNIT_TEXT = re.compile(r"[A-Za-zµμ°%][A-Za-z0-9µμ°%*/^ ()_-]{0,39}$")
_SPELLINGS = str.maketrans({"·": "*", "⋅": "*", "²": "^2", "³": "^3", "μ": "µ"})
_PRODUCT_DOT = re.compile(r"(?<=[A-Za-z0-9])\.(?=[A-Za-z])")  # "N.m", as FMI writes it
_NEWTON_METRE = re.compile(r"\b([kM]?)Nm\b")
_IN = {"rad": ("deg", 180 / math.pi), "rad/s": ("rpm", 30 / math.pi), "m^3": ("cm^3", 1e6)}
_USUAL_UNIT = {"rad": "deg", "rad/s": "rpm", "m": "mm"}  # in which people write a quantity
_USUAL = {  # what stage files say most: without pint, which takes a second to load
    ("mm", "m"): 1e-3,
    ("µm", "m"): 1e-6,
    ("um", "m"): 1e-6,
    ("ms", "s"): 1e-3,
    ("us", "s"): 1e-6,
    ("deg", "rad"): 0.017453292519943295,
    ("rpm", "rad/s"): 0.10471975511965977,
    ("kHz", "Hz"): 1e3,
    ("GPa", "Pa"): 1e9,
}
_REVOLUTIONS = ("U/min", "1/min", "min^-1")  # as name plates have them; the unit library takes them for others
_SCALES = {"m": ((1e-4, "mm", 1e3), (0.0, "µm", 1e6)), "s": ((1.0, "s", 1.0), (1e-3, "ms", 1e3), (0.0, "µs", 1e6))}


def to_si(text: object, unit: str) -> float:
    """The SI value of `text` ("0.1 mm"), which must have the dimension of the SI unit `unit` ("m").

    Angles count: "50 Hz" is no angular speed and "N*m" no torsional stiffness ("N*m/rad"). The result is rounded to
    15 significant digits, so that "82.46 mm" and "0.08246 m" are the same number. An empty `unit` means a plain
    number. Raises UnitError with the remedy.
    """
    if isinstance(text, bool) or not isinstance(text, (str, int, float)):
        raise UnitError(f'expected a quantity such as "1 {usual_unit(unit)}"')
    if not isinstance(text, str):
        if not math.isfinite(text):
            raise UnitError(f'not a finite number: write it like "1.5 {usual_unit(unit)}"')
        raise UnitError(f'the unit is missing: write "{text:g} {usual_unit(unit)}" or another unit of the same kind')
    match = NUMBER.match(text)
    if not match:
        raise UnitError(f'not a number with a unit: write it like "1.5 {usual_unit(unit)}"')
    number, unit_text = float(match[1]), _plain_unit(match[2])
    if not unit_text and unit:
        raise UnitError(f'the unit is missing: write "{match[1]} {usual_unit(unit)}" or another unit of the same kind')
    value = number * _factor(unit_text, unit)
    if not math.isfinite(value):
        raise UnitError("the value is not finite")
    return float(f"{value:.15g}")


def usual_unit(unit: str) -> str:
    """The unit in which people write a quantity of this SI unit: mm, deg, rpm; else the SI unit itself."""
    return _USUAL_UNIT.get(unit, unit)


def _examples(unit: str) -> str:
    return " or ".join(dict.fromkeys((f'"{usual_unit(unit)}"', f'"{unit}"')))


def quantity_text(value: float, unit: str) -> str:
    """An SI number of this unit as text: lengths in mm or µm, times in s, ms or µs, angles in degrees, speeds in
    rpm."""
    if unit in _SCALES:
        scales = _SCALES[unit]
        _, unit, factor = next((scale for scale in scales if abs(value) >= scale[0]), scales[0]) if value else scales[0]
        value *= factor
    elif unit in _IN:
        unit, factor = _IN[unit]
        value *= factor
    return f"{value:.6g} {unit}".rstrip()


def _plain_unit(text: str) -> str:
    if text in _REVOLUTIONS:
        return "rpm"
    return _NEWTON_METRE.sub(r"\1N*m", _PRODUCT_DOT.sub("*", text.translate(_SPELLINGS)))


@lru_cache(maxsize=512)
def _factor(unit_text: str, unit: str) -> float:
    """How many `unit` one `unit_text` is."""
    if unit_text == unit:
        return 1.0
    if (unit_text, unit) in _USUAL:
        return _USUAL[unit_text, unit]
    return _factor_by_pint(unit_text, unit)


def _factor_by_pint(unit_text: str, unit: str) -> float:
    if not _UNIT_TEXT.match(unit_text):
        raise UnitError(f'"{unit_text}" is no unit: use one like {_examples(unit)}')
    registry = _registry()
    try:
        given = registry.Quantity(1.0, registry.parse_units(unit_text)).to_root_units()
    except Exception as error:  # pint raises its own, tokenize's and arithmetic errors for odd text
        raise UnitError(f'unknown unit "{unit_text}": use one like {_examples(unit)}') from error
    wanted = registry.Quantity(1.0, registry.parse_units(unit)).to_root_units()
    if given.units != wanted.units:
        raise UnitError(f'"{unit_text}" is a unit of another kind: use one like {_examples(unit)}')
    return float(given.magnitude / wanted.magnitude)


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry:
    import pint

    return pint.UnitRegistry(cache_folder=None)


HEADER = Path(__file__).parent / "kernel" / "src" / "model" / "gk_ranges.h"
_ROW = re.compile(r"^#define GK_(\w+) (\S+)", re.MULTILINE)
_ROUNDING = 1e-12  # relative: a limit in degrees or millimetres is not exact in SI
_DEGREE = math.pi / 180


@dataclass(frozen=True)
class Range:
    """Numbers from `low` to `high`, both allowed, in SI units of `unit`. remedy: an example or what to look at; kernel:
    name of the row of gk_ranges.h that the limits were read from, empty where they are Python's own."""

    unit: str
    low: float
    high: float
    remedy: str = ""
    kernel: str = ""

    def __contains__(self, value: float) -> bool:
        """Whether a finite number is in the range."""
        return self.low - _ROUNDING * abs(self.low) <= value <= self.high + _ROUNDING * abs(self.high)

    def refusal(self, value: float) -> str:
        """Why a number is refused and what to write; empty where it is in the range."""
        if value in self:
            return ""
        what = "out of range" if math.isfinite(value) else "not a finite number"
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{what}: must be from {self.shown(self.low)} to {self.shown(self.high)}{remedy}"

    def shown(self, value: float) -> str:
        """The number with its unit, as a person writes it."""
        return quantity_text(value, self.unit)


def range_problems(values: Mapping[str, tuple[float | None, Range]]) -> list[Problem]:
    """Every number (SI) outside its range, by the name of its field or option; None is no number."""
    return [
        Problem("", field, own.shown(value), refusal)
        for field, (value, own) in values.items()
        if value is not None and (refusal := own.refusal(value))
    ]


def in_range(field: str, value: float, name: str) -> float:
    """The number (SI) of a field or option; SpecError where it is not in the range of that name."""
    if problems := range_problems({field: (value, range_of(name))}):
        raise SpecError(problems)
    return value


@cache
def kernel_limits() -> dict[str, tuple[float, float]]:
    """(lowest, highest) of every row of the kernel's header by its name, SI."""
    names = [name.removeprefix("LOW_") for name in _header() if name.startswith("LOW_")]
    return {name: (kernel_number(f"LOW_{name}"), kernel_number(f"HIGH_{name}")) for name in names}


def kernel_number(name: str) -> float:
    """A number of the kernel's header."""
    return float(_header()[name])


@cache
def _header() -> dict[str, str]:
    return dict(_ROW.findall(HEADER.read_text(encoding="utf-8")))


def range_of(name: str) -> Range:
    """The range of that name. KeyError where there is none: a number of the spec without a range is our mistake."""
    return all_ranges()[name]


@cache
def all_ranges() -> dict[str, Range]:
    """Every range by its name."""
    own = {name: Range(unit, low, high, remedy) for name, (unit, low, high, remedy) in _OWN.items()}
    return own | dict(_of_kernel())


def _of_kernel() -> Iterator[tuple[str, Range]]:
    for name, (row, unit, remedy) in _KERNEL.items():
        low, high = kernel_limits()[row]
        yield name, Range(unit, low, high, remedy, row)
    for name, (row, unit, low, factor, remedy) in _TO_KERNEL.items():
        yield name, Range(unit, low, factor * kernel_limits()[row][1], remedy)


# name: (row of gk_ranges.h, unit, remedy)
_KERNEL: dict[str, tuple[str, str, str]] = {
    "slices": ("SLICES", "", "5 are enough for most spur gears, 7 for helical ones"),
    "nodes": ("NODES", "", "leave it away: those of the gear's own mesh are taken"),
    "face_width": ("FACE_WIDTH", "m", "check the unit"),
    "strip_half_width": ("STRIP", "m", "1.5 Hertz half-widths at torque_max, some tenths of a millimetre"),
    "place": ("PLACE", "m", "check the unit"),
    "axis": ("AXIS", "m", "check the unit"),
    "modal_damping": ("DAMPING_RATIO", "", "a ratio, not per cent: of steel gears about 0.01"),
    "backlash_parameter": ("BACKLASH", "m", "some hundredths of the module; negative: teeth that are jammed"),
    "contact_damping": ("CONTACT_DAMPING", "N*s/m^2", "per metre of face width, about 5e4 N*s/m^2 for steel gears"),
    "penalty": ("PENALTY", "N/m^3", 'leave it away or write "hertz": the contact is as wide as that of Hertz'),
    "friction_coefficient": ("FRICTION", "", "of oiled teeth about 0.05"),
    "oil_viscosity": ("VISCOSITY", "Pa*s", "dynamic viscosity; warm gear oil has about 0.03 Pa*s"),
    "flank_roughness": ("ROUGHNESS", "m", "Ra of ground flanks is about 0.4 um"),
    "film_roughness": ("FILM_ROUGHNESS", "m", "about 1 um"),
    "torsional_stiffness": ("PORT_STIFFNESS", "N*m/rad", "a shaft of 30 mm has some 1e4 N*m/rad"),
    "torsional_damping": ("PORT_DAMPING", "N*m*s/rad", "some hundredths of critical, about 1 N*m*s/rad"),
    "inertia": ("INERTIA", "kg*m^2", "check the unit"),
    "torque": ("TORQUE", "N*m", "check the unit"),
    "clutch_capacity": ("CAPACITY", "N*m", "check the unit and the sign"),
    "speed": ("SPEED", "rad/s", "check the unit"),
    "cut": ("CUT", "Hz", "80 kHz and 120 kHz suit gears of 100 mm"),
    "internal_step": ("STEP", "s", "0 s takes the step that suits model and level"),
}
# name: (row of gk_ranges.h that the number shapes, unit, lowest, factor on the row's highest, remedy)
_TO_KERNEL: dict[str, tuple[str, str, float, float, str]] = {
    "planets": ("ENGAGEMENTS", "", 2, 0.5, "the kernel holds 12 meshes, two for each planet: use fewer planets"),
    "pin": ("ENGAGEMENTS", "", 0, 0.5, "the bolts are numbered from 0"),
    "tip_diameter": ("BASE_RADIUS", "m", 2e-4, 2, "check the unit"),
    "tip_edge_radius": ("TIP_EDGE", "m", 0, 1, "about a twentieth of the module"),
    "backlash": ("BACKLASH", "m", 0, 1, "some hundredths of the module"),
    "eccentricity": ("RUNOUT", "m", 0, 1, "some hundredths of a millimetre"),
    "tooth_number": ("TEETH", "", 0, 1, "teeth are numbered from 0"),
}
_CHECK = "check the unit"
# name: (unit, lowest, highest, remedy)
_OWN: dict[str, tuple[str, float, float, str]] = {
    # gears
    "teeth": ("", 6, 400, "the number of teeth of one gear"),
    "ring_teeth": ("", 12, 600, "the number of teeth of the ring"),
    "module": ("m", 5e-5, 0.05, "tooth pitch over pi, such as 4.5 mm"),
    "pressure_angle": ("rad", 10 * _DEGREE, 35 * _DEGREE, "the usual basic rack has 20 deg"),
    "helix_angle": (
        "rad",
        -35 * _DEGREE,
        35 * _DEGREE,
        "write the helix angle at the reference circle, positive for a right-handed pinion or sun (its mate then is "
        "left-handed), 0 deg for spur gears",
    ),
    "profile_shift": ("", -3, 3, "a factor of the module, not a length"),
    "center_distance": ("m", 1e-4, 20, _CHECK),
    "diameter": ("m", 1e-6, 100, _CHECK),
    "bore": ("m", 0, 40, "0 mm for a solid shaft"),
    "length": ("m", 1e-6, 40, _CHECK),
    "rack_factor": ("", 0.01, 5, "a factor of the module, not a length: addendum 1, dedendum 1.25, fillet 0.38"),
    "flank_depth": ("m", 0, 2e-3, "reliefs and crownings are some hundredths of a millimetre"),
    "relief": ("m", 1e-9, 2e-3, "a relief is some hundredths of a millimetre; leave the table away for none"),
    "flank_slope": ("m", -2e-3, 2e-3, "slopes are some hundredths of a millimetre"),
    "misalignment": ("m", -0.1, 0.1, "some hundredths of a millimetre over the span"),
    "roll": ("m", 1e-6, 20, "a length of roll on the flank; leave it away for the point of single contact"),
    "pitch_deviation": ("m", -2.5e-3, 2.5e-3, "pitch deviations are some hundredths of a millimetre"),
    "angle": ("rad", -1e4, 1e4, _CHECK),
    "play": ("rad", 0, 1, "of splines some tenths of a degree; leave it away for none"),
    "wobble": ("rad", 0, 5e-3, "of the order of 0.1 mrad"),
    "tolerance_class": ("", 1, 11, "classes of ISO 1328-1"),
    "seed": ("", 0, 2**31 - 1, "any whole number, 1 for a start"),
    "share": ("", 1e-6, 1, "a share, not per cent"),
    "youngs_modulus": ("Pa", 1e6, 1e13, "steel has 206 GPa, plastics 1 to 5 GPa"),
    "poisson_ratio": ("", 0, 0.49, "steel has 0.3"),
    "density": ("kg/m^3", 100, 30e3, "steel has 7850 kg/m^3, plastics about 1200 kg/m^3"),
    # what holds bodies
    "bearing_stiffness": ("N/m", 1e4, 1e16, "rolling bearings have 1e7 to 1e9 N/m, a floating sun about 1e6 N/m"),
    "axial_stiffness": ("N/m", 1, 1e16, "rolling bearings have about 1e8 N/m"),
    "tilt_stiffness": ("N*m/rad", 1e-6, 1e16, "rolling bearings have about 5e4 N*m/rad"),
    "mount_stiffness": ("N/m", 1e4, 1e12, "of one mount, about 1e8 N/m"),
    "mounts": ("", 3, 60, "equally spaced round the rim"),
    "damping_ratio": ("", 0, 1, "a ratio, not per cent: about 0.03"),
    # rolling bearings
    "rolling_elements": ("", 3, 300, "the number of balls or rollers of one row"),
    "groove": ("", 0.505, 0.6, "radius of the groove over the diameter of the balls, about 0.52"),
    "contact_angle": ("rad", 0, 60 * _DEGREE, "0 deg: deep groove; angular contact bearings have 15 deg to 40 deg"),
    "bearing_clearance": ("m", -2e-4, 1e-3, "of bearings of 50 mm about 10 um in operation; negative: interference"),
    "preload": ("N", 0, 1e6, "of bearings of 50 mm some hundreds of N"),
    # sets
    "position": ("", 0, 2000, "steps of 360 deg/(z_sun + z_ring), the first 0"),
    "load_sharing": ("", 1, 4, "mesh load factor of ISO 6336-1"),
    "bolt_place": ("", -1, 1, "in turns from +x"),
    "pin_error": ("m", -1e-3, 1e-3, "some hundredths of a millimetre"),
    # limits of what a model is made for
    "torque_max": ("N*m", 1e-6, 1e9, "the largest torque the stage carries"),
    "speed_max": ("rad/s", 1e-3, 1e5, "the fastest the stage turns"),
    "mesh_torque_max": ("N*m", 1e-10, 1e12, "the largest torque on gear A"),
    "mesh_speed_max": ("rad/s", 1e-5, 1e8, "the fastest gear A turns"),
    # finite elements and reduction
    "label": ("", 1, 2**31 - 1, "the number of a point in the mesh file"),
    "elements": ("", 1, 200, "element counts of the shipped stages are 4 to 20"),
    "elements_two": ("", 2, 200, "element counts of the shipped stages are 4 to 20"),
    "scale": ("", 0.01, 8, "a factor on all element counts, 1 for none"),
    "grading": ("", 0.2, 5, "growth from element to element, 1 for none"),
    "rim_grading": ("", 1.05, 5, "growth from element to element, about 1.5"),
    "modes": ("", 1, 2000, "shipped stages store 400"),
    "carrier_modes": ("", 24, 2000, "shipped stages store 120"),
    "roll_points": ("", 4, 200, "shipped stages have 28"),
    "width_functions": ("", 1, 12, "shipped stages have 5"),
    "stored_to": ("Hz", 1, 1e9, "150 kHz suit shafts of 100 mm"),
    "length_unit": ("m", 1e-9, 1e3, '"1 mm" for a mesh in millimetres'),
    "force_unit": ("N", 1e-12, 1e12, '"1 N" for matrices in newtons'),
    "mass_unit": ("kg", 1e-12, 1e12, '"1 t" with millimetres, newtons and seconds'),
    "flank_tolerance": ("m", 1e-9, 1e-2, "some micrometres"),
    # scenes and runs
    "duration": ("s", 1e-9, 1e5, _CHECK),
    "time": ("s", 0, 1e5, _CHECK),
    "step": ("s", 1e-9, 1e3, "20 us for spectra, 100 us for motion"),
    "micro_step": ("s", 0, 1e3, "0 s takes the communication step"),
    "frequency": ("Hz", 1e-6, 1e9, _CHECK),
    "amplitude": ("N*m", 0, 1e9, _CHECK),
    "control_damping": ("N*m*s/rad", 1e-12, 1e12, "torque per deviation of the speed"),
    "peak": ("", 1, 1e3, "a dry clutch holds 1 to 1.3 times the torque that it transmits when it slips"),
    "gear_ratio": ("", 1e-4, 1e4, "speed in over speed out"),
    "wheel_radius": ("m", 1e-3, 10, "a passenger car's is about 0.3 m"),
    "tyre_stiffness": ("N", 1e-9, 1e12, "a passenger car's is about 1e5 N"),
    "vehicle_mass": ("kg", 1e-3, 1e7, "a passenger car has about 1400 kg"),
    "drag_area": ("m^2", 0, 1e3, "a passenger car's is about 0.65 m^2"),
    "rolling_resistance": ("", 0, 1, "a ratio, not per cent: about 0.012"),
    "air_density": ("kg/m^3", 0, 1e3, "at sea level 1.225 kg/m^3"),
    "gravity": ("m/s^2", 0, 1e3, "on earth 9.80665 m/s^2"),
}
