"""Files of the exchange format REXS, versions 1.0 to 1.7, in XML or JSON, plain or in an archive.

Form after the public specification (spec.rexs.info) and its schemas: `model` holds `relations` between components,
`components` and `load_spectrum`; an attribute has an id, a unit and a scalar or an array. JSON says the type of a value
by its key: `floating_point`, `integer`, `string`, `floating_point_array` … Attributes say themselves whether they have
been read, so that the rest can be listed.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from gearfmu.errors import Problem, SpecError, UnitError
from gearfmu.quantities import to_si

_ENDINGS = (".rexs", ".xml", ".rexsj", ".json")
_LARGEST = 256 * 2**20  # bytes; gear units are below one hundredth of that
_NO_VALUES = ("id", "unit")  # keys of an attribute in JSON
Tables = dict[str, Any]  # as JSON has them
_SPELLINGS = {"mum": "um", "1 / min": "rpm", "N m": "N*m"}


@dataclass
class Attribute:
    """One value as text; `read` is set by whoever uses it."""

    id: str
    text: str
    unit: str
    read: bool = False

    @property
    def shown(self) -> str:
        """As stage files have it."""
        return f"{self.text} {_SPELLINGS.get(self.unit, self.unit)}".strip()


@dataclass
class Component:
    """A machine element or a part of one; `cases`: what load cases say about it."""

    id: str
    type: str
    name: str
    attributes: dict[str, Attribute]
    cases: list[dict[str, Attribute]] = field(default_factory=list)

    def __str__(self) -> str:
        return f'{self.type} {self.id} "{self.name}"' if self.name else f"{self.type} {self.id}"


@dataclass(frozen=True)
class Relation:
    """Components that belong together, by their identifiers."""

    type: str
    members: tuple[str, ...]


@dataclass
class RexsModel:
    """The whole file; `problems`: what could not be read of what was asked for."""

    path: Path
    version: str
    components: dict[str, Component]
    relations: tuple[Relation, ...]
    problems: list[Problem] = field(default_factory=list)

    def of_type(self, *types: str) -> list[Component]:
        """All components of these types, in the order of the file."""
        return [c for c in self.components.values() if c.type in types]

    def related(self, component: Component, *types: str, relation: str = "") -> list[Component]:
        """Components of these types that share a relation with `component`, whatever their roles are called."""
        found: dict[str, Component] = {}
        for link in self.relations:
            if component.id in link.members and relation in ("", link.type):
                for member in link.members:
                    other = self.components.get(member)
                    if other is not None and other.type in types and other is not component:
                        found[other.id] = other
        return list(found.values())

    def quantity(self, component: Component, name: str, unit: str) -> str | None:
        """The attribute as text for a stage file ("4.5 mm"), which must have the dimension of the SI unit `unit`."""
        attribute = component.attributes.get(name)
        return attribute.shown if attribute and self._value(component, attribute, unit) is not None else None

    def si(self, component: Component, name: str, unit: str) -> float | None:
        """The attribute in the SI unit `unit`; without one a plain number."""
        attribute = component.attributes.get(name)
        return None if attribute is None else self._value(component, attribute, unit)

    def largest(self, component: Component, name: str, unit: str) -> float | None:
        """Its largest magnitude over the component itself and all load cases, SI."""
        places = [component.attributes, *component.cases]
        values = [self._value(component, place[name], unit) for place in places if name in place]
        return max((abs(value) for value in values if value is not None), default=None)

    def unread(self) -> Iterator[tuple[Component, Attribute]]:
        """What nobody has asked for."""
        for component in self.components.values():
            for place in (component.attributes, *component.cases):
                yield from ((component, attribute) for attribute in place.values() if not attribute.read)

    def _value(self, component: Component, attribute: Attribute, unit: str) -> float | None:
        attribute.read = True
        shown = f"{attribute.text} {attribute.unit}".strip()
        if not unit and attribute.unit not in ("", "none"):
            self.refuse(component, attribute.id, shown, "a plain number has no unit")
        try:
            return to_si(attribute.shown, unit) if unit else float(attribute.text)
        except UnitError as error:
            self.refuse(component, attribute.id, shown, str(error))
        except ValueError:
            self.refuse(component, attribute.id, shown, "not a number")
        return None

    def refuse(self, component: Component, name: str, shown: str, remedy: str) -> None:
        """Adds a problem of a component's attribute, once."""
        problem = Problem(str(self.path), f"{component}: {name}", shown, remedy)
        if problem not in self.problems:
            self.problems.append(problem)


