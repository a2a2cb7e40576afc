"""Rigid-body fields and averaging couplings (RBE3): the mean motion of a surface as six rows over the nodes."""

from __future__ import annotations

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.fem import surface
from gearfmu.fem.surface import Faces


def rigid_fields(positions: np.ndarray) -> np.ndarray:
    """Displacement of points under unit rigid motion: positions (…, 3), m → (…, 3, 6).

    Columns: translation x, y, z (m) and small rotation about x, y, z through the origin (rad).
    """
    fields = np.zeros((*positions.shape, 6))
    fields[..., range(3), range(3)] = 1.0
    x, y, z = positions[..., 0], positions[..., 1], positions[..., 2]
    fields[..., 1, 3], fields[..., 2, 3] = -z, y
    fields[..., 0, 4], fields[..., 2, 4] = z, -x
    fields[..., 0, 5], fields[..., 1, 5] = -y, x
    return fields


def rigid_modes(nodes: np.ndarray) -> np.ndarray:
    """The six rigid motions of a mesh about the origin as nodal vectors: nodes (N, 3) → (3N, 6)."""
    return rigid_fields(nodes).reshape(-1, 6)


def master_rows(point: np.ndarray) -> np.ndarray:
    """(6, 6): rigid motion about the origin → motion of a point (3,) m."""
    return np.vstack([rigid_fields(point), np.eye(6)[3:]])


def surface_moments(nodes: np.ndarray, faces: Faces) -> tuple[np.ndarray, np.ndarray]:
    """Moments of a surface's displacement field, by exact surface integration.

    With A(x) the rigid fields at a point, returns b = ∫ Aᵀ N dA, (6, 3N), and g = ∫ Aᵀ A dA, (6, 6). Both add up over
    the parts of a surface.
    """
    moments, gram = np.zeros((len(nodes), 3, 6)), np.zeros((6, 6))
    quads = faces.quads, surface.shape, surface.shape_gradient, surface.gauss_quad()
    triangles = faces.triangles, surface.triangle_shape, surface.triangle_gradient, surface.gauss_triangle()
    for own, shape, slope, (xi, weight) in (quads, triangles):
        if len(own) == 0:
            continue
        values = shape(xi)
        measure = surface.surface_measure(nodes[own], slope(xi)) * weight
        fields = rigid_fields(np.einsum("pn,qnc->qpc", values, nodes[own]))
        np.add.at(moments, own, np.einsum("qp,pn,qpcr->qncr", measure, values, fields, optimize=True))
        gram += np.einsum("qp,qpcr,qpcs->rs", measure, fields, fields, optimize=True)
    return moments.reshape(-1, 6).T, gram


def averaging_rows(nodes: np.ndarray, faces: Faces) -> np.ndarray:
    """Averaging node of a surface (RBE3 with the surface itself as weight).

    The rigid motion (u, θ) about the origin that fits the surface's displacement best in the mean square,
    min ∫ |u(x) − t − θ × x|² dA: rows (6, 3N) for mean ux, uy, uz (m) and rotation rx, ry, rz (rad). Their transpose
    spreads a force and a moment on the averaging node over the surface. MeshError for a patch without faces.
    """
    moments, gram = surface_moments(nodes, faces)
    if np.linalg.matrix_rank(gram) < 6:
        raise MeshError("these nodes span no surface: the set must hold all nodes of the faces it stands for")
    return np.linalg.solve(gram, moments)


def moved(rows: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Rows (6, n) of a rigid motion about the origin as rows of the motion of `point` (3,), m."""
    return np.vstack([rigid_fields(np.asarray(point, float)) @ rows, rows[3:]])


def averaging_rows_uniform(nodes: np.ndarray, node_set: np.ndarray) -> np.ndarray:
    """Averaging node with equal weight on each node of `node_set`, as importers of RBE3 cards expect: (6, 3N)."""
    fields = rigid_fields(nodes[node_set])
    moments = np.zeros((len(nodes), 3, 6))
    moments[node_set] = fields
    gram = np.einsum("ncr,ncs->rs", fields, fields)
    return np.linalg.solve(gram, moments.reshape(-1, 6).T)
