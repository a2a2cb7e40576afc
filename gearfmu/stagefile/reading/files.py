"""The files of stages and scenes: where they are, layers of them, and single fields that are changed.

A stage is the user's own file or one of the shipped library. A file with `base = "stage.toml"` takes from there what it
does not say itself. Changes, `{"test_rig.torque": "200 N*m"}`, are made before the file is checked, so that all its
problems are found and named by the field; a value is what the file would say, the SI number of a quantity, or None for
a field or table that is to be left out."""

from __future__ import annotations

import os
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
from pydantic import AliasChoices
from pydantic.fields import FieldInfo

from gearfmu.errors import Problem, SpecError, near_or_all
from gearfmu.stagefile.reading.base import Quantity, Spec, read_toml

_PACKAGE = Path(__file__).resolve().parents[2]


def library_roots() -> tuple[Path, ...]:
    """Existing folders of shipped models: in an installed package, then in a checkout."""
    candidates = (_PACKAGE / "reduced_models", _PACKAGE.parent / "reduced_models")
    return tuple(root for root in candidates if root.is_dir())


def _shipped_files() -> list[Path]:
    return [path for root in library_roots() for path in sorted(root.glob("*/stage*.toml"))]


def shipped_stages() -> list[str]:
    """Names that `find_stage` knows: "fzg_c", and "fzg_c/stage_relief" for further stage files of a folder."""
    return sorted({p.parent.name if p.name == "stage.toml" else f"{p.parent.name}/{p.stem}" for p in _shipped_files()})


def find_stage(name: str | os.PathLike[str]) -> Path:
    """The stage file meant by a path, a folder with a stage.toml, a shipped name ("fzg_c/stage_relief") or what a
    shipped file calls itself (`name = "fzg_c_relief"`); the first of these goes before the next.

    SpecError names the nearest shipped stages when there is none.
    """
    own = Path(name)
    for place in (own, *(root / own for root in library_roots() if not own.is_absolute())):
        for path in (place, place / "stage.toml", place.with_name(f"{place.name}.toml") if place.name else place):
            if path.is_file():
                return path
    if own.parent == Path(".") and (named := _shipped_of_name(str(name))) is not None:
        return named
    shipped = shipped_stages()
    hint = near_or_all(str(name), shipped, "give the path of a stage.toml, or one of:", cutoff=0.6)
    raise SpecError.of(name, "", "", f"there is no such stage: {hint}")


def _shipped_of_name(name: str) -> Path | None:
    """The shipped stage file that says `name = …` so."""
    return next((path for path in _shipped_files() if read_toml(path).get("name") == name), None)


def model_folder(stage: Any) -> Path:
    """The folder of a stage's file, which also holds its bodies, `<gear name>.h5`."""
    return Path(stage.source).parent


FILES = ("file", "stiffness", "mass", "unknowns", "recovery", "recovered", "surface")
_DEPTH = 8
MISSING = object()


@dataclass(frozen=True)
class Layers:
    """A file and its bases, nearest first; `tables` is what they say together."""

    files: tuple[tuple[Path, dict[str, Any]], ...]

    @property
    def path(self) -> Path:
        return self.files[0][0]

    @property
    def tables(self) -> dict[str, Any]:
        merged: dict[str, Any] = {}
        for _, raw in reversed(self.files):
            merged = merged_tables(merged, raw)
        return merged

    def changed(self, tables: dict[str, Any]) -> Layers:
        """The same file with what `tables` say instead, as if it stood there."""
        return Layers(((self.path, tables), *self.files)) if tables else self

    def attributed(self, problem: Problem) -> Problem:
        """The problem with the name of the file that holds the field, or of the nearest file when none does."""
        return replace(problem, file=str(self.holder(problem.field)))

    def holder(self, field: str) -> Path:
        """The nearest file that says something about a field ("gears.pinion.import.file"); `path` when none does."""
        keys = field.split(".")
        return next((path for path, raw in self.files if value_at(raw, keys) is not MISSING), self.path)

    def named(self, field: str, name: str) -> Path:
        """The file that a field names, as seen from here: its path is relative to the file that holds the field."""
        return self.holder(field).parent / name


def read_layers(path: Path) -> Layers:
    """The file at `path` and its bases, paths relative to the naming file; SpecError: one is missing, or a ring."""
    files: list[tuple[Path, dict[str, Any]]] = []
    current = path
    while True:
        raw = read_toml(current)
        base = raw.pop("base", None)
        files.append((current, raw))
        if base is None:
            return Layers(tuple(files))
        if not isinstance(base, str) or not base:
            raise SpecError.of(current, "base", base, 'expected the path of a file, e.g. base = "stage.toml"')
        following = current.parent / base
        if len(files) >= _DEPTH or any(following.resolve() == seen.resolve() for seen, _ in files):
            remedy = f"the bases form a ring or are more than {_DEPTH}: name the file that says it all"
            raise SpecError.of(current, "base", base, remedy)
        if not following.is_file():
            remedy = f"there is no file {following}: write the path relative to this file"
            raise SpecError.of(current, "base", base, remedy)
        current = following


def files_of(layers: Layers) -> list[tuple[str, str, Path]]:
    """Field, text and path of every file that a stage file names for its bodies."""
    found = ((field, table[key]) for table, key, field in named_files(layers.tables))
    return [(field, name, layers.named(field, name)) for field, name in found if isinstance(name, str)]


def named_files(tables: Any, field: str = "") -> Iterator[tuple[dict[str, Any], str, str]]:
    """(table, key, field) of every name of a file in the tables of a stage, as its file has them or as they are
    dumped."""
    for key, value in tables.items() if isinstance(tables, dict) else enumerate(tables):
        place = f"{field}.{key}" if field else str(key)
        if key in ("import", "imported", "reduced") and isinstance(value, dict):
            yield from ((value, name, f"{place}.{name}") for name in FILES if value.get(name))
        elif key == "topography" and value:
            yield tables, key, place
        elif isinstance(value, (dict, list)):
            yield from named_files(value, place)


def merged_tables(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """The tables `below`, but for what `above` says itself; None, which no file can say, takes a field away."""
    result = dict(below)
    for key, value in above.items():
        if value is None:
            result.pop(key, None)
            continue
        both = isinstance(value, dict) and isinstance(below.get(key), dict)
        result[key] = merged_tables(below[key], value) if both else value
    return result


def value_at(tables: Any, way: Sequence[Any]) -> Any:
    """What stands at the end of the way, keys and positions; MISSING where it leads nowhere."""
    for key in way:
        if isinstance(tables, dict) and key in tables:
            tables = tables[key]
        elif isinstance(tables, list) and isinstance(key, int) and key < len(tables):
            tables = tables[key]
        else:
            return MISSING
    return tables


Changes = Mapping[str, Any]


def changed_tables(kind: type[Spec], changes: Changes) -> dict[str, Any]:
    """The changes as nested tables of a file of class `kind`; SI numbers of quantities are written with their unit."""
    tables: dict[str, Any] = {}
    for key, value in changes.items():
        put_at(tables, key, _written(kind, key, value))
    return tables


def put_at(tables: dict[str, Any], place: str, value: Any) -> None:
    """Writes a value at its place ("gears.pinion.teeth") in nested tables; tables on the way are made."""
    *way, key = place.split(".")
    for step in way:
        tables = tables.setdefault(step, {})
    tables[key] = value


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
