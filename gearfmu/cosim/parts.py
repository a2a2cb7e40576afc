"""Drivetrains of a scene's own parts as networks round any number of the stage's ports, and their start.

At the start everything that shafts and meshes join turns together and gathers speed
together, every shaft twisted by the torque that this takes, so that nothing swings but what the scene makes swing.

Accelerations a and torques λ in the joints of rigid shafts: M a + Cᵀ λ = f, C a = 0 (Lagrange multipliers), rows of C
for shafts, sticking clutches, ports and meshes; f torques of the outside and of slipping clutches. The inertia of the
stage's own rotors is left out. Under the torques on its ports the stage rests as the kernel finds it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from gearfmu.cosim.drive import Drive, Rest, frequencies_of
from gearfmu.cosim.network import Clutch, Driven, Inertia, Network, Source, Spring
from gearfmu.cosim.shaft_loads import Law
from gearfmu.cosim.signals import Ramp
from gearfmu.errors import Problem, SpecError
from gearfmu.scenefile.drivetrain import GROUND, Drivetrain
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.turning import rolling, solved, undriven
from gearfmu.stagefile.tables.connections import PortSpec

SAME = 1e-9  # relative to the largest speed: speeds that do not differ
SMALL = 1e-9  # N·m: torques that are none

Row = dict[str, float]


def parts_drive(scene: SceneSpec, parts: Drivetrain, stage: Stage) -> Drive:
    """A drivetrain of the scene's own parts round a stage. SpecError: `part_ports`; at the start `start_speeds_of`."""

    def start() -> dict[str, float]:
        speeds = start_speeds_of(scene, parts, stage)
        free = [name for name, port in stage.ports.items() if port.kind == "torque" and name not in parts.ports]
        return {f"{name}.w_start": speeds.get(_rotor(stage, name), 0.0) for name in free}

    def with_shafts(ports: Mapping[str, PortSpec]) -> SceneSpec:
        numbers = {name: {"stiffness": ports[name].k, "damping": ports[name].c} for name in parts.ports}
        held = {name: part.model_copy(update=numbers[name]) for name, part in parts.ports.items()}
        return scene.model_copy(update={"drivetrain": parts.model_copy(update={"ports": held})})

    return Drive(
        part_ports(scene.name, parts, stage),
        lambda rest: part_network(parts, start_of(scene, parts, stage, rest)),
        start,
        watched=tuple(parts.clutches),
        frequencies=frequencies_of(parts.torques),
        with_shafts=with_shafts,
    )


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
        found[name] = PortSpec(kind="spring", k=k, c=c, play=own.play)
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


@dataclass(frozen=True)
class Start:
    """Of every inertia speed (rad/s) and angle (rad); of every shaft's end on the ground its angle; on the bores of
    the stage's ports the torque (N·m) that parts bring there."""

    speed: Mapping[str, float]
    angle: Mapping[str, float]
    ground: Mapping[str, float]
    torque: Mapping[str, float]


@dataclass(frozen=True)
class _Joints:
    """Rows of speeds by name that are equal to zero. Rotors of the stage are `stage.` and their name."""

    meshes: list[Row]
    ports: dict[str, Row]
    shafts: dict[str, Row]
    clutches: dict[str, Row] = field(default_factory=dict)

    @property
    def rows(self) -> list[Row]:
        return [*self.meshes, *self.ports.values(), *self.shafts.values()]


def start_of(scene: SceneSpec, parts: Drivetrain, stage: Stage, rest: Rest) -> Start:
    """The start of a scene's own parts. rest: angles (rad) of the ports' bores under torques (N·m) on them, by port.
    SpecError: `start_speeds_of`."""
    joints, speed = _joints(parts, stage), start_speeds_of(scene, parts, stage)
    torque = _torques(parts, joints, speed)
    on_ports = {name: torque[name] for name in parts.ports}
    loaded = any(abs(value) > SMALL for value in on_ports.values())
    bore = rest(on_ports) if loaded else dict.fromkeys(on_ports, 0.0)
    angle, ground = _angles(parts, stage, torque, bore)
    return Start({name: speed[name] for name in parts.inertias}, angle, ground, on_ports)


def start_speeds_of(scene: SceneSpec, parts: Drivetrain, stage: Stage) -> dict[str, float]:
    """Speeds (rad/s) of inertias, and of the stage's rotors as `stage.<name>`, from the input's speed and the given
    ones through shafts and meshes. SpecError with every inertia whose speed nothing decides, or where given speeds
    contradict each other."""
    given: dict[str, float] = {_rotor(stage, next(iter(stage.ports))): scene.start.pinion_speed}
    given |= {name: part.speed for name, part in parts.inertias.items() if part.speed is not None}
    equations = [(_exact(row), Fraction(0)) for row in _joints(parts, stage).rows]
    equations = [({name: Fraction(1)}, Fraction(speed)) for name, speed in given.items()] + equations
    found = {name: float(speed) for name, speed in solved(equations).items()}
    problems = [
        Problem(scene.name, f"drivetrain.inertias.{name}.speed", "missing", "nothing decides its speed: write it")
        for name in parts.inertias
        if name not in found
    ]
    if not problems:
        problems = list(_contradictions(scene, equations, found))
    if problems:
        raise SpecError(problems)
    return found


