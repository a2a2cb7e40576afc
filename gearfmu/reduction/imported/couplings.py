"""Finite elements made elsewhere as a `FullOrder`: matrices, rigid fields, node sets as interfaces.

A node set is coupled to a master node at the centre of its nodes, rigidly (RBE2: its nodes move as one rigid body and
leave the unknowns) or by averaging (RBE3: the mean motion of the surface, or of the nodes where they span no surface).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows, rigid_fields
from gearfmu.fem.surface import Faces
from gearfmu.femesh.imported import ImportedMesh
from gearfmu.reduction.couplings import Coupling, Elements, Judgement
from gearfmu.reduction.couplings import full_order as coupled
from gearfmu.reduction.full_order import FullOrder

KINDS = ("averaging", "rigid")


@dataclass(frozen=True)
class SetInterface:
    """A node set as an interface: the set's name in the file, kind "averaging" or "rigid", and the point (3,) m of its
    master node (None: mean of its nodes)."""

    node_set: str
    kind: str = "averaging"
    point: np.ndarray | None = None


@dataclass(frozen=True)
class Matrices:
    """Stiffness (3N, 3N), N/m, and mass, kg, over the nodes of a mesh: unknown 3·node + component."""

    stiffness: sp.csr_array
    mass: sp.csr_array


def full_order(
    mesh: ImportedMesh,
    matrices: Matrices,
    interfaces: Sequence[SetInterface],
    ground: tuple[str, ...] = (),
    length: float | None = None,
) -> FullOrder:
    """The free body of an imported mesh with its matrices.

    ground : names of sets that are held when a reduction is judged. length : m, by which rotations are multiplied; the
    largest distance of a node from the origin when None. MeshError for sets that are missing, empty, in one line, or
    claimed by two rigid couplings.
    """
    faces = solids.boundary(mesh.elements)
    reach = float(np.linalg.norm(mesh.nodes, axis=1).max()) if length is None else length
    body = Elements(mesh.nodes, mesh.repeated_cells, matrices.stiffness, matrices.mass)
    couplings = [set_coupling(mesh, faces, interface) for interface in interfaces]
    return coupled(mesh.source.stem, body, couplings, Judgement(ground, reach))


def set_coupling(mesh: ImportedMesh, faces: Faces, interface: SetInterface, name: str = "") -> Coupling:
    """The coupling of a node set to its master, called `name` or like the set. faces : the boundary of the mesh.
    MeshError as `full_order`."""
    if interface.kind not in KINDS:
        raise MeshError(f"{mesh.source}: '{interface.kind}' is no kind of interface: one of {', '.join(KINDS)}")
    members = mesh.node_set(interface.node_set)
    point = mesh.nodes[members].mean(axis=0) if interface.point is None else np.asarray(interface.point, float)
    _spanned(mesh, members, interface.node_set)
    rows = None
    if interface.kind == "averaging":
        own, about = faces.within(members), mesh.nodes - point
        if len(own):
            rows = sp.csr_array(averaging_rows(about, own))
    return Coupling(name or interface.node_set, interface.kind, members, point, rows)


def _spanned(mesh: ImportedMesh, members: np.ndarray, name: str) -> None:
    points = mesh.nodes[members] - mesh.nodes[members].mean(axis=0)
    fields = rigid_fields(points / max(np.abs(points).max(), 1e-300)).reshape(-1, 6)
    if np.linalg.matrix_rank(fields, tol=1e-6) < 6:
        raise MeshError(
            f"{mesh.source}: the {len(members)} nodes of '{name}' lie in one line: a master node needs three "
            "that do not"
        )
