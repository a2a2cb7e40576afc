"""A spec as a person reads it: every quantity as text with its unit, in the units of the drawing office."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from gearfmu.quantities import quantity_text
from gearfmu.stagefile.reading.base import quantity_of


def shown(spec: BaseModel) -> dict[str, Any]:
    """The fields of a spec, quantities as text; parts that have names under them. What is not given is left out."""
    found = {}
    for name, field in type(spec).model_fields.items():
        value = getattr(spec, name)
        quantity = quantity_of(field)
        if value is not None:
            found[name] = _of(value, quantity.unit if quantity else "")
    return found


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
