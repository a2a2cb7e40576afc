"""Is an imported mesh cyclic? Its sector, cut out of the whole body or given as such, with its paired cut faces.

A whole mesh is cyclic when a turn by one pitch brings every node onto a node and every element onto an element; its
sector are the elements whose middle lies within half a pitch of tooth 0. A sector mesh is recognised by nodes that have
an image one pitch further. Node positions are evened out by at most `_SAME` of the mesh's size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from gearfmu.errors import MeshError
from gearfmu.femesh.mesh import rotated

_SAME = 2e-6  # of the mesh's size: nodes that are meant to coincide after a turn or a reflection
_EDGE = 1e-5  # of a pitch: how far the cut is turned off the middle of the space, so that no element lies on it


@dataclass(frozen=True)
class CyclicCut:
    """One sector: nodes (N, 3) m, elements by kind, cut_minus and cut_plus (c,) paired nodes, of_mesh (N,) the nodes'
    numbers in the mesh it comes from."""

    nodes: np.ndarray
    elements: dict[str, np.ndarray]
    cut_minus: np.ndarray
    cut_plus: np.ndarray
    of_mesh: np.ndarray


def cyclic_cut(nodes: np.ndarray, elements: dict[str, np.ndarray], teeth: int) -> CyclicCut | None:
    """The sector of a mesh in the frame of its gear (tooth 0 on +x, mid-width at z = 0); None for a whole body that is
    not cyclic. MeshError for a part of a gear that is no sector."""
    pitch = 2 * np.pi / teeth
    image = _images(nodes, nodes, pitch)
    if (image >= 0).all():
        return _cut_out(nodes, elements, teeth, image)
    if is_whole(nodes, teeth):
        return None
    minus = np.flatnonzero(image >= 0)
    if len(minus) == 0:
        raise MeshError(
            "this is neither a whole gear nor one sector: no node has an image one pitch further. Mesh the whole gear, "
            "or one sector with equal meshes on both cut faces"
        )
    return _sector(nodes, elements, np.arange(len(nodes)), minus, image[minus], teeth)


def _images(nodes: np.ndarray, among: np.ndarray, angle: float) -> np.ndarray:
    """For each node the one of `among` that lies where it comes by the turn; −1 without one."""
    distance, found = cKDTree(among).query(rotated(nodes, angle))
    return np.where(distance <= _SAME * np.ptp(nodes, axis=0).max(), found, -1)


def is_whole(nodes: np.ndarray, teeth: int) -> bool:
    """Whether every pitch about the z axis holds nodes."""
    angle = np.arctan2(nodes[:, 1], nodes[:, 0])
    return len(np.unique(np.round(angle * teeth / (2 * np.pi)) % teeth)) == teeth


def _cut_out(nodes: np.ndarray, elements: dict[str, np.ndarray], teeth: int, image: np.ndarray) -> CyclicCut | None:
    chosen = {}
    for kind, block in elements.items():
        key = {tuple(sorted(row)) for row in block.tolist()}
        if any(tuple(sorted(row)) not in key for row in image[block].tolist()):
            return None
        middle = nodes[block].mean(axis=1)
        place = (np.arctan2(middle[:, 1], middle[:, 0]) * teeth / (2 * np.pi) + 0.5 + _EDGE) % teeth
        chosen[kind] = block[place < 1.0]
        if len(chosen[kind]) * teeth != len(block):
            return None
    own = np.unique(np.concatenate([block.ravel() for block in chosen.values()]))
    plus = np.intersect1d(own, image[own])
    before = np.empty(len(nodes), int)
    before[image] = np.arange(len(nodes))
    minus = before[plus]
    if not np.isin(minus, own).all() or np.isin(minus, plus).any():
        return None
    new = np.full(len(nodes), -1)
    new[own] = np.arange(len(own))
    local = {kind: new[block] for kind, block in chosen.items()}
    return _sector(nodes[own], local, own, new[minus], new[plus], teeth)


def _sector(
    nodes: np.ndarray, elements: dict, of_mesh: np.ndarray, minus: np.ndarray, plus: np.ndarray, teeth: int
) -> CyclicCut:
    if np.isin(minus, plus).any():
        raise MeshError("nodes lie on both cut faces: the sector must be one pitch wide and must not reach the axis")
    nodes = _mirrored(nodes)
    nodes[plus] = rotated(nodes[minus], 2 * np.pi / teeth)
    return CyclicCut(nodes, elements, minus, plus, of_mesh)


def _mirrored(nodes: np.ndarray) -> np.ndarray:
    """The same nodes, exactly mirrored about z = 0 where they nearly are."""
    turned = nodes * np.array([1.0, 1.0, -1.0])
    distance, mirror = cKDTree(nodes).query(turned)
    if distance.max() > _SAME * np.ptp(nodes, axis=0).max() or (mirror[mirror] != np.arange(len(nodes))).any():
        return nodes.copy()
    return 0.5 * (nodes + turned[mirror])
