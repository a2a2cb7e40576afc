"""Ring, sun and planet before reduction, as whole bodies without any symmetry: one input node a tooth, bore or mounts.

The method through cyclic symmetry (`sector`) takes far finer meshes; this one serves every method of reduction.
An imported sector is unfolded: its nodes and elements turned tooth by tooth, and so are ready-made matrices.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import hex20, solids
from gearfmu.femesh.cyclic_cut import CyclicCut
from gearfmu.femesh.imported import ImportedMesh
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry.mesh import mount_spaces
from gearfmu.geometry.plane import about_z
from gearfmu.reduction.couplings import Coupling, Elements, Springs, full_order, rows_of
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.files import elements_of, naming, set_coupling
from gearfmu.reduction.imported.flank import middle_node
from gearfmu.reduction.imported.gear import BORE, CheckedGear, checked_gear
from gearfmu.stagefile.forms.general import RingBody, ToothedBody
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.tables.bodies import MountsSpec

RING_SCALE = 0.4  # of the element counts in the file: about 100 000 unknowns instead of a million
GEAR_SCALE = 0.5


def toothed_full_order(gear: ToothedBody, mounts: MountsSpec | None = None, scale: float | None = None) -> FullOrder:
    """A whole gear with its input nodes tooth0 …, three displacements each, and the node of its bore, the ground when
    it is judged; a ring (one node a space) on the springs of its mounts, or free without them.

    scale : factor on all element counts, `RING_SCALE` or `GEAR_SCALE` when None; an imported gear has none. Raises
    MeshError.
    """
    body, numbers, held = _own_teeth(gear, mounts, scale) if gear.imported is None else _imported_teeth(gear, mounts)
    couplings = [Coupling(f"tooth{k}", "nodes", np.array([n]), body.nodes[n]) for k, n in enumerate(numbers)]
    length = gear_shape(gear).r
    if not isinstance(gear, RingBody):
        return full_order(gear.name, body, [*couplings, *held], ("bore",), length)
    springs = None
    if mounts is not None:  # on the mean displacement of each mount, alike in every direction
        rows = sp.vstack([rows_of(body, mount)[:3] for mount in held])
        springs = Springs(sp.csr_array(rows), np.full(3 * len(held), mounts.stiffness))
    return full_order(gear.name, body, couplings, (), length, springs)


def _own_teeth(
    gear: ToothedBody, mounts: MountsSpec | None, scale: float | None
) -> tuple[Elements, list[int], list[Coupling]]:
    """A gear meshed here: finite elements, one node a tooth, and its bore, averaging or rigid as the gear says; of a
    ring its mounts mount0 …, each the rim of the sector of its tooth space (`mount_spaces`), at the middle of that."""
    ring, counts = isinstance(gear, RingBody), gear.body.mesh
    factor = (RING_SCALE if ring else GEAR_SCALE) if scale is None else scale
    finer = counts.model_copy(update={"scale": counts.scale * factor})
    sector = gear_sector(gear_shape(gear), gear.face_width, finer)
    whole, node = sector.full(), _middle(sector)
    body = Elements(whole.nodes, whole.elements, *hex20.assemble(whole.nodes, whole.elements, gear.material))
    numbers = [int(sector.sector_nodes(k)[node]) for k in range(sector.teeth)]
    if not ring:
        kind = "rigid" if gear.rigid_bore else "averaging"
        return body, numbers, [Coupling("bore", kind, whole.sets["bore"], np.zeros(3))]
    held = []
    for k, space in enumerate(mount_spaces(sector.teeth, mounts.points) if mounts else ()):
        patch = sector.sector_nodes(space)[sector.sets["rim"]]
        held.append(Coupling(f"mount{k}", "averaging", patch, body.nodes[patch].mean(axis=0)))
    return body, numbers, held


def _middle(sector: FeMesh) -> int:
    """The node of flank sg = +1 nearest to the middle of the flank at mid-width."""
    grid = sector.flank[0]
    arc = grid.roll**2
    middle = 0.5 * (arc.min() + arc.max())
    width, length = np.ptp(grid.z), np.ptp(arc)
    distance = ((arc - middle) / length) ** 2 + (grid.z / width) ** 2
    return int(grid.quads.ravel()[distance.ravel().argmin()])


def _imported_teeth(gear: ToothedBody, mounts: MountsSpec | None) -> tuple[Elements, list[int], list[Coupling]]:
    """The whole imported gear: finite elements, one node a tooth, and its bore, or of a ring the patches of its rim
    that mounts hold. Raises MeshError."""
    found, source = checked_gear(gear), gear.imported
    assert source is not None
    mesh, matrices = found.mesh, found.matrices
    with naming(mesh.source):
        if (cut := found.cut) is not None:
            mesh = _unfolded(found, gear.teeth, mounts.points if mounts else 0)
            if matrices is not None:
                stiffness, mass = (_unfolded_matrix(matrix, cut, gear.teeth) for matrix in matrices)
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


def _unfolded_matrix(matrix: sp.csr_array, cut: CyclicCut, teeth: int) -> sp.csr_array:
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
