"""A spec as a person reads it: every quantity as text with its unit, in the units of the drawing office."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from gearfmu.spec.base import Quantity, metadata_of

_IN = {"rad": ("deg", 180 / math.pi), "rad/s": ("rpm", 30 / math.pi)}
_SCALES = {"m": ((1e-4, "mm", 1e3), (0.0, "µm", 1e6)), "s": ((1.0, "s", 1.0), (1e-3, "ms", 1e3), (0.0, "µs", 1e6))}


def shown(spec: BaseModel) -> dict[str, Any]:
    """The fields of a spec, quantities as text; parts that have names under them. What is not given is left out."""
    found = {}
    for name, field in type(spec).model_fields.items():
        value = getattr(spec, name)
        quantity = next((part for part in metadata_of(field) if isinstance(part, Quantity)), None)
        if value is not None:
            found[name] = _of(value, quantity.unit if quantity else "")
    return found


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


def _of(value: Any, unit: str) -> Any:
    if isinstance(value, BaseModel):
        return shown(value)
    if isinstance(value, Mapping):
        return {str(key): _of(item, unit) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        if value and all(isinstance(item, BaseModel) and hasattr(item, "name") for item in value):
            return {item.name: _of(item, unit) for item in value}
        return [_of(item, unit) for item in value]
    if unit and isinstance(value, float):
        return quantity_text(value, unit)
    return value
