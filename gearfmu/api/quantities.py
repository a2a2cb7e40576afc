"""Quantities as arguments: "302 N*m", or the SI number."""

from __future__ import annotations

from typing import TypeAlias

from gearfmu.ranges import in_range, range_of
from gearfmu.units import to_si

Quantity: TypeAlias = str | float


def checked(field: str, value: Quantity, name: str) -> float:
    """`in_si` of a number in the range of that name; SpecError where it is not."""
    return in_range(field, in_si(value, range_of(name).unit), name)


def in_si(value: Quantity, unit: str) -> float:
    """A quantity with its unit, or the SI number, as SI number."""
    return to_si(value, unit) if isinstance(value, str) else float(value)
