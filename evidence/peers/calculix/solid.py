"""Sections extruded into quadratic hexahedra, with the surfaces a contact solution needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evidence.peers.calculix.section import Plane

FACE_OF_EDGE = np.array([3, 4, 5, 6])  # CalculiX's face number over edge k of the section's quadrilateral


@dataclass(frozen=True)
class Solid:
    """An extruded section, 20-node hexahedra in VTK (= Abaqus) order. nodes (N, 3) m, in its body frame. bore: nodes
    of the bore, weights: their share of its area. low, high: nodes of the two end faces. flank, patch: per fine
    tooth (F, 2) element and face number of its sg = +1 surface and of the fine zone of it."""

    nodes: np.ndarray
    elements: np.ndarray
    bore: np.ndarray
    weights: np.ndarray
    low: np.ndarray
    high: np.ndarray
    flank: dict[int, np.ndarray]
    patch: dict[int, np.ndarray]


def extruded(plane: Plane, levels: np.ndarray) -> Solid:
    """The solid over the section between the corner levels z (L + 1,) m."""
    z = np.interp(np.arange(2 * len(levels) - 1) / 2, np.arange(len(levels)), levels)
    exists = np.zeros((len(z), len(plane.nodes)), dtype=bool)
    exists[::2] = True
    exists[:, np.unique(plane.quads[:, :4])] = True
    number = np.where(exists, np.cumsum(exists.ravel()).reshape(exists.shape) - 1, -1)
    level, node = np.nonzero(exists)
    corner, middle = plane.quads[:, :4], plane.quads[:, 4:]
    elements = [
        np.hstack([number[k][corner], number[k + 2][corner], number[k][middle], number[k + 2][middle],
                   number[k + 1][corner]])
        for k in range(0, len(z) - 2, 2)
    ]  # fmt: skip
    bore, weights = bore_nodes(plane, number, z)
    return Solid(
        nodes=np.column_stack([plane.nodes[node], z[level]]),
        elements=np.concatenate(elements),
        bore=bore,
        weights=weights,
        low=number[0][number[0] >= 0],
        high=number[-1][number[-1] >= 0],
        flank={tooth: faces_over(plane, edges, len(levels) - 1) for tooth, edges in plane.flank.items()},
        patch={tooth: faces_over(plane, edges, len(levels) - 1) for tooth, edges in plane.patch.items()},
    )


def bore_nodes(plane: Plane, number: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bore nodes and ∫N dA/A of eight-node faces: −1/12 of a face at its corners, 1/3 at its mid nodes."""
    weight = np.zeros(number.max() + 1)
    start, end, middle = plane.bore.T
    radius = np.linalg.norm(plane.nodes[start[0]])
    span = 2 * radius * np.arcsin(np.linalg.norm(plane.nodes[end] - plane.nodes[start], axis=1) / (2 * radius))
    for k in range(0, len(z) - 2, 2):
        area = span * (z[k + 2] - z[k])
        for level in (k, k + 2):
            np.add.at(weight, number[level][start], -area / 12)
            np.add.at(weight, number[level][end], -area / 12)
            np.add.at(weight, number[level][middle], area / 3)
        np.add.at(weight, number[k + 1][start], area / 3)
        np.add.at(weight, number[k + 1][end], area / 3)
    bore = np.flatnonzero(weight)
    return bore, weight[bore] / weight.sum()


def faces_over(plane: Plane, edges: np.ndarray, layers: int) -> np.ndarray:
    """Element and face numbers over section edges, all layers."""
    wanted = {tuple(sorted(pair)) for pair in edges[:, :2].tolist()}
    found = [
        (element, FACE_OF_EDGE[k])
        for element, quad in enumerate(plane.quads.tolist())
        for k in range(4)
        if tuple(sorted((quad[k], quad[(k + 1) % 4]))) in wanted
    ]
    assert len(found) == len(edges)
    return np.concatenate([np.array(found) + [layer * len(plane.quads), 0] for layer in range(layers)])
