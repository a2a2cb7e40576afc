"""A small surface of the whole gear for pictures, and how it moves in the lowest modes and under tooth loads."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.fem import surface
from gearfmu.fem.cyclic import mirror_nodes


@dataclass(frozen=True)
class Display:
    """Pictures of a gear, float32. points (P, 3) m; quads (Q, 4) indices, normals outward; modes (k, P, 3): displacement
    of mode k, kg^-½, `mode_index` (k,) its number in the body; loads (p, P, 3): displacement under a unit load on flank
    0 of tooth 0, m/N, at roll `load_roll` (p,), m."""

    points: np.ndarray
    quads: np.ndarray
    modes: np.ndarray
    mode_index: np.ndarray
    loads: np.ndarray
    load_roll: np.ndarray


@dataclass(frozen=True)
class Outline:
    """The drawn surface of one sector: nodes (P,) of the mesh that are drawn once a sector, quads (Q, 4) of mesh nodes,
    `stand_in` (N,): the minus-cut node that stands for a plus-cut node one sector on, else −1."""

    nodes: np.ndarray
    quads: np.ndarray
    stand_in: np.ndarray


def outline(mesh: Any) -> Outline:
    """Both end faces of a sector and one quad across the width along its contour."""
    end = _end_face(mesh)
    mirror = mirror_nodes(mesh.nodes)
    stand_in = np.full(len(mesh.nodes), -1)
    stand_in[mesh.cut_plus] = mesh.cut_minus
    if mirror is None:
        quads = surface.boundary_faces(mesh.elements)[:, :4]
        cut = [np.isin(quads, side).all(axis=1) for side in (mesh.cut_minus, mesh.cut_plus)]
        quads = quads[~(cut[0] | cut[1])]
    else:
        edges = _contour(end, mesh)
        side = np.stack([edges[:, 1], edges[:, 0], mirror[edges[:, 0]], mirror[edges[:, 1]]], axis=1)
        quads = np.concatenate([end, mirror[end][:, ::-1], side])
    used = np.unique(quads)
    return Outline(used[stand_in[used] < 0], quads, stand_in)


def whole_surface(mesh: Any, sector: Outline) -> tuple[np.ndarray, np.ndarray]:
    """Points (z·P, 3) and quads (z·Q, 4) of all sectors."""
    number = np.full(len(mesh.nodes), -1)
    number[sector.nodes] = np.arange(len(sector.nodes))
    ahead = sector.stand_in[sector.quads] >= 0
    local = number[np.where(ahead, sector.stand_in[sector.quads], sector.quads)]
    per_sector = len(sector.nodes)
    quads = [((j + ahead) % mesh.teeth) * per_sector + local for j in range(mesh.teeth)]
    points = _turned(np.broadcast_to(mesh.nodes[sector.nodes], (mesh.teeth, per_sector, 3)))
    return points.reshape(-1, 3), np.concatenate(quads)


def unfold_mode(shape: np.ndarray, nodal_diameter: int, sector: Outline, teeth: int) -> np.ndarray:
    """Displacement (z·P, 3) of the first (real) part of a mode from its sector shape (3N,)."""
    local = shape.reshape(-1, 3)[sector.nodes]
    turn = np.exp(2j * np.pi * nodal_diameter * np.arange(teeth) / teeth)
    return _turned(np.multiply.outer(turn, local).real).reshape(-1, 3)


def unfold_sectors(shapes: np.ndarray, sector: Outline) -> np.ndarray:
    """Displacement (z·P, 3) from that of every sector in its own frame, (z, 3N)."""
    return _turned(shapes.reshape(len(shapes), -1, 3)[:, sector.nodes]).reshape(-1, 3)


def _turned(vectors: np.ndarray) -> np.ndarray:
    """Sector-frame vectors (z, P, 3) in the body frame."""
    angle = 2 * np.pi * np.arange(len(vectors)) / len(vectors)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y, vectors[..., 2]], axis=-1)


def _end_face(mesh: Any) -> np.ndarray:
    top = mesh.nodes[:, 2].max()
    corners = surface.boundary_faces(mesh.elements)[:, :4]
    return corners[(mesh.nodes[corners, 2] > top - 1e-9 * np.ptp(mesh.nodes)).all(axis=1)]


def _contour(quads: np.ndarray, mesh: Any) -> np.ndarray:
    """Directed edges of the end face that belong to one quad and do not lie on a cut: (E, 2)."""
    edges = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, index, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    edges = edges[index[count == 1]]
    on_cut = np.isin(edges, mesh.cut_minus).all(axis=1) | np.isin(edges, mesh.cut_plus).all(axis=1)
    return edges[~on_cut]
