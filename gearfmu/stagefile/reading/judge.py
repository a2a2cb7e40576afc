"""What a file means that cannot be read: what is wrong is put right where that is plain, so that the rest can be judged
beside it."""

from __future__ import annotations

import copy
import difflib
from typing import Any, Literal, get_args, get_origin

from pydantic import ValidationError

from gearfmu.errors import UnitError
from gearfmu.quantities import to_si
from gearfmu.stagefile.reading.base import FROM_FILE, Quantity, SpecType, fields_at, quantity_of, raw_path
from gearfmu.stagefile.reading.files import value_at

_ROUNDS = 4  # a key put right may bring further ones to light
_BESIDE_TEETH = ("kg/m^3", "N/m", "N*m/rad", "N*m*s/rad", "N*s/m^2", "kg*m^2", "Hz", "rad/s")  # shape no tooth


def as_meant(kind: type[SpecType], raw: dict[str, Any]) -> SpecType | None:
    """The object without keys that nobody knows (a misspelt one under its name), with bare numbers in SI, with numbers
    that shape no tooth within their range, with the first of the words that are allowed, without optional fields and
    tables that cannot be read; None where a field that must be there cannot."""
    tables = copy.deepcopy(raw)
    for _ in range(_ROUNDS):
        try:
            return kind.model_validate(tables, context=FROM_FILE)
        except ValidationError as error:
            entries = error.errors(include_url=False)
        misspelt = [entry for entry in entries if entry["type"] == "extra_forbidden"]
        change = _rename if misspelt else _put_right
        if not all([change(kind, tables, entry) for entry in misspelt or entries]):
            return None
    return None


def _rename(kind: type[SpecType], tables: dict[str, Any], entry: Any) -> bool:
    """Gives an unknown key the name that it nearly has, where nothing stands there; else takes it away."""
    loc = entry["loc"]
    *way, key = raw_path(tables, loc)
    inside = value_at(tables, way)
    if not isinstance(inside, dict) or key not in inside:
        return False
    value = inside.pop(key)
    free = [name for name in fields_at(kind, loc[:-1]) if name not in inside]
    near = difflib.get_close_matches(str(key), [str(name) for name in free], n=1, cutoff=0.5)
    if near:
        inside[near[0]] = value
    return True


def _put_right(kind: type[SpecType], tables: dict[str, Any], entry: Any) -> bool:
    loc = entry["loc"]
    if not loc or entry["type"] == "missing":
        return False
    *way, key = raw_path(tables, loc)
    inside, field = value_at(tables, way), fields_at(kind, loc[:-1]).get(loc[-1])
    if not isinstance(inside, dict) or key not in inside or field is None:
        return False
    quantity = quantity_of(field)
    value = inside[key]
    if quantity is not None and quantity.unit and isinstance(value, (int, float)) and not isinstance(value, bool):
        inside[key] = f"{value!r} {quantity.unit}"
        return True
    if get_origin(field.annotation) is Literal:
        inside[key] = get_args(field.annotation)[0]
        return True
    if quantity is not None and quantity.unit in _BESIDE_TEETH and (limit := _nearest(quantity, value)) is not None:
        inside[key] = f"{limit!r} {quantity.unit}"
        return True
    return _leave_out(kind, tables, loc)


def _nearest(quantity: Quantity, value: Any) -> float | None:
    """The limit that a number is beyond; None where it is no number."""
    try:
        number = to_si(value, quantity.unit)
    except UnitError:
        return None
    return quantity.range.low if number < quantity.range.low else quantity.range.high


def _leave_out(kind: type[SpecType], tables: dict[str, Any], loc: tuple[str | int, ...]) -> bool:
    """Takes away the field, or else the innermost table around it that need not be there."""
    for depth in range(len(loc), 0, -1):
        field, (*way, key) = fields_at(kind, loc[: depth - 1]).get(loc[depth - 1]), raw_path(tables, loc[:depth])
        inside = value_at(tables, way)
        if field is not None and not field.is_required() and isinstance(inside, dict) and key in inside:
            del inside[key]
            return True
    return False
