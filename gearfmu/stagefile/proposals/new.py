"""A new stage file, written from an existing one, with a comment that says meaning and unit at every field."""

from __future__ import annotations

import json
import os
import re
import secrets
from collections.abc import Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from gearfmu.errors import SpecError
from gearfmu.stagefile.forms.pair import StageSpec
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.reading.base import fields_by_key, model_of_table, quantity_of, read_toml, toml_value
from gearfmu.stagefile.reading.files import Layers, files_of, find_stage, put_at, read_layers
from gearfmu.stagefile.stage import load_stage

_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}$")
_DESCRIPTION = "made like {like}; describe it here in one line"
_HEAD = """# Gear stage "{name}", {origin}. Lengths, torques … are text with a unit.
# A line such as "# slices = 5" shows a default.
# Bodies (<gear>.h5) are made beside this file by `gearfmu reduce` and remade when anything that shapes them changes.
"""


def new_stage(name: str, like: str | os.PathLike[str] = "fzg_c", folder: str | os.PathLike[str] = ".") -> Path:
    """Write `folder`/`name`/stage.toml with the values of the stage `like` and return its path.

    The file is written under a temporary name and appears whole; an existing one is never touched. SpecError when
    `name` is no name, `like` is no valid stage, or the file exists.
    """
    target = _target(name, folder)
    source = find_stage(like)
    if load_stage(source).written.kind == "general":
        text = _renamed(source, name, str(like))
    else:
        own = {"name": name, "description": _DESCRIPTION.format(like=like)}
        text = stage_text(_whole(read_layers(source)) | own, _HEAD.format(name=name, origin=f'made like "{like}"'))
    return _write_new(target, text)


def write_drafted(
    name: str, tables: dict[str, Any], marks: Mapping[str, str], origin: str, folder: str | os.PathLike[str] = "."
) -> Path:
    """Write `folder`/`name`/stage.toml with these tables, like `new_stage`, every value followed by its mark.

    marks: place ("gears.pinion.teeth") → where the value is from; origin: the same of the whole file, in one line.
    """
    target = _target(name, folder)
    own = {"name": name, "description": origin}
    shown = {place: mark for place, mark in marks.items() if place not in ("name", "description", "kind")}
    return _write_new(target, stage_text(tables | own, _HEAD.format(name=name, origin=origin), shown))


def free_target(name: str, folder: str | os.PathLike[str] = ".") -> Path:
    """Where the stage `name` will be written. SpecError when it is no name, or the file exists already."""
    target = _target(name, folder)
    if target.exists():
        raise _exists(target)
    return target


def stage_text(raw: dict[str, Any], head: str, marks: Mapping[str, str] = MappingProxyType({})) -> str:
    """The commented file for these tables."""
    tables = {key: value for key, value in raw.items() if key != "source"}
    kind = PlanetarySpec if tables.get("kind") == "planetary_set" else StageSpec
    return head + "\n".join(_table(kind, tables, (), marks)) + "\n"


def _target(name: str, folder: str | os.PathLike[str]) -> Path:
    if not _NAME.match(name):
        remedy = "a name has small letters, digits and underscores, begins with a letter and has at most 40 characters"
        raise SpecError.of("", "name", f'"{name}"', remedy)
    return Path(folder) / name / "stage.toml"


def _whole(layers: Layers) -> dict[str, Any]:
    """What the file says, with the files that it names by their whole paths."""
    tables = deepcopy(layers.tables)
    for field, _, path in files_of(layers):
        put_at(tables, field, path.resolve().as_posix())
    return tables


def _renamed(source: Path, name: str, like: str) -> str:
    """The file of a general stage, which has its comments already, under another name and description; its base and the
    files that it names itself by their whole paths."""
    text, base = source.read_text(encoding="utf-8-sig"), read_toml(source).get("base")
    values = {"name": name, "description": _DESCRIPTION.format(like=like)}
    if base is not None:
        values["base"] = (source.parent / base).resolve().as_posix()
    for key, value in values.items():
        text = re.sub(rf'^{key} = ".*"', f'{key} = "{value}"', text, count=1, flags=re.MULTILINE)
    layers = read_layers(source)
    for field, named, path in files_of(layers):
        if layers.holder(field) == source:
            key = field.rpartition(".")[2]
            text = text.replace(f'{key} = "{named}"', f'{key} = "{path.resolve().as_posix()}"')
    return text


def _write_new(target: Path, text: str) -> Path:
    """Like files.write_text, but refuses to replace a file."""
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}-{os.getpid()}-{secrets.token_hex(4)}")
    try:
        temporary.write_text(text, encoding="utf-8", newline="\n")
        try:
            os.link(temporary, target)
        except (PermissionError, NotImplementedError):  # a file system without hard links
            if target.exists():
                raise FileExistsError(target) from None
            os.rename(temporary, target)
    except FileExistsError:
        raise _exists(target) from None
    finally:
        temporary.unlink(missing_ok=True)
    return target


def _exists(target: Path) -> SpecError:
    return SpecError.of(target, "", "", "this file exists already: choose another name, or edit it")


def _table(
    kind: type[BaseModel], raw: dict[str, Any], place: tuple[str, ...], marks: Mapping[str, str], several: bool = False
) -> Iterator[str]:
    """Lines of one table: its own fields first, then its sub-tables. several: it is one of [[place]], which say their
    names themselves."""
    left_out = {"source"} if several or not place else {"source", "name"}
    fields = {key: field for key, field in fields_by_key(kind).items() if key not in left_out}
    for key, field in fields.items():
        if model_of_table(field.annotation) is None:
            mark = marks.get(".".join((*place, key)), "")
            yield _line(key, field, raw) + (f"; {mark}" if mark else "")
    for key, field in fields.items():
        inner = model_of_table(field.annotation)
        if inner is None:
            continue
        given = raw.get(key, {}) if get_origin(field.annotation) in (tuple, dict) else [raw.get(key)]
        several = isinstance(raw.get(key), list)
        for name, table in given.items() if isinstance(given, dict) else [(None, table) for table in given]:
            own = (*place, key) if name is None else (*place, key, name)
            if table is None and type(None) in get_args(field.annotation):
                yield from _absent(inner, own, field)
            else:
                title = f"[[{'.'.join(own)}]]" if several else f"[{'.'.join(own)}]"
                yield f"\n{title}  # {field.description}"
                yield from _table(model_of_table(field.annotation, table) or inner, table or {}, own, marks, several)


def _absent(kind: Any, place: tuple[str, ...], field: FieldInfo) -> Iterator[str]:
    """An optional table that is not there, as comments; tables in it have one more comment sign."""
    yield f"\n# [{'.'.join(place)}]  # {field.description}"
    for line in _table(kind, {}, place, {}):
        above = "\n" if line.startswith("\n") else ""
        yield f"{above}# {line.removeprefix(above)}"


def _line(key: str, field: FieldInfo, raw: dict[str, Any]) -> str:
    quantity = quantity_of(field)
    unit = quantity.unit if quantity else ""
    text = f"{key} = {toml_value(raw[key])}" if key in raw else f"# {key} = {_default(field, unit)}"
    meaning = field.description or ""
    choices = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
    if len(choices) > 1:
        meaning += f" ({' | '.join(choices)})"
    return f"{text:<42}  # {meaning}{f' [{unit}]' if unit else ''}"


def _default(field: FieldInfo, unit: str) -> str:
    if field.is_required() or field.default is None:
        return f'"… {unit}"' if unit else "…"
    default = field.default
    return json.dumps(f"{default:g} {unit}") if unit and isinstance(default, float) else toml_value(default)
