"""A stage as plain tables that need none of its files, and back: what an FMU holds of its stage."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.stagefile.forms.expand import expand
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.reading.base import Spec, validate
from gearfmu.stagefile.stage import stage_class
from gearfmu.stagefile.tables.imported import FILES

FREE = ("description", "ports")  # fields in which two exports of one stage may differ


def stored(spec: Spec) -> dict[str, Any]:
    """The fields of a stage, or of what is written in its file, for JSON, SI, without `source`; files by their names
    without folders."""
    tables = spec.model_dump(mode="json", exclude={"source"})
    for table, key, _ in _files(tables):
        table[key] = Path(table[key]).name
    return tables


def stored_files(spec: Spec) -> dict[str, str]:
    """SHA-256, hex, of every file that a stage names, by its field ("gears.0.topography"). SpecError for one that
    cannot be read."""
    found = {}
    for table, key, field in _files(spec.model_dump(mode="json", exclude={"source"})):
        try:
            found[field] = hashlib.sha256(Path(table[key]).read_bytes()).hexdigest()
        except OSError as error:
            remedy = f"cannot be read ({error.strerror}): write the path relative to the stage file"
            raise SpecError([Problem(str(getattr(spec, "source", "")), field, table[key], remedy)]) from error
    return found


def restored(tables: Mapping[str, Any], source: Path) -> Stage:
    """The stage of `stored` tables of what is written in its file. source : the file that held them, for messages.
    SpecError with everything that is wrong."""
    spec, problems = validate(stage_class(tables), {**tables, "source": source}, str(source), from_file=False)
    if spec is None:
        raise SpecError(problems)
    return expand(spec)


def differences(one: Stage, other: Stage) -> list[tuple[str, str, str]]:
    """(field, value, other value) of all differences of two stage files but for descriptions, ports and folders."""
    tables = (stored(stage.written) for stage in (one, other))
    first, second = ({key: value for key, value in own.items() if key not in FREE} for own in tables)
    return list(_differences(first, second, ""))


def _differences(one: Any, other: Any, field: str) -> Iterator[tuple[str, str, str]]:
    if isinstance(one, dict) and isinstance(other, dict):
        for key in [*one, *(key for key in other if key not in one)]:
            yield from _differences(one.get(key), other.get(key), f"{field}.{key}" if field else str(key))
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for k, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from _differences(a, b, f"{field}.{a['name'] if isinstance(a, dict) and 'name' in a else k}")
    elif one != other:
        yield field, _shown(one), _shown(other)


def _shown(value: Any) -> str:
    text = "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}…"


def _files(tables: Any, field: str = "") -> Iterator[tuple[dict[str, Any], str, str]]:
    """(table, key, field) of every name of a file."""
    for key, value in tables.items() if isinstance(tables, dict) else enumerate(tables):
        place = f"{field}.{key}" if field else str(key)
        if key in ("imported", "reduced") and isinstance(value, dict):
            yield from ((value, name, f"{place}.{name}") for name in FILES if value.get(name))
        elif key == "topography" and value:
            yield tables, "topography", place
        elif isinstance(value, (dict, list)):
            yield from _files(value, place)
