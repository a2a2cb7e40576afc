"""A small surface of the gear for pictures, and how it moves in its modes and under tooth loads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from gearfmu.fem import surface
from gearfmu.femesh.mesh import FeMesh


@dataclass(frozen=True)
class Picture:
    """Pictures of a gear, float32. points (P, 3) m; quads (Q, 4) indices, normals outward; loads (p, P, 3):
    displacement under a unit load on flank 0 of tooth 0, m/N, at roll `load_roll` (p,), m; shapes: a sector in all
    modes, None where none was made."""

    points: np.ndarray
    quads: np.ndarray
    loads: np.ndarray
    load_roll: np.ndarray
    shapes: Shapes | None = None


@dataclass(frozen=True)
class Shapes:
    """Drawn surface of one sector and how it moves in every mode of the gear, float32. points (S, 3) m; quads (T, 4)
    numbers of its points, normals outward, and ahead (T, 4): 1 where the point meant is that of the next sector; modes
    (n, S, 3), kg^-½: displacement on sector 0, of the second mode of a pair its own."""

    points: np.ndarray
    quads: np.ndarray
    ahead: np.ndarray
    modes: np.ndarray


@dataclass(frozen=True)
class Outline:
    """The drawn surface of one sector: points (P, 3) drawn once a sector, quads (Q, 4) of their numbers, `ahead` (Q,
    4): true where the point meant is that of the next sector; sample (P, N): displacement of the points from that of
    the finite-element nodes."""

    points: np.ndarray
    quads: np.ndarray
    ahead: np.ndarray
    sample: sp.csr_array


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


def whole_surface(sector: Outline | Shapes, teeth: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (z·P, 3) and quads (z·Q, 4) of all sectors."""
    per_sector = len(sector.points)
    quads = [((j + sector.ahead) % teeth) * per_sector + sector.quads for j in range(teeth)]
    points = turn_sectors(np.broadcast_to(sector.points, (teeth, per_sector, 3)))
    return points.reshape(-1, 3), np.concatenate(quads)


def unfold_sectors(shapes: np.ndarray, sector: Outline) -> np.ndarray:
    """Displacement (z·P, 3) from that of every sector in its own frame, (z, 3N)."""
    return turn_sectors(np.stack([sector.sample @ shape.reshape(-1, 3) for shape in shapes])).reshape(-1, 3)


def _sampling(points: np.ndarray, nodes: np.ndarray) -> sp.csr_array:
    distance, nearest = cKDTree(nodes).query(points, k=4)
    weight = 1 / (distance**2 + (1e-6 * np.ptp(nodes)) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(points)), 4)
    return sp.coo_array((weight.ravel(), (rows, nearest.ravel())), (len(points), len(nodes))).tocsr()


def turn_sectors(vectors: np.ndarray) -> np.ndarray:
    """Sector-frame vectors (…, z, P, 3) in the body frame."""
    angle = 2 * np.pi * np.arange(vectors.shape[-3]) / vectors.shape[-3]
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y, vectors[..., 2]], axis=-1)
