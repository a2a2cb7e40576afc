"""An imported gear before reduction, with all its teeth: what `toothed` makes of our own meshes, for every method.

A sector is unfolded: its nodes and elements turned tooth by tooth, and so are ready-made matrices.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import solids
from gearfmu.femesh.cyclic_cut import CyclicCut
from gearfmu.femesh.imported import ImportedMesh
from gearfmu.femesh.mesh import FeMesh
from gearfmu.geometry.mesh import mount_spaces
from gearfmu.geometry.plane import about_z
from gearfmu.reduction.couplings import Coupling, Springs, full_order
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.couplings import Matrices, elements_of, set_coupling
from gearfmu.reduction.imported.flank import middle_node
from gearfmu.reduction.imported.gear import BORE, CheckedGear, Wanted
from gearfmu.stagefile.tables.bodies import MountsSpec


def imported_gear_order(
    found: CheckedGear,
    wanted: Wanted,
    name: str,
    length: float,
    coupling: str,
    mounts: MountsSpec | None = None,
) -> FullOrder:
    """The whole imported gear with one input node a tooth, tooth0 …, and the node of its bore, its ground when judged;
    a ring (one node a space) on the springs of its mounts, or free without them.

    length : m, that scales rotations. coupling : of its bore. Raises MeshError.
    """
    mesh, matrices = _whole(found, wanted, mounts)
    faces, body = solids.boundary(mesh.elements), elements_of(mesh, matrices, wanted.material)
    couplings = []
    for tooth in range(wanted.teeth):
        node = middle_node(mesh.nodes, faces, wanted.flank, 2 * np.pi * tooth / wanted.teeth)
        couplings.append(Coupling(f"tooth{tooth}", "nodes", np.array([node]), mesh.nodes[node]))
    if not wanted.flank.internal:
        couplings.append(set_coupling(mesh, faces, BORE, coupling, np.zeros(3)))
        return full_order(name, body, couplings, (BORE,), length)
    springs = None
    if mounts is not None:
        patches = [set_coupling(mesh, faces, own) for own in mesh.sets if own != BORE]
        rows = [patch.rows[:3] for patch in patches if patch.rows is not None]
        springs = Springs(sp.csr_array(sp.vstack(rows)), np.full(3 * len(rows), mounts.stiffness))
    return full_order(name, body, couplings, (), length, springs)


def _whole(found: CheckedGear, wanted: Wanted, mounts: MountsSpec | None) -> tuple[ImportedMesh, Matrices | None]:
    """All teeth of a checked gear, and their ready-made matrices or None."""
    mesh, ready = found.mesh, found.matrices
    if found.cut is not None:
        mesh = _unfolded(mesh, found.cut, wanted.teeth, mounts.points if mounts else 0)
        if ready is not None:
            stiffness, mass = (unfolded_matrix(matrix, found.cut, wanted.teeth) for matrix in ready)
            ready = stiffness, mass
    return mesh, ready


def _unfolded(mesh: ImportedMesh, cut: CyclicCut, teeth: int, mounts: int) -> ImportedMesh:
    """All sectors, with the sets of bore or rim and of the patches that the mounts hold."""
    nodes, numbers = _numbers(cut, teeth)
    bore = np.flatnonzero(np.isin(cut.of_mesh, mesh.sets[BORE]))
    return replace(
        mesh,
        nodes=nodes,
        elements={kind: np.concatenate([n[block] for n in numbers]) for kind, block in cut.elements.items()},
        sets={BORE: np.unique(np.concatenate([n[bore] for n in numbers]))}
        | {f"mount{k}": numbers[space][bore] for k, space in enumerate(mount_spaces(teeth, mounts))},
        labels=np.full(len(nodes), -1),
    )


def unfolded_matrix(matrix: sp.csr_array, cut: CyclicCut, teeth: int) -> sp.csr_array:
    """Matrix of the whole body, over the nodes of all sectors, from the (3n, 3n) one of a sector: its turned copies
    added at the nodes that they share."""
    nodes, numbers = _numbers(cut, teeth)
    whole = sp.csr_array((nodes.size, nodes.size))
    for tooth, number in enumerate(numbers):
        turn = sp.kron(sp.identity(len(number)), about_z(2 * np.pi * tooth / teeth), format="csr")
        dofs = (3 * number[:, None] + np.arange(3)).ravel()
        turned = sp.coo_array(turn @ matrix @ turn.T)
        row, column = turned.coords
        whole = whole + sp.coo_array((turned.data, (dofs[row], dofs[column])), whole.shape).tocsr()
    return sp.csr_array(whole)


def _numbers(cut: CyclicCut, teeth: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """Nodes (N, 3) of the whole body, and for each sector the numbers (n,) of its nodes among them."""
    sector = FeMesh(cut.nodes, np.empty((0, 20), int), {}, teeth, cut.cut_minus, cut.cut_plus)
    return sector.full().nodes, [sector.sector_nodes(k) for k in range(teeth)]
