"""From TOML to frozen typed objects: quantities with units, and every problem of a file at once.

A spec is a pydantic model whose fields are SI floats. In a file a field with a unit is text ("82.46 mm"); in Python
it may also be the SI number.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    Strict,
    ValidationError,
    model_serializer,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, core_schema

from gearfmu.errors import Problem, SpecError, UnitError, near_or_all
from gearfmu.quantities import Range, quantity_text, range_of, to_si

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

FROM_FILE = {"from_file": True}
_TAGS = ("springs", "catalogue")  # of classes that a table chooses without its `kind`
_NUMBER_PATTERN = r"^\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*[A-Za-zµμ°].*$"


class Spec(BaseModel):
    """Base of all specs: frozen, unknown keys refused, numbers finite. A field whose word in a file is none in Python
    (`import`, `class`) is also known by its name."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)


class LaterFields(Spec):
    """A table whose fields named in `later` are left out of its dump where they have their defaults: a file without
    them is what it was before they were known."""

    later: ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _said(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        tables: dict[str, object] = handler(self)
        defaults = {name: type(self).model_fields[name].get_default(call_default_factory=True) for name in self.later}
        silent = {name for name, value in self if name in defaults and value == defaults[name]}
        return {name: value for name, value in tables.items() if name not in silent}


SpecType = TypeVar("SpecType", bound=Spec)


@dataclass(frozen=True)
class _Ranged:
    """Annotation of a field: the name of its range (`gearfmu.quantities`)."""

    name: str

    @property
    def range(self) -> Range:
        """Limits, SI unit and remedy."""
        return range_of(self.name)


@dataclass(frozen=True)
class Quantity(_Ranged):
    """Annotation of a float field, whose range says unit and limits, and words that may replace a number.

    `Annotated[float, Quantity("module")]` takes "4.5 mm" from a file and 0.0045 from Python. An empty unit means a
    plain number.
    """

    words: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """The SI unit."""
        return self.range.unit

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(self._read)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        own = self.range
        if not own.unit:
            return {"type": "number", "minimum": own.low, "maximum": own.high}
        limits = f"{own.shown(own.low)} to {own.shown(own.high)}"
        number = {
            "type": "string", "pattern": _NUMBER_PATTERN, "unit": own.unit, "range": limits,
            "examples": [f"1 {own.unit}"],
        }  # fmt: skip
        return {"anyOf": [number, {"enum": list(self.words)}]} if self.words else number

    def _read(self, value: Any, info: core_schema.ValidationInfo) -> float | str:
        if isinstance(value, str) and value in self.words:
            return value
        words = "".join(f' or "{word}"' for word in self.words)
        try:
            number = self._number(value, bool((info.context or {}).get("from_file")))
        except UnitError as error:
            raise refuse(f"{error}{words}") from error
        if message := self.range.refusal(number):
            raise refuse(f"{message}{words}")
        return number

    def _number(self, value: Any, from_file: bool) -> float:
        plain = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not plain and not self.unit:
            raise UnitError("expected a plain number")
        if plain and not (self.unit and from_file):
            if not math.isfinite(value):
                raise UnitError("the number must be finite")
            return float(value)
        return to_si(value, self.unit)


@dataclass(frozen=True)
class Whole(_Ranged):
    """Annotation of an integer field."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(self._checked, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {**handler(schema), "minimum": int(self.range.low), "maximum": int(self.range.high)}

    def _checked(self, value: int) -> int:
        if message := self.range.refusal(value):
            raise refuse(message)
        return value


Text = Annotated[str, Strict()]
Name = Annotated[str, Strict(), Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
Count = Annotated[int, Strict()]
Switch = Annotated[bool, Strict()]


def entry(meaning: str, default: Any = ..., **more: Any) -> Any:
    """A field of a table: its meaning for the reader, and its default where a file need not give it. more : as of
    pydantic's Field."""
    return Field(default=default, description=meaning, **more)


def refuse(remedy: str) -> PydanticCustomError:
    """The exception for a validator to raise: `remedy` becomes the problem's text."""
    return PydanticCustomError("refused", "{remedy}", {"remedy": remedy})


def named_tables(tables: object, **common: object) -> object:
    """Tables by name with that name in them, and fields that they have in common before their own."""
    if not isinstance(tables, dict):
        return tables
    return {
        name: common | table | {"name": name} if isinstance(table, dict) else table for name, table in tables.items()
    }


def toml_value(value: Any) -> str:
    """A value as TOML writes it; a dictionary as an inline table."""
    if isinstance(value, dict):
        entries = ", ".join(f"{json.dumps(str(key))} = {toml_value(item)}" for key, item in value.items())
        return f"{{ {entries} }}" if entries else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(toml_value(item) for item in value)}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, (str, bool, int)) else repr(value)


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file. SpecError when it is missing, not UTF-8 or not TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        remedy = f"the file cannot be read ({error.strerror}): check the path"
    except UnicodeDecodeError:
        remedy = "the file is not UTF-8 text: save it as UTF-8"
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        remedy = f"not valid TOML: {error}"
    raise SpecError.of(path, "", "", remedy)


