"""A REXS file as it stands: components with attributes, relations between them, load cases.

Form after the public specification (spec.rexs.info, versions 1.0 to 1.7, XML): `model` holds `relations`, `components`
and `load_spectrum`; an attribute has an id, a unit and a scalar or an array. Attributes say themselves whether they
have been read, so that the rest can be listed.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

from gearfmu.errors import Problem, SpecError, UnitError
from gearfmu.units import to_si

_SPELLINGS = {"mum": "um", "1 / min": "rpm", "N m": "N*m"}
_LARGEST = 256 * 2**20  # bytes; gear units are below one hundredth of that


@dataclass
class Attribute:
    """One value as text; `read` is set by whoever uses it."""

    id: str
    text: str
    unit: str
    read: bool = False


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
    """Components that belong together: role → identifier."""

    type: str
    roles: tuple[tuple[str, str], ...]

    @property
    def members(self) -> tuple[str, ...]:
        """Identifiers of all of them."""
        return tuple(member for _, member in self.roles)


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
        if attribute is None:
            return None
        return self._with_unit(component, attribute, unit)

    def si(self, component: Component, name: str, unit: str) -> float | None:
        """The attribute in the SI unit `unit`."""
        text = self.quantity(component, name, unit)
        return None if text is None else to_si(text, unit)

    def largest(self, component: Component, name: str, unit: str) -> float | None:
        """Its largest magnitude over the component itself and all load cases, SI."""
        places = [component.attributes, *component.cases]
        texts = [self._with_unit(component, place[name], unit) for place in places if name in place]
        return max((abs(to_si(text, unit)) for text in texts if text is not None), default=None)

    def number(self, component: Component, name: str) -> float | None:
        """A plain number."""
        attribute = component.attributes.get(name)
        if attribute is None:
            return None
        attribute.read = True
        if attribute.unit not in ("", "none"):
            self._refuse(component, attribute, "a plain number has no unit")
        try:
            return float(attribute.text)
        except ValueError:
            self._refuse(component, attribute, "not a number")
            return None

    def unread(self) -> Iterator[tuple[Component, Attribute]]:
        """What nobody has asked for."""
        for component in self.components.values():
            for place in (component.attributes, *component.cases):
                yield from ((component, attribute) for attribute in place.values() if not attribute.read)

    def _with_unit(self, component: Component, attribute: Attribute, unit: str) -> str | None:
        attribute.read = True
        text = f"{attribute.text} {_SPELLINGS.get(attribute.unit, attribute.unit)}".strip()
        try:
            to_si(text, unit)
        except UnitError as error:
            self._refuse(component, attribute, str(error))
            return None
        return text

    def _refuse(self, component: Component, attribute: Attribute, why: str) -> None:
        shown = f"{attribute.text} {attribute.unit}".strip()
        problem = Problem(str(self.path), f"{component}: {attribute.id}", shown, why)
        if problem not in self.problems:
            self.problems.append(problem)


def read_rexs(path: Path) -> RexsModel:
    """The model in a .rexs or .xml file, or in the only .rexs file of a .rexsz or .zip archive; SpecError when it is
    none."""
    try:
        root = ElementTree.fromstring(_bytes(path))
    except ElementTree.ParseError as error:
        raise _refused(path, f"not well-formed XML ({error}); REXS files in JSON are not read") from error
    version = root.get("version", "")
    if root.tag != "model" or not version:
        raise _refused(path, "the root element of a REXS file is <model version=…>")
    if version.split(".")[0] != "1":
        raise _refused(path, f"REXS version {version}: versions 1.0 to 1.7 are read")
    listed = [_component(element) for element in root.iterfind("components/component")]
    components = {component.id: component for component in listed}
    if len(components) < len(listed):
        raise _refused(path, "two components have the same id")
    for element in root.iterfind("load_spectrum/load_case/components/component"):
        _add_case(components, element)
    for element in root.iterfind("load_spectrum/load_case/component"):
        _add_case(components, element)
    relations = tuple(_relation(element) for element in root.iterfind("relations/relation"))
    return RexsModel(path, version, components, relations)


def _bytes(path: Path) -> bytes:
    try:
        if not zipfile.is_zipfile(path):
            return path.read_bytes()
        with zipfile.ZipFile(path) as archive:
            inside = [info for info in archive.infolist() if info.filename.lower().endswith((".rexs", ".xml"))]
            if len(inside) != 1 or inside[0].file_size > _LARGEST:
                raise _refused(path, f"the archive must hold one .rexs file, not {len(inside)}")
            return archive.read(inside[0])
    except OSError as error:
        raise _refused(path, f"the file cannot be read ({error.strerror}): check the path") from error


def _refused(path: Path, remedy: str) -> SpecError:
    return SpecError([Problem(str(path), "", "", remedy)])


def _component(element: ElementTree.Element) -> Component:
    return Component(element.get("id", ""), element.get("type", ""), element.get("name", ""), _attributes(element))


def _add_case(components: dict[str, Component], element: ElementTree.Element) -> None:
    component = components.get(element.get("id", ""))
    if component is not None:
        component.cases.append(_attributes(element))


def _attributes(element: ElementTree.Element) -> dict[str, Attribute]:
    found = {}
    for entry in element.iterfind("attribute"):
        name, text = entry.get("id", ""), (entry.text or "").strip()
        if len(entry):  # an array, a matrix or coded values
            text = " ".join(part.strip() for part in entry.itertext() if part.strip())
        found[name] = Attribute(name, text, entry.get("unit", ""))
    return found


def _relation(element: ElementTree.Element) -> Relation:
    roles = tuple((ref.get("role", ""), ref.get("id", "")) for ref in element.iterfind("ref"))
    return Relation(element.get("type", ""), roles)
