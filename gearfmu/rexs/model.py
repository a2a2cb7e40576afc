"""A REXS file as it stands: components with attributes, relations between them, load cases.

Attributes say themselves whether they have been read, so that the rest can be listed. Files: gearfmu.rexs.reading.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gearfmu.errors import Problem, UnitError
from gearfmu.quantities import to_si

_SPELLINGS = {"mum": "um", "1 / min": "rpm", "N m": "N*m"}


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
        return None if attribute is None else self._with_unit(component, attribute, unit)

    def si(self, component: Component, name: str, unit: str) -> float | None:
        """The attribute in the SI unit `unit`; without one a plain number."""
        if not unit:
            return self._number(component, name)
        text = self.quantity(component, name, unit)
        return None if text is None else to_si(text, unit)

    def largest(self, component: Component, name: str, unit: str) -> float | None:
        """Its largest magnitude over the component itself and all load cases, SI."""
        places = [component.attributes, *component.cases]
        texts = [self._with_unit(component, place[name], unit) for place in places if name in place]
        return max((abs(to_si(text, unit)) for text in texts if text is not None), default=None)

    def _number(self, component: Component, name: str) -> float | None:
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
        self.refuse(component, attribute.id, f"{attribute.text} {attribute.unit}".strip(), why)

    def refuse(self, component: Component, name: str, shown: str, remedy: str) -> None:
        """Adds a problem of a component's attribute, once."""
        problem = Problem(str(self.path), f"{component}: {name}", shown, remedy)
        if problem not in self.problems:
            self.problems.append(problem)
