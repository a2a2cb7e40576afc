"""Drivetrains of a scene's own parts as networks round any number of the stage's ports."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gearfmu.cosim.network import Clutch, Driven, Inertia, Network, Source, Spring
from gearfmu.cosim.shaft_loads import Law
from gearfmu.cosim.signals import Ramp
from gearfmu.cosim.start import Start
from gearfmu.errors import Problem, SpecError
from gearfmu.spec.forms.general import Stage
from gearfmu.spec.forms.turning import undriven
from gearfmu.spec.scenes.parts import GROUND, Drivetrain
from gearfmu.spec.tables.ports import PortSpec


def part_ports(file: str, parts: Drivetrain, stage: Stage) -> dict[str, PortSpec]:
    """The stage's ports that parts hang on, as spring ports. SpecError with every one that the stage does not have,
    every shaft without stiffness or damping, and every spring port of the stage that nothing hangs on."""
    problems = list(_port_problems(file, parts, stage))
    problems += undriven(stage, parts.ports, "nothing drives it: write [drivetrain.ports.{name}]")
    if problems:
        raise SpecError(problems)
    found = {}
    for name, shaft in parts.ports.items():
        own = stage.ports[name]
        k, c = (a if a is not None else b for a, b in ((shaft.stiffness, own.k), (shaft.damping, own.c)))
        found[name] = PortSpec(kind="spring", k=k, c=c)
    return found


def _port_problems(file: str, parts: Drivetrain, stage: Stage) -> Iterator[Problem]:
    for name, shaft in parts.ports.items():
        field, own = f"drivetrain.ports.{name}", stage.ports.get(name)
        if own is None:
            yield Problem(file, field, "", f"the stage has no such port; it has {', '.join(stage.ports)}")
            continue
        for key, value in (("stiffness", shaft.stiffness or own.k), ("damping", shaft.damping or own.c)):
            if value is None and getattr(shaft, key) is None:
                yield Problem(file, f"{field}.{key}", "missing", "the stage says none for this port: write it here")


def part_network(parts: Drivetrain, start: Start) -> Network:
    """The parts, moving as `start` says: torque ports named as those of the stage."""
    nodes: list[Inertia | Driven] = [
        Inertia(name, part.inertia, start.angle[name], start.speed[name]) for name, part in parts.inertias.items()
    ]
    nodes += [Driven(name, angle) for name, angle in start.ground.items()]
    springs = tuple(
        Spring(name, dict(zip(ends_of(name, part.between), (1.0, -1.0), strict=True)), part.stiffness, part.damping)
        for name, part in parts.shafts.items()
    )
    clutches = tuple(
        Clutch(name, *part.between, Ramp(part.capacity), part.peak) for name, part in parts.clutches.items()
    )
    sources = tuple(Source(name, part.on, _torque(Law(part))) for name, part in parts.torques.items())
    ports = {name: ends_of(name, (part.on,))[0] for name, part in parts.ports.items()}
    return Network(tuple(nodes), springs, clutches, sources, torque_ports=ports)


def _torque(law: Law) -> Any:
    return lambda time, phi, w: law.at(time, w)


def ends_of(name: str, ends: tuple[str, ...]) -> tuple[str, ...]:
    """Nodes that a shaft ends at: each end on the ground is one of its own, at the angle that the shaft needs."""
    return tuple(f"{GROUND}.{name}" if end == GROUND else end for end in ends)