def read_rexs(path: Path) -> RexsModel:
    """The model in a REXS file in XML (.rexs, .xml) or JSON (.rexsj, .json), or in the only one of an archive (.rexsz,
    .zip). SpecError when it is none."""
    content = _bytes(path)
    is_json = content.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"[")
    return _from_json(path, content) if is_json else _model(path, _xml_tables(path, content))


def _bytes(path: Path) -> bytes:
    try:
        if not zipfile.is_zipfile(path):
            return path.read_bytes()
        with zipfile.ZipFile(path) as archive:
            inside = [info for info in archive.infolist() if info.filename.lower().endswith(_ENDINGS)]
            if len(inside) != 1 or inside[0].file_size > _LARGEST:
                raise SpecError.of(path, "", "", f"the archive must hold one .rexs or .rexsj file, not {len(inside)}")
            return archive.read(inside[0])
    except OSError as error:
        raise SpecError.of(path, "", "", f"the file cannot be read ({error.strerror}): check the path") from error


def _from_json(path: Path, content: bytes) -> RexsModel:
    try:
        return _model(path, json.loads(content.decode("utf-8-sig"), parse_float=str)["model"])
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise SpecError.of(path, "", "", f"no valid JSON ({error})") from error
    except (KeyError, TypeError, AttributeError) as error:
        remedy = 'not of the form {"model": {"version": …, "relations": […], "components": […]}} of REXS in JSON'
        raise SpecError.of(path, "", "", f"{remedy} ({type(error).__name__}: {error})") from error


def _xml_tables(path: Path, content: bytes) -> Tables:
    """The tables that the file would have in JSON."""
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise SpecError.of(path, "", "", f"neither JSON nor well-formed XML ({error})") from error
    if root.tag != "model" or not root.get("version"):
        raise SpecError.of(path, "", "", "the root element of a REXS file is <model version=…>")

    def components(place: str) -> list[Tables]:
        return [
            {"id": "", "type": ""}
            | entry.attrib
            | {"attributes": [_xml_attribute(a) for a in entry.iterfind("attribute")]}
            for entry in root.iterfind(place)
        ]

    relations = [
        {"type": relation.get("type", ""), "refs": [{"id": ref.get("id", "")} for ref in relation.iterfind("ref")]}
        for relation in root.iterfind("relations/relation")
    ]
    places = ("load_spectrum/load_case/components/component", "load_spectrum/load_case/component")
    return {
        "version": root.get("version"),
        "components": components("components/component"),
        "relations": relations,
        "load_spectrum": {"load_cases": [{"components": components(place)} for place in places]},
    }


def _xml_attribute(entry: ElementTree.Element) -> Tables:
    text = (entry.text or "").strip()
    if len(entry):  # an array, a matrix or coded values
        text = " ".join(part.strip() for part in entry.itertext() if part.strip())
    return {"id": entry.get("id", ""), "unit": entry.get("unit", ""), "string": text}


def _model(path: Path, tables: Tables) -> RexsModel:
    """The model of the tables of a file. KeyError, TypeError and AttributeError for those of something else."""
    version = tables["version"]
    if version.split(".")[0] != "1":
        raise SpecError.of(path, "", "", f"REXS version {version}: versions 1.0 to 1.7 are read")
    components = [
        Component(str(entry["id"]), entry["type"], entry.get("name", ""), _attributes(entry))
        for entry in tables["components"]
    ]
    known = {component.id: component for component in components}
    relations = tuple(
        Relation(entry["type"], tuple(str(ref["id"]) for ref in entry["refs"])) for entry in tables["relations"]
    )
    for case in (tables.get("load_spectrum") or {}).get("load_cases", []):
        for entry in case["components"]:
            if str(entry["id"]) in known:
                known[str(entry["id"])].cases.append(_attributes(entry))
    if len(known) < len(components):
        raise SpecError.of(path, "", "", "two components have the same id")
    return RexsModel(path, version, known, relations)


def _attributes(entry: Tables) -> dict[str, Attribute]:
    """Of a component, by their ids."""
    found = {}
    for attribute in entry.get("attributes") or []:
        values = [value for key, value in attribute.items() if key not in _NO_VALUES]
        found[attribute["id"]] = Attribute(attribute["id"], " ".join(_words(values)), attribute.get("unit") or "")
    return found


def _words(value: object) -> Iterator[str]:
    """Scalars of a value, an array or a matrix as they are written in XML."""
    if isinstance(value, list):
        for item in value:
            yield from _words(item)
    elif isinstance(value, bool):
        yield str(value).lower()
    elif value is not None:
        yield str(value).strip()
