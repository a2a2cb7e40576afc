"""The geometry of what a general stage declares: a toothed body alone, and an engagement."""

from __future__ import annotations

import math

from gearfmu.geometry import GearGeometry, PairGeometry
from gearfmu.geometry.hertz import common_width
from gearfmu.geometry.internal import InternalGearGeometry
from gearfmu.geometry.planetary import RingMesh
from gearfmu.spec.forms.general import EngagementSpec, RingBody, Stage, ToothedBody

GearShape = GearGeometry | InternalGearGeometry
MeshShape = PairGeometry | RingMesh


def gear_shape(gear: ToothedBody) -> GearShape:
    """The geometry of a toothed body in its own frame."""
    return InternalGearGeometry.of(gear, gear, 1) if isinstance(gear, RingBody) else GearGeometry.of(gear, gear, 1)


def mesh_shape(stage: Stage, mesh: EngagementSpec) -> MeshShape:
    """The engagement by itself; its `gears` are A and B. ValueError where the axes are too near."""
    a, b = (gear_shape(toothed(stage, name)) for name in mesh.gears)
    distance = centre_distance(stage, mesh)
    assert isinstance(a, GearGeometry), "gear A is external"
    if isinstance(b, InternalGearGeometry):
        return RingMesh(a, b, distance, mesh.backlash)
    return PairGeometry((a, b), distance, mesh.backlash)


def toothed(stage: Stage, name: str) -> ToothedBody:
    """The toothed body of that name."""
    body = stage.bodies[name]
    assert isinstance(body, ToothedBody)
    return body


def face_width(stage: Stage, mesh: EngagementSpec) -> float:
    """Common face width (m) of an engagement."""
    return common_width(toothed(stage, name) for name in mesh.gears)


def centre_distance(stage: Stage, mesh: EngagementSpec) -> float:
    """Distance (m) of the axes of an engagement."""
    (x, y), (u, v) = (stage.rotors[stage.rotor_of(gear)].axis for gear in mesh.gears)
    return math.hypot(u - x, v - y)
