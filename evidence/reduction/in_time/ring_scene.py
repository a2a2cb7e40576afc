"""The paper's ring in the time domain: a planet that turns in the backlash of an elastic ring on its mounts.

Bodies, pin, mounts and backlash are those of the shipped planetary54. The pin of the one planet stands on its bearing's
springs; the planet turns at 25 rad/s and begins in the middle of its backlash: teeth meet, let go and meet again. The
ring is reduced from 54 input nodes, one a tooth, as in the paper; contact points are read from its motion.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from evidence.reduction.in_time.contact_points import Placed
from evidence.reduction.in_time.scenes import (
    SPEED,
    Meshes,
    Scene,
    Solid,
    gear,
    placed_planet,
    points_in_the_middle,
    scene,
)
from gearfmu.femesh.sector import gear_sector
from gearfmu.reduction.full_order import Interface
from gearfmu.reduction.toothed import toothed_full_order
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import set_geometry
from gearfmu.stagefile.stage import load_stage


def ring_hammering(meshes: Meshes) -> Scene:
    """The planet's teeth meet those of the ring."""
    stage = load_stage("planetary54")
    spec = stage.written
    mesh, planet, ring = set_geometry(spec).ring_mesh, placed_planet(spec, meshes), placed_ring(spec, meshes)
    points = points_in_the_middle(planet, ring, mesh)
    solids = {
        "planet": gear("planet", planet, spec.planet.material, points.rows[0]),
        "ring": _ring(stage, meshes, points.rows[1]),
    }
    roll, start = mesh.path["C"], (SPEED * np.eye(6)[5], np.zeros(0))
    return scene(spec, solids, start, points, roll * (mesh.length + roll) / mesh.length)


def placed_ring(spec: Any, meshes: Meshes) -> Placed:
    """The ring of the set's file, space 0 on +x, where the planet of bolt 0 has its tooth 0."""
    counts = spec.ring.body.mesh
    mesh = counts.model_copy(update={"scale": counts.scale * meshes.ring})
    ring = set_geometry(spec).ring_mesh.ring
    return Placed(gear_sector(ring, spec.ring.face_width, mesh), ring, np.zeros(2), 0.0)


def _ring(stage: Stage, meshes: Meshes, flank: sp.csr_array) -> Solid:
    """The ring with the springs of its mounts, one node a tooth, and rows of its contact points."""
    inputs = toothed_full_order(stage.by_file["ring"], stage.mounts, meshes.ring)
    labels = tuple(f"n{k}" for k in range(flank.shape[0]))
    full = replace(inputs, interfaces=(*inputs.interfaces, Interface("flank", flank, labels, np.zeros(3), "strip")))
    return Solid(full, inputs)
