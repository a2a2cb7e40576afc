"""Stiffness and consistent mass of 10-node tetrahedra (isotropic, linear elastic), assembled in batches.

Stiffness with 4 points (exact for straight edges), mass with 24 (degree six; shape functions are quadratic, their
products of degree four). Node order is VTK's (VTK_QUADRATIC_TETRA), the same as Abaqus' C3D10.
Source: Zienkiewicz & Taylor, The Finite Element Method, vol. 1; rules: Keast, Comput. Meth. Appl. Mech. Eng. 55 (1986)
339.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.fem.hex20 import Material, elasticity, stiffness_of

EDGES = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])
# The four faces as VTK quadratic triangles, normal pointing out of the element.
FACES = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [2, 0, 3, 6, 7, 9]])
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
NATURAL = np.vstack([CORNERS, 0.5 * (CORNERS[EDGES[:, 0]] + CORNERS[EDGES[:, 1]])])


def shape(xi: np.ndarray) -> np.ndarray:
    """Shape functions at natural coordinates: xi (P, 3) → (P, 10)."""
    return simplex_shape(xi, EDGES)


def shape_gradient(xi: np.ndarray) -> np.ndarray:
    """Derivatives with respect to the natural coordinates: xi (P, 3) → (P, 3, 10)."""
    return simplex_gradient(xi, EDGES)


def simplex_shape(xi: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Shape functions of a quadratic triangle or tetrahedron, corners first, then the middles of its `edges` (e, 2):
    xi (P, d) → (P, d + 1 + e)."""
    share, (a, b) = _shares(xi), edges.T
    return np.hstack([share * (2 * share - 1), 4 * share[:, a] * share[:, b]])


def simplex_gradient(xi: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Derivatives of `simplex_shape` with respect to the natural coordinates: xi (P, d) → (P, d, d + 1 + e)."""
    share, (a, b) = _shares(xi), edges.T
    slope = np.vstack([-np.ones(xi.shape[1]), np.eye(xi.shape[1])])
    corners = (4 * share - 1)[:, :, None] * slope
    middles = 4 * (share[:, a, None] * slope[b] + share[:, b, None] * slope[a])
    return np.concatenate([corners, middles], axis=1).transpose(0, 2, 1)


def _shares(xi: np.ndarray) -> np.ndarray:
    """Share of every corner in a point, its area or volume coordinates."""
    return np.column_stack([1 - xi.sum(axis=1), xi])


def rule_4() -> tuple[np.ndarray, np.ndarray]:
    """Positions (4, 3) and weights (4,) of the rule of degree two."""
    a, b = 0.5854101966249685, 0.1381966011250105
    return np.array([[b, b, b], [a, b, b], [b, a, b], [b, b, a]]), np.full(4, 1 / 24)


def rule_24() -> tuple[np.ndarray, np.ndarray]:
    """Positions (24, 3) and weights (24,) of Keast's rule of degree six."""
    groups = (
        ((0.2146028712591517, 0.2146028712591517, 0.2146028712591517, 0.3561913862225449), 0.0399227502581679),
        ((0.0406739585346113, 0.0406739585346113, 0.0406739585346113, 0.8779781243961660), 0.0100772110553207),
        ((0.3223378901422757, 0.3223378901422757, 0.3223378901422757, 0.0329863295731731), 0.0553571815436544),
        ((0.0636610018750175, 0.0636610018750175, 0.2696723314583159, 0.6030056647916491), 0.0482142857142857),
    )
    points, weights = [], []
    for volume, weight in groups:
        orbit = sorted(set(permutations(volume)))
        points += [list(p[1:]) for p in orbit]
        weights += [weight / 6] * len(orbit)
    return np.array(points), np.array(weights)


def element_matrices(positions: np.ndarray, material: Material) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (E, 30, 30), N/m, and scalar mass (E, 10, 10), kg, of elements at positions (E, 10, 3), m.

    Raises MeshError where a Jacobian determinant is not positive.
    """
    xi, weight = rule_4()
    gradient = shape_gradient(xi)
    jacobian = np.einsum("gan,enb->egab", gradient, positions)
    volume = np.linalg.det(jacobian)
    fine, fine_weight = rule_24()
    fine_volume = np.linalg.det(np.einsum("gan,enb->egab", shape_gradient(fine), positions))
    bad = np.minimum(volume.min(axis=1), fine_volume.min(axis=1)) <= 0
    if bad.any():
        raise MeshError(f"{int(bad.sum())} elements have a Jacobian determinant ≤ 0")
    spatial = np.linalg.solve(jacobian, np.broadcast_to(gradient, (len(positions), *gradient.shape)))
    values = shape(fine)
    mass = material.density * np.einsum("eg,gi,gj->eij", fine_volume * fine_weight, values, values, optimize=True)
    return stiffness_of(spatial, volume * weight, elasticity(material)), mass
