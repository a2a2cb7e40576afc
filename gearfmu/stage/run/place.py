"""Where an engagement stands in its train, between input and output."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gearfmu.errors import ModelError
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stagefile.forms.general import EngagementSpec
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.forms.turning import turns


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
