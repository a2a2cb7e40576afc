"""Ring, sun and planet before reduction, as whole bodies without any symmetry: one input node a tooth, bore or mounts.

The method through cyclic symmetry (`sector`) takes far finer meshes; this one serves every method of reduction.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import hex20
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry.mesh import mount_spaces
from gearfmu.reduction.couplings import Coupling, Elements, Springs, full_order, rows_of
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.whole import imported_teeth
from gearfmu.stagefile.forms.general import RingBody, ToothedBody
from gearfmu.stagefile.forms.planetary import MountsSpec
from gearfmu.stagefile.forms.shapes import gear_shape

RING_SCALE = 0.4  # of the element counts in the file: about 100 000 unknowns instead of a million
GEAR_SCALE = 0.5


def toothed_full_order(gear: ToothedBody, mounts: MountsSpec | None = None, scale: float | None = None) -> FullOrder:
    """A whole gear with its input nodes tooth0 …, three displacements each, and the node of its bore, the ground when
    it is judged; a ring (one node a space) on the springs of its mounts, or free without them.

    scale : factor on all element counts, `RING_SCALE` or `GEAR_SCALE` when None; an imported gear has none. Raises
    MeshError.
    """
    body, numbers, held = _own_teeth(gear, mounts, scale) if gear.imported is None else imported_teeth(gear, mounts)
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
