"""Single fields of a file, changed before it is checked: `{"test_rig.torque": "200 N*m"}`.

A changed file goes the way of every file: all its problems are found, and named by the field. A value is what the file
would say, the SI number of a quantity, or None for a field or table that is to be left out.
"""

from __future__ import annotations

import types
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
from pydantic import AliasChoices
from pydantic.fields import FieldInfo

from gearfmu.spec.reading.base import Quantity, Spec

Changes = Mapping[str, Any]


def changed_tables(kind: type[Spec], changes: Changes) -> dict[str, Any]:
    """The changes as nested tables of a file of class `kind`; SI numbers of quantities are written with their unit."""
    tables: dict[str, Any] = {}
    for key, value in changes.items():
        *folders, last = key.split(".")
        table = tables
        for name in folders:
            table = table.setdefault(name, {})
        table[last] = _written(kind, key, value)
    return tables


def _written(kind: type[Spec], key: str, value: Any) -> Any:
    """`value` as a file would say it: numpy values as Python's, a number of a quantity with its SI unit."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_written(kind, f"{key}.{i}", item) for i, item in enumerate(value)]
    quantity, plain = quantity_at(kind, key), value.item() if isinstance(value, np.generic) else value
    number = isinstance(plain, (int, float)) and not isinstance(plain, bool)
    if quantity is None or not number:
        return int(plain) if isinstance(plain, float) and plain.is_integer() else plain  # counts of a range: 1.0, 2.0
    return f"{plain!r} {quantity.unit}" if quantity.unit else float(plain)


def quantity_at(kind: Any, key: str) -> Quantity | None:
    """The Quantity of the field that a dotted key names in files of class `kind`; None where there is no such field,
    or one that is no quantity."""
    return _found(kind, key.split("."))


def _found(kind: Any, keys: Sequence[str]) -> Quantity | None:
    if isinstance(kind, type) and issubclass(kind, Spec):
        fields = ((name, field) for name, field in kind.model_fields.items() if keys and keys[0] in _names(name, field))
        return next((_own(f.metadata, keys[1:]) or _found(f.annotation, keys[1:]) for _, f in fields), None)
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _own(inner[1:], keys) or _found(inner[0], keys)
    if origin in (Union, types.UnionType):
        return next((found for one in inner if (found := _found(one, keys)) is not None), None)
    if origin in (dict, tuple) and keys:  # tables by name: of a pair's file its gears too, which are a tuple here
        return _found(inner[-1], keys[1:])
    return None


def _own(metadata: Sequence[Any], keys: Sequence[str]) -> Quantity | None:
    return None if keys else next((item for item in metadata if isinstance(item, Quantity)), None)


def _names(name: str, field: FieldInfo) -> set[str]:
    """What a field may be called in a file."""
    alias = field.validation_alias
    others = alias.choices if isinstance(alias, AliasChoices) else [alias]
    return {name, *(str(other) for other in others if other is not None)}
