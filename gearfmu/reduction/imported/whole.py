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
from gearfmu.reduction.couplings import Coupling, Elements
from gearfmu.reduction.imported.couplings import elements_of, set_coupling
from gearfmu.reduction.imported.files import naming
from gearfmu.reduction.imported.flank import middle_node
from gearfmu.reduction.imported.gear import BORE, CheckedGear, checked_gear
from gearfmu.stagefile.forms.general import ToothedBody
from gearfmu.stagefile.forms.planetary import MountsSpec


def imported_teeth(gear: ToothedBody, mounts: MountsSpec | None) -> tuple[Elements, list[int], list[Coupling]]:
    """The whole imported gear: finite elements, one node a tooth, and its bore, or of a ring the patches of its rim
    that mounts hold. Raises MeshError."""
    found, source = checked_gear(gear), gear.imported
    assert source is not None
    mesh, matrices = found.mesh, found.matrices
    with naming(mesh.source):
        if (cut := found.cut) is not None:
            mesh = _unfolded(found, gear.teeth, mounts.points if mounts else 0)
            if matrices is not None:
                stiffness, mass = (unfolded_matrix(matrix, cut, gear.teeth) for matrix in matrices)
                matrices = stiffness, mass
        faces, body = solids.boundary(mesh.elements), elements_of(mesh, matrices, gear.material)
        angles = 2 * np.pi * np.arange(gear.teeth) / gear.teeth
        numbers = [middle_node(mesh.nodes, faces, found.flank, angle) for angle in angles]
        if found.flank.internal:
            return body, numbers, [set_coupling(mesh, faces, own) for own in mesh.sets if own != BORE]
        return body, numbers, [set_coupling(mesh, faces, BORE, source.bore_coupling, np.zeros(3))]


def _unfolded(found: CheckedGear, teeth: int, mounts: int) -> ImportedMesh:
    """All sectors, with the sets of bore or rim and of the patches that the mounts hold."""
    assert (cut := found.cut) is not None
    (nodes, numbers), bore = _numbers(cut, teeth), found.bore_of_cut
    return replace(
        found.mesh,
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
