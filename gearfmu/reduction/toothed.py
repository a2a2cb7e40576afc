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
from gearfmu.reduction.couplings import Coupling, Elements, Springs, averaging, full_order
from gearfmu.reduction.full_order import FullOrder
from gearfmu.stagefile.forms.general import GearBody, RingBody
from gearfmu.stagefile.forms.shapes import gear_geometry, ring_geometry
from gearfmu.stagefile.tables.bodies import MountsSpec

RING_SCALE = 0.4  # of the element counts in the file: about 100 000 unknowns instead of a million
GEAR_SCALE = 0.5


def ring_full_order(
    ring: RingBody, mounts: MountsSpec | None = None, scale: float = RING_SCALE, mounted: bool = True
) -> FullOrder:
    """A ring with its input nodes tooth0 …, three displacements each.

    mounted : the springs of its mounts are in the stiffness, and nothing else holds it. Otherwise the body is free, and
    the mounts (averaging nodes mount0 …) are interfaces and the ground when it is judged.
    """
    geometry, counts = ring_geometry(ring, ring, 1), ring.body.mesh
    sector = gear_sector(geometry, ring.face_width, counts.model_copy(update={"scale": counts.scale * scale}))
    body = _whole(sector, ring.material)
    couplings, patches = _teeth(sector, body), ring_mounts(sector, body, mounts)
    if mounted and mounts is not None:
        springs = mount_springs(body, patches, mounts.stiffness)
        return full_order(ring.name, body, couplings, (), geometry.r, springs)
    ground = tuple(patch.name for patch in patches)
    return full_order(ring.name, body, [*couplings, *patches], ground, geometry.r)


def gear_full_order(gear: GearBody, scale: float = GEAR_SCALE) -> FullOrder:
    """An external gear with one input node a tooth and the node of its bore (averaging, or rigid
    where the gear says so), which is the ground when it is judged."""
    geometry, counts = gear_geometry(gear, gear, 1), gear.body.mesh
    sector = gear_sector(geometry, gear.face_width, counts.model_copy(update={"scale": counts.scale * scale}))
    body = _whole(sector, gear.material)
    kind = "rigid" if gear.rigid_bore else "averaging"
    bore = Coupling("bore", kind, sector.full().sets["bore"], np.zeros(3))
    return full_order(gear.name, body, [*_teeth(sector, body), bore], ("bore",), geometry.r)


def ring_mounts(sector: FeMesh, body: Elements, mounts: MountsSpec | None) -> list[Coupling]:
    """The mounts mount0 … of a whole ring: averaging nodes, each of the rim of one sector; none when `mounts` is None.

    Mount k holds the sector of its tooth space (`mount_spaces`); its point is the middle of that patch.
    """
    if mounts is None:
        return []
    couplings = []
    for k, space in enumerate(mount_spaces(sector.teeth, mounts.points)):
        patch = sector.sector_nodes(space)[sector.sets["rim"]]
        couplings.append(Coupling(f"mount{k}", "averaging", patch, body.nodes[patch].mean(axis=0)))
    return couplings


def mount_springs(body: Elements, mounts: list[Coupling], stiffness: float) -> Springs:
    """Springs on the mean displacement of each mount, `stiffness` (N/m) in every direction."""
    rows = sp.vstack([averaging(body, mount.nodes, mount.point)[:3] for mount in mounts])
    return Springs(sp.csr_array(rows), np.full(3 * len(mounts), stiffness))


def _whole(sector: FeMesh, material: hex20.Material) -> Elements:
    full = sector.full()
    return Elements(full.nodes, full.elements, *hex20.assemble(full.nodes, full.elements, material))


def _teeth(sector: FeMesh, body: Elements) -> list[Coupling]:
    """One node a tooth: that of flank sg = +1 nearest to the middle of the flank at mid-width."""
    node = _middle(sector)
    numbers = [int(sector.sector_nodes(k)[node]) for k in range(sector.teeth)]
    return [Coupling(f"tooth{k}", "nodes", np.array([n]), body.nodes[n]) for k, n in enumerate(numbers)]


def _middle(sector: FeMesh) -> int:
    grid = sector.flank[0]
    arc = grid.roll**2
    middle = 0.5 * (arc.min() + arc.max())
    width, length = np.ptp(grid.z), np.ptp(arc)
    distance = ((arc - middle) / length) ** 2 + (grid.z / width) ** 2
    return int(grid.quads.ravel()[distance.ravel().argmin()])
