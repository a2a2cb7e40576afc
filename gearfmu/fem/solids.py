"""Stiffness, mass and boundary faces of a mesh of quadratic solids, hexahedra and tetrahedra, also mixed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem import hex20, tet10
from gearfmu.fem.hex20 import Material
from gearfmu.fem.surface import Faces

ELEMENTS = {"hexahedron20": hex20, "tetra10": tet10}
_BATCH = 256


def assemble(
    nodes: np.ndarray, elements: Mapping[str, np.ndarray], material: Material
) -> tuple[sp.csr_array, sp.csr_array]:
    """Stiffness and consistent mass matrix.

    nodes : (N, 3), m. elements : "hexahedron20" → (E, 20), "tetra10" → (E, 10), VTK order. Returns K, N/m, and M, kg,
    (3N, 3N) csr, symmetric. Raises MeshError for inside-out elements.
    """
    blocks = [(block, ELEMENTS[kind].element_matrices) for kind, block in elements.items()]
    return hex20.assembled(nodes, blocks, material)


def jacobian_quality(nodes: np.ndarray, block: np.ndarray, kind: str) -> np.ndarray:
    """Smallest det J / (|J₁||J₂||J₃|) of each element (E,) over its nodes: 1 for a brick, ≤ 0 for a folded element
    (a corner tetrahedron's regular value is 0.71)."""
    gradient = ELEMENTS[kind].shape_gradient(ELEMENTS[kind].NATURAL)
    quality = []
    for first in range(0, len(block), 4 * _BATCH):
        jacobian = np.einsum("pan,enc->epac", gradient, nodes[block[first : first + 4 * _BATCH]], optimize=True)
        lengths = np.linalg.norm(jacobian, axis=3).prod(axis=2)
        quality.append((np.linalg.det(jacobian) / np.maximum(lengths, 1e-300)).min(axis=1))
    return np.concatenate(quality)


def boundary(elements: Mapping[str, np.ndarray]) -> Faces:
    """Faces that belong to one element only. MeshError when elements of different kind meet so that their mid nodes do
    not fit."""
    found = []
    for kind, corners in (("hexahedron20", 4), ("tetra10", 3)):
        block = elements.get(kind)
        width = len(ELEMENTS[kind].FACES[0])
        faces = np.empty((0, width), int) if block is None else block[:, ELEMENTS[kind].FACES].reshape(-1, width)
        key = np.sort(faces[:, :corners], axis=1)
        _, index, count = np.unique(key, axis=0, return_index=True, return_counts=True)
        if (count > 2).any():
            raise MeshError(f"{int((count > 2).sum())} faces belong to more than two elements: remove double elements")
        found.append(faces[np.sort(index[count == 1])])
    return Faces(*found)
