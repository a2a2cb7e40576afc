"""A drivetrain of the scene's own parts: inertias, shafts, clutches and torques round any number of the stage's ports.
Declared once; docs are made from it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from gearfmu.errors import Problem
from gearfmu.scenefile.shaft_loads import ShaftLoad, Time, law_problems, time_problems
from gearfmu.stagefile.reading.base import Name, Quantity, Spec

GROUND = "ground"
Inertia = Annotated[float, Quantity("inertia")]
Stiffness = Annotated[float, Quantity("torsional_stiffness")]
Damping = Annotated[float, Quantity("torsional_damping")]
Capacity = Annotated[float, Quantity("clutch_capacity")]


class ClutchSpec(Spec):
    """Capacity over time: straight lines through (time, torque), constant outside; the same time twice is a jump."""

    capacity: Annotated[tuple[tuple[Time, Capacity], ...], Field(min_length=1)] = Field(
        description="torque that it transmits when it slips, over time"
    )
    peak: Annotated[float, Quantity("peak")] = Field(
        default=1.0, description="when it sticks it holds up to this many times its capacity"
    )


class PortShaft(Spec):
    """The shaft between a port of the stage and a part; it belongs to the stage. What is not given is that of the
    stage's port."""

    on: Name = Field(description="an inertia, or ground")
    stiffness: Stiffness | None = Field(default=None, description="of the shaft")
    damping: Damping | None = Field(default=None, description="of the shaft")


class InertiaPart(Spec):
    """A rigid inertia."""

    inertia: Inertia = Field(description="about its axis")
    speed: Annotated[float, Quantity("speed")] | None = Field(
        default=None, description="at the start; not needed where shafts or meshes lead to a known speed"
    )


class ShaftPart(Spec):
    """A shaft between two inertias, or an inertia and ground."""

    between: tuple[Name, Name] = Field(description="its two ends: inertias, or an inertia and ground")
    stiffness: Stiffness = Field(description="torque per twist")
    damping: Damping = Field(default=0.0, description="torque per speed of twist")


class ClutchPart(ClutchSpec):
    """A dry clutch between two inertias; between an inertia and ground it is a brake."""

    between: tuple[Name, Name] = Field(description="its two sides; slip is the first's speed less the second's")


class TorquePart(ShaftLoad):
    """A torque of the outside on one inertia: the sum of the given laws, about +z."""

    on: Name = Field(description="the inertia")


class Drivetrain(Spec):
    """Parts by name. A stage's port hangs on the inertia that `ports` names; ports without an entry stay as the stage
    has them, fixed or without torque."""

    ports: dict[Name, PortShaft] = Field(description="part on each port of the stage")
    inertias: dict[Name, InertiaPart] = Field(description="rigid inertias")
    shafts: dict[Name, ShaftPart] = Field(default={}, description="shafts between inertias")
    clutches: dict[Name, ClutchPart] = Field(default={}, description="clutches and brakes")
    torques: dict[Name, TorquePart] = Field(default={}, description="torques of the outside on inertias")


def drivetrain_problems(parts: Drivetrain, file: str) -> Iterator[Problem]:
    """What no single field of [drivetrain] shows."""
    if not parts.ports:
        remedy = 'nothing hangs on the stage: write e.g. [drivetrain.ports.carrier] on = "engine"'
        yield Problem(file, "drivetrain.ports", "", remedy)
    yield from _name_problems(parts, file)
    for field, used, may_be_ground in _uses(parts):
        known = [*parts.inertias, *([GROUND] if may_be_ground else [])]
        if used not in known:
            yield Problem(file, field, f'"{used}"', f"there is no such part; there are {', '.join(known)}")
    for table in ("shafts", "clutches"):
        for name, part in getattr(parts, table).items():
            if part.between[0] == part.between[1]:
                field, value = f"drivetrain.{table}.{name}.between", f'"{part.between[0]}" twice'
                yield Problem(file, field, value, "name two different ends")
    for name, clutch in parts.clutches.items():
        yield from time_problems(clutch.capacity, file, f"drivetrain.clutches.{name}.capacity")
    for name, torque in parts.torques.items():
        yield from law_problems(torque, file, f"drivetrain.torques.{name}")


def _name_problems(parts: Drivetrain, file: str) -> Iterator[Problem]:
    seen: dict[str, str] = {GROUND: "the ground"}
    for table in ("inertias", "shafts", "clutches", "torques"):
        for name in getattr(parts, table):
            if name in seen:
                remedy = f"the name is that of {seen[name]}: give it another"
                yield Problem(file, f"drivetrain.{table}.{name}", "", remedy)
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
