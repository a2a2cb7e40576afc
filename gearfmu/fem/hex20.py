"""Stiffness and consistent mass of 20-node serendipity hexahedra (isotropic, linear elastic), assembled in batches.

Both matrices use 3×3×3 Gauss points: exact for parallelepipeds (products of shape functions are of degree four in each
direction, three points integrate degree five), and of the order of the interpolation error for curved elements.
Node order is VTK's (VTK_QUADRATIC_HEXAHEDRON). Degrees of freedom: 3·node + component.
Source of the shape functions: Zienkiewicz & Taylor, The Finite Element Method, vol. 1, serendipity family.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

import numpy as np
import scipy.sparse as sp

from gearfmu.errors import MeshError

CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
)
EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])
NATURAL = np.vstack([CORNERS, 0.5 * (CORNERS[EDGES[:, 0]] + CORNERS[EDGES[:, 1]])])
# The six faces as VTK quadratic quads, normal pointing out of the element.
FACES = np.array(
    [
        [0, 3, 2, 1, 11, 10, 9, 8],
        [4, 5, 6, 7, 12, 13, 14, 15],
        [0, 1, 5, 4, 8, 17, 12, 16],
        [1, 2, 6, 5, 9, 18, 13, 17],
        [2, 3, 7, 6, 10, 19, 14, 18],
        [3, 0, 4, 7, 11, 16, 15, 19],
    ]
)
_BATCH = 256
_SCATTERED = 4096  # elements that are added to the global matrices together


class Material(Protocol):
    """What the finite elements need of a material: SI values (Pa, –, kg/m³)."""

    youngs_modulus: float
    poisson_ratio: float
    density: float


ElementMatrices: TypeAlias = Callable[[np.ndarray, Material], tuple[np.ndarray, np.ndarray]]


def shape(xi: np.ndarray) -> np.ndarray:
    """Shape functions at natural coordinates: xi (P, 3) → (P, 20)."""
    x, y, z = (xi[:, None, k] * NATURAL[None, :, k] for k in range(3))
    values = 0.125 * (1 + x) * (1 + y) * (1 + z) * (x + y + z - 2)
    for axis in range(3):
        middle = NATURAL[:, axis] == 0
        bubble = 1 - xi[:, axis, None] ** 2
        others = [(1 + c)[:, middle] for k, c in enumerate((x, y, z)) if k != axis]
        values[:, middle] = 0.25 * bubble * others[0] * others[1]
    return values


def shape_gradient(xi: np.ndarray) -> np.ndarray:
    """Derivatives of the shape functions with respect to the natural coordinates: xi (P, 3) → (P, 3, 20)."""
    c = [xi[:, None, k] * NATURAL[None, :, k] for k in range(3)]
    total = c[0] + c[1] + c[2]
    gradient = np.empty((len(xi), 3, 20))
    for axis in range(3):
        a, b = (k for k in range(3) if k != axis)
        gradient[:, axis] = 0.125 * NATURAL[:, axis] * (1 + c[a]) * (1 + c[b]) * (total + c[axis] - 1)
    for middle_axis in range(3):
        nodes = NATURAL[:, middle_axis] == 0
        a, b = (k for k in range(3) if k != middle_axis)
        bubble = 1 - xi[:, middle_axis, None] ** 2
        factor_a, factor_b = (1 + c[a])[:, nodes], (1 + c[b])[:, nodes]
        gradient[:, middle_axis, nodes] = -0.5 * xi[:, middle_axis, None] * factor_a * factor_b
        gradient[:, a, nodes] = 0.25 * bubble * NATURAL[nodes, a] * factor_b
        gradient[:, b, nodes] = 0.25 * bubble * NATURAL[nodes, b] * factor_a
    return gradient


def gauss_hex(points: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Tensor Gauss rule on [-1, 1]³: positions (points³, 3) and weights (points³,)."""
    x, w = np.polynomial.legendre.leggauss(points)
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid, np.einsum("i,j,k->ijk", w, w, w).reshape(-1)


def elasticity(material: Material) -> np.ndarray:
    """Isotropic stiffness in Voigt order xx, yy, zz, yz, xz, xy (engineering shear): (6, 6), Pa."""
    e, nu = material.youngs_modulus, material.poisson_ratio
    shear = e / (2 * (1 + nu))
    lame = e * nu / ((1 + nu) * (1 - 2 * nu))
    d = np.zeros((6, 6))
    d[:3, :3] = lame
    d[np.arange(6), np.arange(6)] += [2 * shear] * 3 + [shear] * 3
    return d


