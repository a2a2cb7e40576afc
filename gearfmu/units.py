"""Text such as "600 N*m" to SI floats. Only the TOML border and the command line call this; all behind it is SI."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import TYPE_CHECKING

from gearfmu.errors import UnitError

if TYPE_CHECKING:
    import pint

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$")
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
    match = _NUMBER.match(text)
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
