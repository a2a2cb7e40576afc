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
