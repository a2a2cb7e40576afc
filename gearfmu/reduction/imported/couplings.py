"""Finite elements made elsewhere and their interfaces: matrices, node sets.

A node set is coupled to a master node at the centre of its nodes, rigidly (RBE2: its nodes move as one rigid body and
leave the unknowns) or by averaging (RBE3: the mean motion of the surface, or of the nodes where they span no surface).
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows, rigid_fields
from gearfmu.fem.hex20 import Material
from gearfmu.fem.surface import Faces
from gearfmu.femesh.imported import ImportedMesh, repeated_cells
from gearfmu.reduction.couplings import Coupling, Elements

Matrices: TypeAlias = tuple[sp.csr_array, sp.csr_array]
"""Stiffness (3N, 3N), N/m, and mass, kg, over the nodes of a mesh: unknown 3·node + component."""


def elements_of(mesh: ImportedMesh, matrices: Matrices | None, material: Material) -> Elements:
    """Finite elements of a mesh with ready-made matrices, or without these those of our own elements."""
    own = matrices or solids.assemble(mesh.nodes, mesh.elements, material)
    return Elements(mesh.nodes, repeated_cells(mesh.elements), *own)


def set_coupling(
    mesh: ImportedMesh,
    faces: Faces,
    node_set: str,
    kind: str = "averaging",
    point: np.ndarray | None = None,
    name: str = "",
) -> Coupling:
    """A node set of the file as an interface, called `name` or like the set.

    faces : the boundary of the mesh. kind : "averaging" or "rigid". point : (3,) m, of its master node (None: mean of
    its nodes). MeshError for a set that is missing, empty, or in one line.
    """
    members = mesh.node_set(node_set)
    point = mesh.nodes[members].mean(axis=0) if point is None else point
    _spanned(mesh, members, node_set)
    rows = None
    if kind == "averaging":
        own, about = faces.within(members), mesh.nodes - point
        if len(own):
            rows = sp.csr_array(averaging_rows(about, own))
    return Coupling(name or node_set, kind, members, point, rows)


def _spanned(mesh: ImportedMesh, members: np.ndarray, name: str) -> None:
    points = mesh.nodes[members] - mesh.nodes[members].mean(axis=0)
    fields = rigid_fields(points / max(np.abs(points).max(), 1e-300)).reshape(-1, 6)
    if np.linalg.matrix_rank(fields, tol=1e-6) < 6:
        raise MeshError(
            f"{mesh.source}: the {len(members)} nodes of '{name}' lie in one line: a master node needs three "
            "that do not"
        )
