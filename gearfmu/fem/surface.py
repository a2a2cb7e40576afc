"""Faces of quadratic solids: 8-node serendipity quadrilaterals (VTK_QUADRATIC_QUAD) of 20-node hexahedra, 6-node
triangles (VTK_QUADRATIC_TRIANGLE) of 10-node tetrahedra. Shape functions, Gauss rules, and which faces there are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearfmu.fem.hex20 import FACES
from gearfmu.fem.tet10 import simplex_gradient, simplex_shape

_TRIANGLE_EDGES = np.array([[0, 1], [1, 2], [2, 0]])
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


def triangle_shape(xi: np.ndarray) -> np.ndarray:
    """Shape functions of the 6-node triangle: xi (P, 2) → (P, 6)."""
    return simplex_shape(xi, _TRIANGLE_EDGES)


def triangle_gradient(xi: np.ndarray) -> np.ndarray:
    """Derivatives with respect to the natural coordinates: xi (P, 2) → (P, 2, 6)."""
    return simplex_gradient(xi, _TRIANGLE_EDGES)


def gauss_triangle(points: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Collapsed Gauss rule on the unit triangle: positions (points², 2) and weights (points²,)."""
    x, w = np.polynomial.legendre.leggauss(points)
    u, v = np.meshgrid(0.5 * (1 + x), 0.5 * (1 + x), indexing="ij")
    weight = np.outer(w, w) / 4 * (1 - u)
    return np.column_stack([u.ravel(), (v * (1 - u)).ravel()]), weight.ravel()


def surface_measure(positions: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Area of the surface per unit natural area: positions (Q, k, 3), m, of the nodes of faces of any form, gradient
    (P, 2, k) of their shape functions → (Q, P), m²."""
    tangents = np.einsum("pan,qnc->qpac", gradient, positions)
    return np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1)


@dataclass(frozen=True)
class Faces:
    """Boundary faces: quads (F, 8) and triangles (F, 6); normals out of the body."""

    quads: np.ndarray
    triangles: np.ndarray

    def __len__(self) -> int:
        return len(self.quads) + len(self.triangles)

    @property
    def nodes(self) -> np.ndarray:
        """All nodes of the faces, ascending."""
        return np.unique(np.concatenate([self.quads.ravel(), self.triangles.ravel()]))

    @property
    def corners(self) -> np.ndarray:
        """Corner nodes (F, 4), quadrilaterals first; a triangle repeats its third."""
        return np.vstack([self.quads[:, :4], self.triangles[:, [0, 1, 2, 2]]])

    def within(self, node_set: np.ndarray) -> Faces:
        """The faces all of whose nodes lie in the set."""
        return Faces(*(block[np.isin(block, node_set).all(axis=1)] for block in (self.quads, self.triangles)))


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


def faces_within(elements: np.ndarray, node_set: np.ndarray) -> Faces:
    """Boundary faces of hexahedra (E, 20) all of whose eight nodes lie in `node_set`."""
    return Faces(boundary_faces(elements), np.empty((0, 6), int)).within(node_set)