def _contradictions(
    scene: SceneSpec, equations: Iterable[tuple[dict[str, Fraction], Fraction]], found: Mapping[str, float]
) -> Iterable[Problem]:
    most = max(map(abs, found.values()), default=0.0)
    for factors, right in equations:
        known = all(name in found for name in factors)
        left = sum(float(factor) * found[name] for name, factor in factors.items()) if known else float(right)
        if abs(left - float(right)) > SAME * most * max(map(abs, map(float, factors.values()))):
            speeds = ", ".join(f"{name} {found[name]:g} rad/s" for name in factors)
            remedy = "shafts and meshes do not allow these speeds together: give fewer, or others"
            yield Problem(scene.name, "drivetrain.inertias", speeds, remedy)
            return


def _joints(parts: Drivetrain, stage: Stage) -> _Joints:
    meshes = [{f"stage.{name}": float(factor) for name, factor in row.items()} for row in rolling(stage)]
    meshes += [{_rotor(stage, name): 1.0} for name, port in stage.ports.items() if port.kind == "fixed"]
    ports = {name: _difference(part.on, _rotor(stage, name)) for name, part in parts.ports.items()}
    shafts = {name: _difference(*part.between) for name, part in parts.shafts.items()}
    return _Joints(meshes, ports, shafts, {name: _difference(*part.between) for name, part in parts.clutches.items()})


def _rotor(stage: Stage, port: str) -> str:
    return f"stage.{stage.rotor_of(stage.ports[port].body)}"


def _difference(first: str, second: str) -> Row:
    return {name: factor for name, factor in ((first, 1.0), (second, -1.0)) if name != GROUND}


def _exact(row: Row) -> dict[str, Fraction]:
    return {name: Fraction(factor) for name, factor in row.items()}


def _torques(parts: Drivetrain, joints: _Joints, speed: Mapping[str, float]) -> dict[str, float]:
    """Torque (N·m) in every port's shaft, shaft and clutch: of its first end on its second, of a part on the stage. A
    clutch sticks where it has no slip and its capacity holds it."""
    slip = {name: sum(f * speed[node] for node, f in row.items()) for name, row in joints.clutches.items()}
    capacity = {name: Ramp(part.capacity).ends(0.0, 0.0)[0] for name, part in parts.clutches.items()}
    most = SAME * max(map(abs, speed.values()), default=0.0)
    sliding = {name: np.sign(s) * capacity[name] for name, s in slip.items() if abs(s) > most or not capacity[name]}
    while True:
        found = _balance(parts, joints, speed, sliding)
        hold = {name: parts.clutches[name].peak * capacity[name] for name in joints.clutches if name not in sliding}
        loose = {name: np.sign(found[name]) * capacity[name] for name, most in hold.items() if abs(found[name]) > most}
        if not loose:
            return found | sliding
        sliding |= loose


def _balance(
    parts: Drivetrain, joints: _Joints, speed: Mapping[str, float], sliding: Mapping[str, float]
) -> dict[str, float]:
    """Torques in all joints but those of the clutches that slide with a known torque."""
    stuck = {name: row for name, row in joints.clutches.items() if name not in sliding}
    named = {**joints.ports, **joints.shafts, **stuck}
    rows = [*named.values(), *joints.meshes]
    names = list(dict.fromkeys([*parts.inertias, *(name for row in rows for name in row)]))
    place = {name: k for k, name in enumerate(names)}
    c, force = np.zeros((len(rows), len(names))), np.zeros(len(names))
    for k, row in enumerate(rows):
        for name, factor in row.items():
            c[k, place[name]] = factor
    for part in parts.torques.values():
        force[place[part.on]] += Law(part).at(0.0, speed[part.on])
    for name, torque in sliding.items():
        for node, factor in joints.clutches[name].items():
            force[place[node]] -= factor * torque
    inertia = [parts.inertias[name].inertia if name in parts.inertias else 0.0 for name in names]
    system = np.block([[np.diag(inertia), c.T], [c, np.zeros((len(rows), len(rows)))]])
    solution = np.linalg.lstsq(system, np.concatenate([force, np.zeros(len(rows))]), rcond=None)[0]
    return dict(zip(named, solution[len(names) :].tolist(), strict=False))


def _angles(
    parts: Drivetrain, stage: Stage, torque: Mapping[str, float], bore: Mapping[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    """Angles (rad) of inertias and of shafts' ends on the ground: every shaft is twisted by its torque."""
    known: dict[str, float] = {}
    ground = {GROUND: 0.0} if any(GROUND in part.between for part in parts.clutches.values()) else {}
    for name, port in parts.ports.items():
        stiffness = port.stiffness if port.stiffness is not None else stage.ports[name].k
        assert stiffness is not None, "part_ports refuses others"
        node, held = (f"{GROUND}.{name}", ground) if port.on == GROUND else (port.on, known)
        twisted = bore[name] + torque[name] / stiffness
        held.setdefault(node, twisted + np.sign(torque[name]) * stage.ports[name].side)
    twist = {name: torque[name] / part.stiffness for name, part in parts.shafts.items()}
    for name in [*known, *parts.inertias]:
        known.setdefault(name, 0.0)
        _reach(parts, twist, known, name)
    for name, part in parts.shafts.items():
        if GROUND in part.between:
            first, second = part.between
            ground[f"{GROUND}.{name}"] = known[first] - twist[name] if second == GROUND else known[second] + twist[name]
    return known, ground


def _reach(parts: Drivetrain, twist: Mapping[str, float], known: dict[str, float], begin: str) -> None:
    """Angles of all that shafts lead to from `begin`."""
    left = [begin]
    while left:
        here = left.pop()
        for name, part in parts.shafts.items():
            first, second = part.between
            other = second if here == first else first
            if here not in part.between or other in known or other == GROUND:
                continue
            known[other] = known[here] - twist[name] if here == first else known[here] + twist[name]
            left.append(other)
