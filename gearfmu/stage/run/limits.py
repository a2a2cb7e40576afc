"""Where an engagement stands between input and output, and what a stage is made for: torques and speeds of its input
that bring no engagement beyond its torque_max and speed_max, and what to say where a run or a position goes beyond."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.errors import ModelError, SimulationError
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stagefile.forms.general import EngagementSpec
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.forms.turning import meshings, turns

RPM = 30 / np.pi
OPERATING_RANGE = 2.0  # of torques over that at which bearings are linearised; a factor on stiffness of about 1.3


@dataclass(frozen=True)
class MeshPlace:
    """An engagement in its train. number: the kernel's; pitch: angle (rad) by which the output turns back while gear A
    turns on by one pitch;
    lever (m): input torque over mesh force; most: input torque (N·m) that is its torque_max on gear A."""

    number: int
    pitch: float
    lever: float
    most: float


def place_of(model: StageModel, mesh: str | None) -> MeshPlace:
    """Where an engagement stands between input and output; the first when None. ModelError for one that there is not,
    or that does not turn with the ports."""
    stage, turning = model.stage, turns(model.stage, model.shafts.input)
    names = [engagement.name for engagement in stage.engagements]
    if mesh is not None and mesh not in names:
        raise ModelError(f"{model.name} has no engagement '{mesh}'; it has {', '.join(names)}")
    number = 0 if mesh is None else names.index(mesh)
    engagement = stage.engagements[number]
    rotors = [stage.rotor_of(gear) for gear in engagement.gears]
    if any(rotor not in turning for rotor in rotors):
        raise ModelError(f"{model.name}: the engagement '{engagement.name}' does not turn with its ports: name another")
    pair = mesh_shape(stage, engagement)
    a, b = pair.gears
    frame = stage.frame_of(engagement)
    carried = float(turning[frame]) if frame is not None else 0.0
    speed_b = float(turning[rotors[1]]) - carried
    pitch = pair.side * 2 * math.pi / b.z / (speed_b * model.shafts.ratio)
    if frame is None:
        speed = float(turning[rotors[0]])
        return MeshPlace(number, pitch, a.r_b * speed, engagement.torque_max * abs(speed))
    lever = _lever_of_planets(model, engagement, turning)
    return MeshPlace(number, pitch, lever, engagement.torque_max / a.r_b * abs(lever))


def _lever_of_planets(model: StageModel, engagement: EngagementSpec, turning: Mapping[str, Any]) -> float:
    """`MeshPlace.lever` of a mesh that rolls in the axes of a carrier, planets sharing the load alike: power comes
    through the central gear that turns. A planet between two meshes turns the sign round."""
    stage = model.stage
    meshes = [mesh for mesh in stage.engagements if stage.frame_of(mesh) == stage.frame_of(engagement)]
    count = Counter(gear for mesh in meshes for gear in mesh.gears)
    planets = max(count.values())
    central = (gear for gear in count if count[gear] == planets and turning[stage.rotor_of(gear)])
    mesh, gear = next((mesh, gear) for gear in central for mesh in meshes if gear in mesh.gears)
    rotor, shape = stage.rotor_of(gear), mesh_shape(stage, mesh).gears[mesh.gears.index(gear)]
    drives = rotor == stage.rotor_of(stage.ports[model.shafts.input].body)
    lever = planets * shape.r_b * float(turning[rotor]) * (1 if drives else -1)
    return lever if gear in engagement.gears else -lever


def places_of(model: StageModel) -> list[MeshPlace]:
    """The engagements that turn with the ports."""
    turning = turns(model.stage, model.shafts.input)
    return [place_of(model, name) for name, meshing in meshings(model.stage).items() if meshing.rotor in turning]


def largest_torque(model: StageModel) -> float:
    """Torque on the input (N·m) that brings no engagement beyond its torque_max: of a set the torque_max of its file,
    as its meshes are made for load_sharing times their share."""
    return min(place.most for place in places_of(model)) / model.stage.load_sharing


def engagements_per_turn(model: StageModel) -> list[float]:
    """(E,): tooth engagements of every mesh in one revolution of the input, 0 where it does not turn with it."""
    turning = turns(model.stage, model.shafts.input)
    found = meshings(model.stage).values()
    return [abs(float(m.relative(turning))) * m.teeth if m.rotor in turning else 0.0 for m in found]


def largest_speed(model: StageModel) -> float:
    """Speed of the input (rad/s) that brings no engagement beyond its speed_max."""
    cycles, known = engagements_per_turn(model), meshings(model.stage)
    meshes = zip(model.stage.engagements, cycles, strict=True)
    return min(mesh.speed_max * known[mesh.name].teeth / each for mesh, each in meshes if each)


def beyond_limits(model: StageModel, torque: float, speed: float = 0.0) -> list[str]:
    """In words, where a torque (N·m) or a speed (rad/s) of the input lies beyond what the stage is made for."""
    most, fastest, name = largest_torque(model), largest_speed(model), model.shafts.input
    found = []
    if abs(torque) > most * (1 + 1e-9):
        found.append(
            f"{abs(torque):g} N·m on the {name} is beyond torque_max, {most:g} N·m: the local contact law and the load "
            "patch of the bodies are made for less"
        )
    if abs(speed) > fastest * (1 + 1e-9):
        found.append(
            f"{abs(speed) * RPM:.6g} rpm of the {name} is beyond speed_max, {fastest * RPM:.6g} rpm: the internal step "
            "is made for a slower mesh"
        )
    return found + _beyond_operating(model, torque)


def _beyond_operating(model: StageModel, torque: float) -> list[str]:
    """In words, where the stiffness of rolling bearings is that of quite another torque."""
    operating = model.stage.operating
    if not model.stage.rolling or operating is None or not torque:
        return []
    ratio = operating.torque / torque
    if 1 / OPERATING_RANGE <= ratio <= OPERATING_RANGE:
        return []
    return [
        f"{torque:g} N·m on the {model.shafts.input}: the rolling bearings are linearised at {operating.torque:g} N·m, "
        "and their stiffness depends on the load: write [operating] torque into the stage file"
    ]


@contextmanager
def limit_named(model: StageModel, torque: float) -> Iterator[None]:
    """A SimulationError(no_equilibrium) from inside says the torque (N·m on the input), and its limit."""
    try:
        yield
    except SimulationError as error:
        if error.outcome != "no_equilibrium":
            raise
        beyond = "; ".join(beyond_limits(model, torque)) or "within torque_max: look at backlash, relief and ports"
        raise SimulationError(
            f"{model.name}: no static equilibrium under {torque:g} N·m ({beyond})", error.outcome, error.time
        ) from None


def each_load(model: StageModel, torques: Sequence[float], solve: Callable[[int, float], None]) -> tuple[str, ...]:
    """Calls `solve` with the number and the value of every torque (N·m on the input). Returns why a torque has no
    equilibrium, "" where it has one; SimulationError(no_equilibrium) where none has one."""
    failed = []
    for i, torque in enumerate(torques):
        try:
            with limit_named(model, torque):
                solve(i, torque)
            failed.append("")
        except SimulationError as error:
            if error.outcome != "no_equilibrium" or (i + 1 == len(torques) and all(failed)):
                raise
            failed.append(str(error))
    return tuple(failed)
