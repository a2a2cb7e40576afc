"""Nodal contact of a stage for the model blob: nodes of every gear's flanks, penalty of every engagement."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gearfmu.geometry.hertz import contact_modulus, half_width
from gearfmu.geometry.planetary import RingMesh
from gearfmu.ranges import kernel_limits
from gearfmu.spec.forms.general import EngagementSpec, Stage, ToothedBody
from gearfmu.spec.forms.shapes import face_width, mesh_shape, toothed

SHARE_OF_A = {"both": 0.5, "a": 1.0, "b": 0.0}
MOST = int(kernel_limits()["NODES"][1])  # nodes that the kernel takes along or across
STIFFEST = kernel_limits()["PENALTY"][1]  # N/m³ that it takes


def nodal_sections(stage: Stage) -> dict[str, Any]:
    """Sections of nodes and penalties."""
    numbers = [[mesh_penalty(stage, mesh), SHARE_OF_A[stage.nodal.nodes_of]] for mesh in stage.engagements]
    nodes = {f"nodes{i}": np.array(flank_nodes(stage, gear), np.int32) for i, gear in enumerate(stage.gears)}
    return {"nodal": np.array(numbers)} | nodes


def flank_nodes(stage: Stage, gear: ToothedBody) -> tuple[int, int]:
    """Nodes along a flank and across the face width: as said, or corners and middles of the edges of the gear's own
    mesh."""
    nodal, mesh = stage.nodal, gear.body.mesh
    own = (2 * mesh.scaled(count) + 1 for count in (mesh.flank, mesh.width))
    along, across = (given or min(count, MOST) for given, count in zip((nodal.along, nodal.across), own, strict=True))
    return along, across


def mesh_penalty(stage: Stage, mesh: EngagementSpec) -> float:
    """Penalty stiffness (N/m³) of an engagement: as said, or of "hertz" 3 pi E*/(8 b).

    An elastic foundation of that stiffness has Hertz's half-width b under the same load: that of torque_max on one
    tooth pair at the pitch point. (Johnson, Contact Mechanics, 4.3: K/h of a line contact.)
    """
    if not isinstance(stage.nodal.penalty, str):
        return stage.nodal.penalty
    gears, shape = [toothed(stage, name) for name in mesh.gears], mesh_shape(stage, mesh)
    a, b = (gear.material for gear in gears)
    e_star = contact_modulus((a.youngs_modulus, b.youngs_modulus), (a.poisson_ratio, b.poisson_ratio))
    first = shape.path["C"]
    second = first + shape.length if isinstance(shape, RingMesh) else shape.length - first
    radius = first * second / shape.length / math.cos(shape.gears[0].beta_b)
    load = mesh.torque_max / shape.gears[0].r_b / face_width(stage, mesh)
    return min(3 * math.pi * e_star / (8 * half_width(load, radius, e_star)), STIFFEST)
