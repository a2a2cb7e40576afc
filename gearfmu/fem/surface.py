"""Surface integrals over 8-node serendipity quadrilaterals (VTK_QUADRATIC_QUAD): faces of 20-node hexahedra."""

from __future__ import annotations

import numpy as np

from gearfmu.fem.hex20 import FACES

NATURAL = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0]], float)


def shape(xi: np.ndarray) -> np.ndarray:
    """Shape functions of the 8-node quadrilateral: xi (P, 2) → (P, 8)."""
    x, y = (xi[:, None, k] * NATURAL[None, :, k] for k in range(2))
    values = 0.25 * (1 + x) * (1 + y) * (x + y - 1)
    for axis, other in ((0, y), (1, x)):
        middle = NATURAL[:, axis] == 0
        values[:, middle] = 0.5 * (1 - xi[:, axis, None] ** 2) * (1 + other[:, middle])
    return values


def shape_gradient(xi: np.ndarray) -> np.ndarray:
    """Derivatives with respect to the natural coordinates: xi (P, 2) → (P, 2, 8)."""
    c = [xi[:, None, k] * NATURAL[None, :, k] for k in range(2)]
    gradient = np.empty((len(xi), 2, 8))
    for axis, other in ((0, 1), (1, 0)):
        gradient[:, axis] = 0.25 * NATURAL[:, axis] * (1 + c[other]) * (c[0] + c[1] + c[axis])
    for axis, other in ((0, 1), (1, 0)):
        middle = NATURAL[:, axis] == 0
        gradient[:, axis, middle] = -xi[:, axis, None] * (1 + c[other][:, middle])
        gradient[:, other, middle] = 0.5 * (1 - xi[:, axis, None] ** 2) * NATURAL[middle, other]
    return gradient


def gauss_quad(points: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Tensor Gauss rule on [-1, 1]²: positions (points², 2) and weights (points²,)."""
    x, w = np.polynomial.legendre.leggauss(points)
    grid = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    return grid, np.outer(w, w).reshape(-1)


def surface_measure(positions: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Area of the surface per unit natural area: positions (Q, k, 3), m, of the nodes of faces of any form, gradient
    (P, 2, k) of their shape functions → (Q, P), m²."""
    tangents = np.einsum("pan,qnc->qpac", gradient, positions)
    return np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1)


def boundary_faces(elements: np.ndarray) -> np.ndarray:
    """Faces that belong to one element only: elements (E, 20) → (F, 8), normals out of the body."""
    faces = elements[:, FACES].reshape(-1, 8)
    key = np.sort(faces[:, :4], axis=1)
    _, index, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    return faces[np.sort(index[count == 1])]


def outer_faces(elements: np.ndarray, cut_minus: np.ndarray, cut_plus: np.ndarray) -> np.ndarray:
    """Faces (F, 8) of a sector that lie on the surface of the whole body, normals outward; cuts: node indices."""
    faces = boundary_faces(elements)
    on_cut = np.isin(faces, cut_minus).all(axis=1) | np.isin(faces, cut_plus).all(axis=1)
    return faces[~on_cut]


def faces_within(elements: np.ndarray, node_set: np.ndarray) -> np.ndarray:
    """Boundary faces all of whose eight nodes lie in `node_set`: (F, 8)."""
    faces = boundary_faces(elements)
    return faces[np.isin(faces, node_set).all(axis=1)]
