"""Surface patches of imported meshes: moments of their displacement, and points on them.

What `coupling` does for the faces of our own hexahedra, for quadrilaterals (8 nodes) and triangles (6 nodes) alike.
"""

from __future__ import annotations

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.fem import surface
from gearfmu.fem.coupling import moments_of
from gearfmu.fem.solids import Faces

_TRIANGLE_EDGES = np.array([[0, 1], [1, 2], [2, 0]])


def triangle_shape(xi: np.ndarray) -> np.ndarray:
    """Shape functions of the 6-node triangle: xi (P, 2) → (P, 6)."""
    area = np.column_stack([1 - xi.sum(axis=1), xi])
    return np.hstack([area * (2 * area - 1), 4 * area[:, _TRIANGLE_EDGES[:, 0]] * area[:, _TRIANGLE_EDGES[:, 1]]])


def triangle_gradient(xi: np.ndarray) -> np.ndarray:
    """Derivatives with respect to the natural coordinates: xi (P, 2) → (P, 2, 6)."""
    area = np.column_stack([1 - xi.sum(axis=1), xi])
    slope = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    a, b = _TRIANGLE_EDGES.T
    corners = (4 * area - 1)[:, :, None] * slope
    edges = 4 * (area[:, a, None] * slope[b] + area[:, b, None] * slope[a])
    return np.concatenate([corners, edges], axis=1).transpose(0, 2, 1)


def gauss_triangle(points: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Collapsed Gauss rule on the unit triangle: positions (points², 2) and weights (points²,)."""
    x, w = np.polynomial.legendre.leggauss(points)
    u, v = np.meshgrid(0.5 * (1 + x), 0.5 * (1 + x), indexing="ij")
    weight = np.outer(w, w) / 4 * (1 - u)
    return np.column_stack([u.ravel(), (v * (1 - u)).ravel()]), weight.ravel()


def averaging_rows(nodes: np.ndarray, faces: Faces) -> np.ndarray:
    """Averaging node (RBE3) of a patch, the surface itself as weight: rows (6, 3N) for mean ux, uy, uz (m) and rotation
    rx, ry, rz (rad) about the origin; see `coupling.averaging_rows`. MeshError for a patch without faces."""
    moments, gram = patch_moments(nodes, faces)
    if np.linalg.matrix_rank(gram) < 6:
        raise MeshError("these nodes span no surface: the set must hold all nodes of the faces it stands for")
    return np.linalg.solve(gram, moments)


def patch_moments(nodes: np.ndarray, faces: Faces) -> tuple[np.ndarray, np.ndarray]:
    """b = ∫ Aᵀ N dA, (6, 3N), and g = ∫ Aᵀ A dA, (6, 6), A the rigid fields."""
    quads = (faces.quads, surface.shape, surface.shape_gradient, surface.gauss_quad())
    return moments_of(nodes, [quads, (faces.triangles, triangle_shape, triangle_gradient, gauss_triangle())])