def validate(
    kind: type[SpecType], raw: Any, file: str, from_file: bool = True
) -> tuple[SpecType | None, list[Problem]]:
    """`raw` tables of `file` as an object of class `kind`, or None and everything that is wrong with them. from_file :
    whether quantities need their units; else they may be SI numbers."""
    try:
        return kind.model_validate(raw, context=FROM_FILE if from_file else None), []
    except ValidationError as error:
        entries = error.errors(include_url=False)
        return None, [_problem(kind, raw, file, entry) for entry in entries if not _follows(entry, entries)]


def _follows(entry: Any, entries: Sequence[Any]) -> bool:
    """Whether a list is too short only because the items that are refused do not count."""
    size = len(entry["loc"])
    inside = (other for other in entries if len(other["loc"]) > size and other["loc"][:size] == entry["loc"])
    return entry["type"] == "too_short" and any(inside)


def field_path(raw: Any, loc: tuple[str | int, ...]) -> str:
    """Dotted path of a place in `raw`: positions are shown by the element's key or `name` where it has one."""
    path = ""
    for _, label in _steps(raw, loc):
        path += label if label.startswith("[") or not path else f".{label}"
    return path


def raw_path(raw: Any, loc: tuple[str | int, ...]) -> list[Any]:
    """Keys and positions in `raw` that lead to a place of the model."""
    return [key for key, _ in _steps(raw, loc)]


def _steps(raw: Any, loc: tuple[str | int, ...]) -> Iterator[tuple[Any, str]]:
    """Key or position in `raw` of every part of a place of the model, and how it is shown. Parts that only name the
    class that a table is read as are left out."""
    for part in loc:
        key, label, inside = part, str(part), None
        if isinstance(raw, dict):
            if part not in raw and part in (raw.get("kind", "gear"), *_TAGS):
                continue
            if isinstance(part, int) and part not in raw and part < len(raw):
                key = list(raw)[part]
            label, inside = str(key), raw.get(key)
        elif isinstance(raw, list) and isinstance(part, int) and part < len(raw):
            inside = raw[part]
            name = inside.get("name") if isinstance(inside, dict) else None
            label = name if isinstance(name, str) else f"[{part}]"
        yield key, label
        raw = inside


def _problem(kind: type[Spec], raw: Any, file: str, entry: Any) -> Problem:
    loc = entry["loc"]
    value = "" if entry["type"] == "missing" or not loc else _shown(entry["input"])
    return Problem(file, field_path(raw, loc), value, _remedy(kind, entry))


