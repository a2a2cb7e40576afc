"""Is a mesh good enough? Scaled Jacobian, volume, elements per load strip."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from gearfmu.femesh.mesh import FeMesh, FlankGrid

_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
)
_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])
_NATURAL = np.concatenate([_CORNERS, _CORNERS[_EDGES].mean(axis=1)])


def _gradient(points: np.ndarray) -> np.ndarray:
    """Natural gradients (P, 3, 20) of the serendipity hexahedron's shape functions, VTK order, at points (P, 3)."""
    factors = 1 + points[:, None, :] * _NATURAL[None]
    gradient = np.empty((len(points), 3, 20))
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        side = _NATURAL[:, axis]
        product = factors[:, :, b] * factors[:, :, c]
        linear = sum(points[:, None, k] * _NATURAL[:, k] for k in range(3))
        gradient[:, axis] = side * product * (linear + points[:, None, axis] * side - 1) / 8
        for middle_axis, other in ((b, c), (c, b)):
            rows = _NATURAL[:, middle_axis] == 0
            bubble = 1 - points[:, None, middle_axis] ** 2
            gradient[:, axis, rows] = (side * bubble * factors[:, :, other])[:, rows] / 4
        rows = side == 0
        gradient[:, axis, rows] = (-2 * points[:, None, axis] * product)[:, rows] / 4
    return gradient


@lru_cache(maxsize=1)
def _rule() -> tuple[np.ndarray, np.ndarray]:
    x, w = np.polynomial.legendre.leggauss(3)
    points = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, np.einsum("i,j,k->ijk", w, w, w).ravel()


def scaled_jacobian(mesh: FeMesh) -> np.ndarray:
    """Smallest det J / (|J₁||J₂||J₃|) of each element (E,) over corners and 3³ Gauss points: 1 brick, ≤ 0 folded."""
    points = np.concatenate([_CORNERS, _rule()[0]])
    jacobian = np.einsum("pan,enc->epac", _gradient(points), mesh.nodes[mesh.elements], optimize=True)
    lengths = np.linalg.norm(jacobian, axis=3).prod(axis=2)
    return (np.linalg.det(jacobian) / lengths).min(axis=1)


def volume(mesh: FeMesh) -> float:
    """Volume (m³) of the mesh, 3³ Gauss points an element."""
    points, weights = _rule()
    jacobian = np.einsum("pan,enc->epac", _gradient(points), mesh.nodes[mesh.elements], optimize=True)
    return float((np.linalg.det(jacobian) @ weights).sum())


def flank_element_length(grid: FlankGrid, r_b: float) -> float:
    """Largest arc length (m) of a flank element along the involute."""
    arc = grid.roll**2 / (2 * r_b)
    return float((arc.max(axis=1) - arc.min(axis=1)).max())


def mesh_report(mesh: FeMesh, r_b: float | None = None, strip_half_width: float | None = None) -> dict[str, Any]:
    """Plain facts of a mesh: counts, quality, volume (m³).

    With the base radius r_b (m) also the length of its flank elements (m), with the load strip (m) how many lie in one.
    """
    quality = scaled_jacobian(mesh)
    facts: dict[str, Any] = {
        "nodes": len(mesh.nodes),
        "dof": 3 * len(mesh.nodes),
        "elements": len(mesh.elements),
        "teeth": mesh.teeth,
        "scaled_jacobian_min": float(quality.min()),
        "scaled_jacobian_mean": float(quality.mean()),
        "volume": volume(mesh),
    }
    if r_b is not None and mesh.flank:
        length = flank_element_length(mesh.flank[0], r_b)
        facts |= {"flank_elements": list(mesh.flank[0].shape), "flank_element_length": length}
        if strip_half_width is not None:
            facts["elements_per_strip"] = 2 * strip_half_width / length
    return facts
