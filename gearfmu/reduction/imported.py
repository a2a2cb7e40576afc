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
from gearfmu.fem import patches, solids
from gearfmu.fem.coupling import rigid_fields
from gearfmu.femesh.imported import ImportedMesh
from gearfmu.reduction.full_order import COMPONENTS, FullOrder, Interface

KINDS = ("averaging", "rigid", "nodes")


@dataclass(frozen=True)
class SetInterface:
    """A node set as an interface: the set's name in the file, kind "averaging", "rigid" or "nodes", and the point (3,) m
    of its master node (None: mean of its nodes)."""

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
    largest distance of a node from the origin when None. MeshError for sets that are missing, empty or overlap rigidly.
    """
    nodes = mesh.nodes
    faces = solids.boundary(mesh.elements)
    rigid_sets = [i for i in interfaces if i.kind == "rigid"]
    change, owner = _rigid_change(mesh, rigid_sets)
    built = tuple(_interface(mesh, faces, interface, change, owner) for interface in interfaces)
    fields = rigid_fields(nodes).reshape(-1, 6)
    return FullOrder(
        name=mesh.source.stem,
        stiffness=sp.csr_array(change.T @ matrices.stiffness @ change),
        mass=sp.csr_array(change.T @ matrices.mass @ change),
        rigid=_reduced_fields(fields, owner, rigid_sets, mesh),
        interfaces=built,
        ground=ground,
        length=float(np.linalg.norm(nodes, axis=1).max()) if length is None else length,
        cells=np.where(mesh.cells >= 0, owner.node[mesh.cells], -1),
        node_of_dof=owner.of_unknown,
    )


@dataclass(frozen=True)
class _Owner:
    """node : (N,) number that stands for a node after rigid coupling. of_unknown : (n,) that of each unknown. kept :
    nodal unknowns that stay. master : set name → its six unknowns."""

    node: np.ndarray
    of_unknown: np.ndarray
    kept: np.ndarray
    master: dict[str, np.ndarray]


def _rigid_change(mesh: ImportedMesh, sets: Sequence[SetInterface]) -> tuple[sp.csr_array, _Owner]:
    """q of all nodes from the unknowns: free nodes keep theirs, each rigid set has the six of its master node."""
    count = len(mesh.nodes)
    node = np.arange(count)
    blocks, masters = [], {}
    for number, item in enumerate(sets):
        members = mesh.node_set(item.node_set)
        if (node[members] != members).any():
            raise MeshError(f"{mesh.source}: '{item.node_set}' shares nodes with another rigid set: they cannot both move them")
        node[members] = count + number
        arm = rigid_fields(mesh.nodes[members] - _point(mesh, item))
        rows = (3 * members[:, None] + np.arange(3)).ravel()
        blocks.append((rows, arm.reshape(-1, 6)))
    kept = np.flatnonzero(np.repeat(node == np.arange(count), 3))
    free = sp.coo_array((np.ones(len(kept)), (kept, np.arange(len(kept)))), (3 * count, len(kept) + 6 * len(sets)))
    parts = [free]
    for number, (rows, values) in enumerate(blocks):
        columns = len(kept) + 6 * number + np.arange(6)
        masters[sets[number].node_set] = columns
        index = np.repeat(rows, 6), np.tile(columns, len(rows))
        parts.append(sp.coo_array((values.ravel(), index), free.shape))
    change = sp.csr_array(sum(part.tocsr() for part in parts))
    of_unknown = np.concatenate([kept // 3, np.repeat(count + np.arange(len(sets)), 6)])
    return change, _Owner(node, of_unknown, kept, masters)


def _reduced_fields(fields: np.ndarray, owner: _Owner, sets: Sequence[SetInterface], mesh: ImportedMesh) -> np.ndarray:
    """Rigid motions of the whole body in the unknowns: a master node moves with its point and turns."""
    rows = [fields[owner.kept]]
    for item in sets:
        turn = np.zeros((3, 6))
        turn[:, 3:] = np.eye(3)
        rows.append(np.vstack([rigid_fields(_point(mesh, item)), turn]))
    return np.vstack(rows)


def _point(mesh: ImportedMesh, interface: SetInterface) -> np.ndarray:
    if interface.point is not None:
        return np.asarray(interface.point, float)
    return mesh.nodes[mesh.node_set(interface.node_set)].mean(axis=0)


def _interface(
    mesh: ImportedMesh, faces: solids.Faces, interface: SetInterface, change: sp.csr_array, owner: _Owner
) -> Interface:
    if interface.kind not in KINDS:
        raise MeshError(f"{mesh.source}: '{interface.kind}' is no kind of interface: one of {', '.join(KINDS)}")
    name, point, size = interface.node_set, _point(mesh, interface), change.shape[1]
    if interface.kind == "rigid":
        columns = owner.master[name]
        rows = sp.csr_array(sp.coo_array((np.ones(6), (np.arange(6), columns)), (6, size)))
        return Interface(name, rows, COMPONENTS, point, "rigid")
    members = mesh.node_set(name)
    if interface.kind == "nodes":
        dofs = (3 * members[:, None] + np.arange(3)).ravel()
        pick = sp.coo_array((np.ones(len(dofs)), (np.arange(len(dofs)), dofs)), (len(dofs), change.shape[0]))
        names = tuple(f"{COMPONENTS[c]}@{mesh.labels[n]}" for n in members for c in range(3))
        return Interface(name, sp.csr_array(pick.tocsr() @ change), names, point, "nodes")
    own = faces.within(members)
    about = mesh.nodes - point
    if len(own.quads) + len(own.triangles):
        rows = patches.averaging_rows(about, own)
    else:
        rows = _mean_of_nodes(mesh, about, members, name)
    return Interface(name, sp.csr_array(sp.csr_array(rows) @ change), COMPONENTS, point, "averaging")


def _mean_of_nodes(mesh: ImportedMesh, about: np.ndarray, members: np.ndarray, name: str) -> np.ndarray:
    fields = rigid_fields(about[members])
    gram = np.einsum("ncr,ncs->rs", fields, fields)
    if np.linalg.matrix_rank(gram, tol=1e-12 * np.trace(gram)) < 6:
        raise MeshError(
            f"{mesh.source}: the {len(members)} nodes of '{name}' lie in one line: an averaging node needs three that do not"
        )
    moments = np.zeros((len(about), 3, 6))
    moments[members] = fields
    return np.linalg.solve(gram, moments.reshape(-1, 6).T)