def _remedy(kind: type[Spec], entry: Any) -> str:
    loc = entry["loc"]
    if entry["type"] == "missing":
        field = fields_at(kind, loc[:-1]).get(loc[-1])
        meaning = f" ({field.description})" if field is not None and field.description else ""
        return f"this field is missing{meaning}: add it"
    if entry["type"] == "extra_forbidden":
        return f"unknown key: {near_or_all(str(loc[-1]), sorted(fields_at(kind, loc[:-1])), 'known are')}"
    if entry["type"] == "string_pattern_mismatch":
        return "a name has small letters, digits and underscores, begins with a letter and has at most 40 characters"
    return entry["msg"][:1].lower() + entry["msg"][1:]


def fields_at(kind: type[BaseModel], loc: tuple[str | int, ...]) -> dict[Any, Any]:
    """The fields of the model at `loc` inside a `kind`."""
    choices = [kind]
    for part in loc:
        if field := fields_by_key(choices[0]).get(part):
            choices = _inner_models(field.annotation)
            if not choices:
                return {}
        else:
            choices = [choice for choice in choices if part in _kinds(choice)] or choices
    return fields_by_key(choices[0])


def model_of_table(annotation: Any, table: object = None) -> type[BaseModel] | None:
    """The spec class in an annotation such as `Spec | None` or `dict[str, Spec]` that a table is read as, the first
    where the table says nothing; None without one."""
    choices = _inner_models(annotation)
    named = [choice for choice in choices if isinstance(table, dict) and table.get("kind") in _kinds(choice)]
    keyed = [choice for choice in choices if isinstance(table, dict) and vars(choice).get("key") in table]
    return next(iter(named or keyed or choices), None)


def _kinds(kind: type[BaseModel]) -> tuple[Any, ...]:
    """The values of `kind`, or the tag, by which a class of several is chosen."""
    field = kind.model_fields.get("kind")
    return get_args(field.annotation) if field is not None else (getattr(kind, "tag", None),)


def fields_by_key(kind: type[BaseModel]) -> dict[Any, Any]:
    """The fields by their keys in a file, those of a class before those of its bases."""
    return {(field := kind.model_fields[name]).alias or name: field for name in _own_first(kind)}


def _own_first(kind: type[BaseModel]) -> list[str]:
    """Names of the fields, those of the bases last."""
    bases = [base for base in kind.__bases__ if issubclass(base, BaseModel)]
    inherited = [name for base in bases for name in _own_first(base)]
    return [name for name in kind.model_fields if name not in inherited] + inherited


def metadata_of(field: FieldInfo) -> Iterator[Any]:
    """Annotations of a field, also those inside `Annotated[…] | None`."""
    yield from field.metadata
    for part in get_args(field.annotation):
        yield from getattr(part, "__metadata__", ())


def quantity_of(field: FieldInfo) -> Quantity | None:
    """The Quantity of a field; None where it is of another kind."""
    return next((part for part in metadata_of(field) if isinstance(part, Quantity)), None)


def _inner_models(annotation: Any) -> list[type[BaseModel]]:
    """The spec classes in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for part in get_args(annotation) for found in _inner_models(part)]


def _shown(value: Any) -> str:
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}…"


def shown(spec: BaseModel) -> dict[str, Any]:
    """The fields of a spec as a person reads it: quantities as text with their units, in those of the drawing office;
    parts that have names under them. What is not given is left out."""
    found = {}
    for name, field in type(spec).model_fields.items():
        value = getattr(spec, name)
        quantity = quantity_of(field)
        if value is not None:
            found[name] = _as_read(value, quantity.unit if quantity else "")
    return found


def _as_read(value: Any, unit: str) -> Any:
    if isinstance(value, BaseModel):
        return shown(value)
    if isinstance(value, Mapping):
        return {str(key): _as_read(item, unit) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        if value and all(isinstance(item, BaseModel) and hasattr(item, "name") for item in value):
            return {item.name: _as_read(item, unit) for item in value}
        return [_as_read(item, unit) for item in value]
    if unit and isinstance(value, float):
        return quantity_text(value, unit)
    return value
