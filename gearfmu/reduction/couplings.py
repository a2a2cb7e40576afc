"""From finite elements and the couplings at their interfaces to a FullOrder body.

A rigid coupling (RBE2) is eliminated exactly: its slave nodes move as one rigid body with the master, q = T u. An
averaging coupling (RBE3) adds rows only: the rigid motion that fits the surface's displacement best in the mean square,
taken at the master's point. Springs to the ground act on the rows of an averaging coupling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem import surface
from gearfmu.fem.coupling import averaging_rows, averaging_rows_uniform, master_rows, moved, rigid_fields, rigid_modes
from gearfmu.fem.hex20 import symmetric
from gearfmu.reduction.full_order import COMPONENTS, FullOrder, Interface


@dataclass(frozen=True)
class Elements:
    """Assembled finite elements: nodes (N, 3) m, elements (E, k), stiffness and mass (3N, 3N)."""

    nodes: np.ndarray
    elements: np.ndarray
    stiffness: sp.csr_array
    mass: sp.csr_array


@dataclass(frozen=True)
class Coupling:
    """How the nodes of a surface meet the outside: name, kind "rigid", "averaging" or "nodes" (of one node its own
    three displacements), node numbers, and the master's point (3,) m. rows (6, 3N): of an averaging coupling at its
    point, where they are known already."""

    name: str
    kind: str
    nodes: np.ndarray
    point: np.ndarray
    rows: sp.csr_array | None = None


@dataclass(frozen=True)
class Springs:
    """Springs to the ground: rows (k, 3N) of the displacements they feel, stiffness (k,) N/m."""

    rows: sp.csr_array
    stiffness: np.ndarray


def full_order(
    name: str,
    body: Elements,
    couplings: Sequence[Coupling],
    ground: tuple[str, ...],
    length: float,
    springs: Springs | None = None,
) -> FullOrder:
    """The body with its couplings as interfaces, in their order; held by `springs` when given, else free.

    ground : interfaces held when the reduction is judged. length : m, that scales rotations. Raises MeshError for an
    empty coupling and for a node that two rigid couplings claim.
    """
    _check(couplings)
    rigid = [c for c in couplings if c.kind == "rigid"]
    transform, node_of_dof = elimination(body.nodes, rigid)
    stiffness = body.stiffness
    if springs is not None:
        stiffness = stiffness + springs.rows.T @ sp.diags_array(springs.stiffness) @ springs.rows
    interfaces = tuple(_interface(body, c, transform, rigid) for c in couplings)
    return FullOrder(
        name=name,
        stiffness=symmetric(transform.T @ stiffness @ transform),
        mass=symmetric(transform.T @ body.mass @ transform),
        rigid=_rigid_columns(body.nodes, rigid) if springs is None else np.zeros((transform.shape[1], 0)),
        interfaces=interfaces,
        ground=ground,
        length=length,
        cells=_cells(body, rigid, springs),
        node_of_dof=node_of_dof,
    )


def averaging(body: Elements, nodes: np.ndarray, point: np.ndarray) -> sp.csr_array:
    """Rows (6, 3N) of the averaging node at `point` (3,) over the surface spanned by `nodes`.

    Area-weighted over the element faces whose nodes are all in the set; with equal weight on every node where elements
    are not 20-node hexahedra or the set spans no face.
    """
    faces = surface.faces_within(body.elements, nodes) if body.elements.shape[1] == 20 else None
    about_origin = averaging_rows(body.nodes, faces) if faces else averaging_rows_uniform(body.nodes, nodes)
    return sp.csr_array(moved(about_origin, point))


def rows_of(body: Elements, coupling: Coupling) -> sp.csr_array:
    """Rows (6, 3N) of an averaging coupling at its point."""
    return averaging(body, coupling.nodes, coupling.point) if coupling.rows is None else coupling.rows


def _check(couplings: Sequence[Coupling]) -> None:
    claimed: dict[int, str] = {}
    for coupling in couplings:
        if not len(coupling.nodes):
            raise MeshError(f"interface '{coupling.name}' has no nodes: check its node set")
        for node in coupling.nodes.tolist() if coupling.kind == "rigid" else ():
            if claimed.setdefault(node, coupling.name) != coupling.name:
                raise MeshError(
                    f"node {node} belongs to the rigid couplings '{claimed[node]}' and '{coupling.name}': "
                    "make one of them averaging, or keep their node sets apart"
                )


def _masters(count: int, rigid: Sequence[Coupling]) -> np.ndarray:
    """(N,) number of the node that stands for each node: itself, or N + k for a slave of rigid coupling k."""
    stands = np.arange(count)
    for k, coupling in enumerate(rigid):
        stands[coupling.nodes] = count + k
    return stands


def elimination(nodes: np.ndarray, rigid: Sequence[Coupling]) -> tuple[sp.csr_array, np.ndarray]:
    """T (3N, n) from the unknowns, free nodes first, then six of each master; and the node of each unknown."""
    count = len(nodes)
    stands = _masters(count, rigid)
    free = np.flatnonzero(stands < count)
    dofs = (3 * free[:, None] + np.arange(3)).ravel()
    rows, columns, values = [dofs], [np.arange(len(dofs))], [np.ones(len(dofs))]
    for k, coupling in enumerate(rigid):
        fields = rigid_fields(nodes[coupling.nodes] - coupling.point)
        at = (3 * coupling.nodes[:, None] + np.arange(3))[:, :, None]
        master = len(dofs) + 6 * k + np.arange(6)
        rows.append(np.broadcast_to(at, fields.shape).ravel())
        columns.append(np.broadcast_to(master, fields.shape).ravel())
        values.append(fields.ravel())
    size = len(dofs) + 6 * len(rigid)
    entries = (np.concatenate(values), tuple(np.concatenate(index).astype(np.int32) for index in (rows, columns)))
    transform = sp.coo_array(entries, shape=(3 * count, size)).tocsr()
    transform.eliminate_zeros()
    node_of_dof = np.concatenate([np.repeat(free, 3), np.repeat(count + np.arange(len(rigid)), 6)])
    return sp.csr_array(transform), node_of_dof


def _rigid_columns(nodes: np.ndarray, rigid: Sequence[Coupling]) -> np.ndarray:
    count = len(nodes)
    free = np.flatnonzero(_masters(count, rigid) < count)
    return np.vstack([rigid_modes(nodes[free]), *(master_rows(coupling.point) for coupling in rigid)])


def _interface(body: Elements, coupling: Coupling, transform: sp.csr_array, rigid: Sequence[Coupling]) -> Interface:
    components: tuple[str, ...] = COMPONENTS
    if coupling.kind == "rigid":
        k = [c.name for c in rigid].index(coupling.name)
        size = transform.shape[1]
        first = size - 6 * (len(rigid) - k)
        rows = sp.csr_array((np.ones(6), (np.arange(6), first + np.arange(6))), shape=(6, size))
    elif coupling.kind == "averaging":
        rows = rows_of(body, coupling) @ transform
    else:
        assert coupling.kind == "nodes" and len(coupling.nodes) == 1
        components = COMPONENTS[:3]
        rows = transform[3 * int(coupling.nodes[0]) + np.arange(3)]
    return Interface(coupling.name, sp.csr_array(rows), components, np.asarray(coupling.point, float), coupling.kind)


def _cells(body: Elements, rigid: Sequence[Coupling], springs: Springs | None) -> np.ndarray:
    """Node numbers of each element with masters for their slaves, each once, and a cell for each group of springs."""
    stands = _masters(len(body.nodes), rigid)
    cells = np.sort(stands[body.elements], axis=1)
    cells[:, 1:][cells[:, 1:] == cells[:, :-1]] = -1
    if springs is None:
        return cells
    touched = {tuple(np.unique(stands[springs.rows[[k]].indices // 3])) for k in range(len(springs.stiffness))}
    groups = [np.array(nodes) for nodes in sorted(touched)]
    width = max(cells.shape[1], *(len(group) for group in groups))
    result = np.full((len(cells) + len(groups), width), -1)
    result[: len(cells), : cells.shape[1]] = cells
    for k, group in enumerate(groups):
        result[len(cells) + k, : len(group)] = group
    return result
