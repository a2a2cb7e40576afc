"""A drivetrain of the scene's own parts: inertias, shafts, clutches and torques round any number of the stage's ports.
Declared once; docs are made from it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from gearfmu.scenefile.shaft_loads import Found, ShaftLoad, Time, law_problems, time_problems
from gearfmu.stagefile.reading.base import Name, Quantity, Spec, entry
from gearfmu.stagefile.tables.connections import Damping, Inertia, Stiffness

GROUND = "ground"
Capacity = Annotated[float, Quantity("clutch_capacity")]


class ClutchSpec(Spec):
    """Capacity over time: straight lines through (time, torque), constant outside; the same time twice is a jump."""

    capacity: Annotated[tuple[tuple[Time, Capacity], ...], Field(min_length=1)] = entry(
        "torque that it transmits when it slips, over time"
    )
    peak: Annotated[float, Quantity("peak")] = entry("when it sticks it holds up to this many times its capacity", 1.0)


class PortShaft(Spec):
    """The shaft between a port of the stage and a part; it belongs to the stage. What is not given is that of the
    stage's port."""

    on: Name = entry("an inertia, or ground")
    stiffness: Stiffness | None = entry("of the shaft", None)
    damping: Damping | None = entry("of the shaft", None)


class InertiaPart(Spec):
    """A rigid inertia."""

    inertia: Inertia = entry("about its axis")
    speed: Annotated[float, Quantity("speed")] | None = entry(
        "at the start; not needed where shafts or meshes lead to a known speed", None
    )


class ShaftPart(Spec):
    """A shaft between two inertias, or an inertia and ground."""

    between: tuple[Name, Name] = entry("its two ends: inertias, or an inertia and ground")
    stiffness: Stiffness = entry("torque per twist")
    damping: Damping = entry("torque per speed of twist", 0.0)


class ClutchPart(ClutchSpec):
    """A dry clutch between two inertias; between an inertia and ground it is a brake."""

    between: tuple[Name, Name] = entry("its two sides; slip is the first's speed less the second's")


class TorquePart(ShaftLoad):
    """A torque of the outside on one inertia: the sum of the given laws, about +z."""

    on: Name = entry("the inertia")


class Drivetrain(Spec):
    """Parts by name. A stage's port hangs on the inertia that `ports` names; ports without an entry stay as the stage
    has them, fixed or without torque."""

    ports: dict[Name, PortShaft] = entry("part on each port of the stage")
    inertias: dict[Name, InertiaPart] = entry("rigid inertias")
    shafts: dict[Name, ShaftPart] = entry("shafts between inertias", {})
    clutches: dict[Name, ClutchPart] = entry("clutches and brakes", {})
    torques: dict[Name, TorquePart] = entry("torques of the outside on inertias", {})


def drivetrain_problems(parts: Drivetrain) -> Found:
    """What no single field of [drivetrain] shows."""
    if not parts.ports:
        yield "drivetrain.ports", "", 'nothing hangs on the stage: write e.g. [drivetrain.ports.carrier] on = "engine"'
    yield from _name_problems(parts)
    for field, used, may_be_ground in _uses(parts):
        known = [*parts.inertias, *([GROUND] if may_be_ground else [])]
        if used not in known:
            yield field, f'"{used}"', f"there is no such part; there are {', '.join(known)}"
    for table in ("shafts", "clutches"):
        for name, part in getattr(parts, table).items():
            if part.between[0] == part.between[1]:
                yield f"drivetrain.{table}.{name}.between", f'"{part.between[0]}" twice', "name two different ends"
    for name, clutch in parts.clutches.items():
        yield from time_problems(clutch.capacity, f"drivetrain.clutches.{name}.capacity")
    for name, torque in parts.torques.items():
        yield from law_problems(torque, f"drivetrain.torques.{name}")


def _name_problems(parts: Drivetrain) -> Found:
    seen: dict[str, str] = {GROUND: "the ground"}
    for table in ("inertias", "shafts", "clutches", "torques"):
        for name in getattr(parts, table):
            if name in seen:
                yield f"drivetrain.{table}.{name}", "", f"the name is that of {seen[name]}: give it another"
            seen.setdefault(name, f"drivetrain.{table}.{name}")


def _uses(parts: Drivetrain) -> Iterator[tuple[str, str, bool]]:
    """Field, name of the node it uses, whether that may be the ground."""
    for port, shaft in parts.ports.items():
        yield f"drivetrain.ports.{port}.on", shaft.on, True
    for table in ("shafts", "clutches"):
        for name, part in getattr(parts, table).items():
            for end in part.between:
                yield f"drivetrain.{table}.{name}.between", end, True
    for name, torque in parts.torques.items():
        yield f"drivetrain.torques.{name}.on", torque.on, False
