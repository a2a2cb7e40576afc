"""Pictures of a gear: the drawn surface of a sector and of all, and their displacement in modes and under loads.

A gear meshed here is drawn by a coarse mesh of its own. Its points take their displacement from the finite elements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from gearfmu.body.body import Picture, Shapes, turn_sectors, whole_surface
from gearfmu.fem import surface
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.sector import gear_sector
from gearfmu.reduction.cyclic.flank import Points
from gearfmu.reduction.cyclic.modal import Modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import Statics
from gearfmu.reduction.imported.mean_tooth import WholeGear
from gearfmu.stagefile.forms.shapes import GearShape
from gearfmu.stagefile.tables.bodies import MeshSpec

DRAWN = MeshSpec(flank=8, thickness=2, root=4, rim=4, width=1, thickness_grading=1.25)
_LOADS = 5
_TWIST = 0.08  # rad: largest turn of the section within a drawn layer


@dataclass(frozen=True)
class Outline:
    """The drawn surface of one sector: points (P, 3) drawn once a sector, quads (Q, 4) of their numbers, `ahead` (Q,
    4): true where the point meant is that of the next sector; sample (P, N): displacement of the points from that of
    the finite-element nodes."""

    points: np.ndarray
    quads: np.ndarray
    ahead: np.ndarray
    sample: sp.csr_array


def drawn_outline(geometry: GearShape, face_width: float, nodes: np.ndarray) -> Outline:
    """`outline` of the coarse sector from which a gear is drawn."""
    return outline(gear_sector(geometry, face_width, drawn_counts(geometry, face_width)), nodes)


def drawn_counts(geometry: GearShape, face_width: float) -> MeshSpec:
    """Element counts of the coarse sector that is drawn: one layer, more where its section turns with z."""
    layers = max(1, math.ceil(abs(geometry.twist) * face_width / _TWIST))
    return DRAWN.model_copy(update={"width": layers})


def outline(drawn: FeMesh, nodes: np.ndarray) -> Outline:
    """Surface of the coarse sector mesh `drawn`: the corners of its outer faces.

    nodes (N, 3): the finite-element mesh of the same sector, from whose four nearest nodes the points take their
    displacement (inverse squares of the distance: good enough to look at).
    """
    quads = surface.outer_faces(drawn.elements, drawn.cut_minus, drawn.cut_plus)[:, :4]
    stand_in = np.arange(len(drawn.nodes))
    stand_in[drawn.cut_plus] = drawn.cut_minus
    used, local = np.unique(stand_in[quads], return_inverse=True)
    points = drawn.nodes[used]
    return Outline(points, local.reshape(quads.shape), stand_in[quads] != quads, _sampling(points, nodes))


def _sampling(points: np.ndarray, nodes: np.ndarray) -> sp.csr_array:
    distance, nearest = cKDTree(nodes).query(points, k=4)
    weight = 1 / (distance**2 + (1e-6 * np.ptp(nodes)) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(points)), 4)
    return sp.coo_array((weight.ravel(), (rows, nearest.ravel())), (len(points), len(nodes))).tocsr()


def pictured_loads(points: Points) -> list[int]:
    """Flat indices of the uniform loads on flank 0 at a few rolls from form circle to tip."""
    rolls, functions = len(points.rolls), points.functions
    chosen = sorted({round(k) for k in np.linspace(0, rolls - 1, _LOADS)})
    return [roll * functions for roll in chosen]


def pictured_rolls(points: Points) -> np.ndarray:
    """Rolls of the `pictured_loads`, m."""
    return points.rolls[[load // points.functions for load in pictured_loads(points)]]


def sector_picture(sector: Outline, body: SectorBody, modes: Modes, statics: Statics) -> Picture:
    """Pictures of a gear reduced on one sector, from the outline of a coarse sector mesh of the same gear."""
    shapes, rolls = sector_shapes(sector, modes), pictured_rolls(body.points)
    loads = np.array([unfold_sectors(picture, sector) for picture in statics.pictures], "f4")
    points, quads = whole_surface(sector, body.teeth)
    return Picture(points.astype("f4"), quads, loads, rolls, shapes)


def unfold_sectors(shapes: np.ndarray, sector: Outline) -> np.ndarray:
    """Displacement (z·P, 3) from that of every sector in its own frame, (z, 3N)."""
    return turn_sectors(np.stack([sector.sample @ shape.reshape(-1, 3) for shape in shapes])).reshape(-1, 3)


def sector_shapes(sector: Outline, modes: Modes) -> Shapes:
    """Surface of a sector in all modes, which were made with its points."""
    assert modes.surface is not None
    return Shapes(sector.points.astype("f4"), sector.quads, sector.ahead.astype(int), modes.surface.astype("f4"))


def whole_picture(sector: Outline, nodes: np.ndarray, gear: WholeGear, statics: Statics) -> Picture:
    """Pictures on the drawn surface: every point moves like the nearest of the `nodes` (N, 3) of the whole mesh."""
    points, quads = whole_surface(sector, gear.teeth)
    kept = np.unique(gear.body.node_of_dof[gear.body.node_of_dof < len(nodes)])
    nearest = cKDTree(nodes[kept]).query(points)[1]
    dofs = 3 * nearest[:, None] + np.arange(3)
    loads = np.array([picture[dofs] for picture in statics.pictures], "f4")
    return Picture(points.astype("f4"), quads, loads, pictured_rolls(gear.points))