def element_matrices(positions: np.ndarray, material: Material) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass of a batch of elements.

    positions : (E, 20, 3), m. Returns k (E, 60, 60), N/m, and m (E, 20, 20), kg: the scalar mass, which acts on each
    of the three components alike. Raises MeshError where a Jacobian determinant is not positive.
    """
    xi, weight = gauss_hex()
    gradient = shape_gradient(xi)
    jacobian = np.einsum("gan,enb->egab", gradient, positions)
    volume = np.linalg.det(jacobian)
    if not volume.min() > 0:
        raise MeshError(f"{int((volume.min(axis=1) <= 0).sum())} elements have a Jacobian determinant ≤ 0")
    spatial = np.linalg.solve(jacobian, np.broadcast_to(gradient, (len(positions), *gradient.shape)))
    measure = volume * weight
    values = shape(xi)
    mass = material.density * np.einsum("eg,gi,gj->eij", measure, values, values, optimize=True)
    return stiffness_of(spatial, measure, elasticity(material)), mass


def stiffness_of(spatial: np.ndarray, measure: np.ndarray, d: np.ndarray) -> np.ndarray:
    """∫ Bᵀ D B of a batch of elements with k nodes: spatial gradients (E, G, 3, k), 1/m, of the shape functions at G
    points, their volumes (E, G), m³, and elasticity d (6, 6), Pa → (E, 3k, 3k), N/m."""
    elements, points, _, k = spatial.shape
    strain = np.zeros((elements, points, 6, k, 3))
    for component in range(3):
        strain[:, :, component, :, component] = spatial[:, :, component]
    for row, (a, b) in enumerate(((1, 2), (0, 2), (0, 1)), start=3):
        strain[:, :, row, :, a] = spatial[:, :, b]
        strain[:, :, row, :, b] = spatial[:, :, a]
    of_nodes = strain.reshape(elements, points, 6, 3 * k)
    stress = np.matmul(d, of_nodes) * measure[:, :, None, None]
    k_elements = np.matmul(
        of_nodes.reshape(elements, -1, 3 * k).transpose(0, 2, 1), stress.reshape(elements, -1, 3 * k)
    )
    return 0.5 * (k_elements + k_elements.transpose(0, 2, 1))


def assemble(nodes: np.ndarray, elements: np.ndarray, material: Material) -> tuple[sp.csr_array, sp.csr_array]:
    """Stiffness and consistent mass matrix of a mesh.

    nodes : (N, 3), m; elements : (E, 20) int. Returns K (3N, 3N) csr, N/m, and M (3N, 3N) csr, kg, both symmetric.
    Raises MeshError for inside-out elements.
    """
    return assembled(nodes, [(elements, element_matrices)], material)


def assembled(
    nodes: np.ndarray, blocks: Sequence[tuple[np.ndarray, ElementMatrices]], material: Material
) -> tuple[sp.csr_array, sp.csr_array]:
    """`assemble` of blocks of elements (E, k), each with what makes their matrices."""
    k_global, m_scalar = sp.csr_array((3 * len(nodes),) * 2), sp.csr_array((len(nodes),) * 2)
    for elements, matrices in blocks:
        for first in range(0, len(elements), _SCATTERED):
            chunk = elements[first : first + _SCATTERED]
            batches = np.split(chunk, range(_BATCH, len(chunk), _BATCH))
            stiffness, mass = (
                np.concatenate(found)
                for found in zip(*(matrices(nodes[batch], material) for batch in batches), strict=True)
            )
            dofs = (3 * chunk[:, :, None] + np.arange(3)).reshape(len(chunk), -1)
            k_global = k_global + scattered(stiffness, dofs, 3 * len(nodes))
            m_scalar = m_scalar + scattered(mass, chunk, len(nodes))
            del stiffness, mass
    return symmetric(k_global), sp.csr_array(sp.kron(symmetric(m_scalar), sp.identity(3), format="csr"))


def scattered(blocks: np.ndarray, dofs: np.ndarray, size: int) -> sp.csr_array:
    """Sum of element matrices (E, k, k) at the unknowns (E, k), symmetric to rounding: (size, size)."""
    dofs = dofs.astype(np.int32 if size < 2**31 else np.int64)
    rows = np.repeat(dofs, dofs.shape[1], axis=1).ravel()
    columns = np.tile(dofs, (1, dofs.shape[1])).ravel()
    return sp.csr_array(sp.coo_array((blocks.ravel(), (rows, columns)), shape=(size, size)))


def symmetric(matrix: sp.sparray) -> sp.csr_array:
    """(A + Aᵀ)/2, without room for a sum where both have entries at the same places."""
    own, other = sp.csr_array(matrix), sp.csr_array(matrix.T)
    own.sort_indices()
    other.sort_indices()
    if np.array_equal(own.indptr, other.indptr) and np.array_equal(own.indices, other.indices):
        return sp.csr_array((0.5 * (own.data + other.data), own.indices, own.indptr), shape=own.shape)
    both = sp.csr_array(own + other)
    both.data *= 0.5
    return both
