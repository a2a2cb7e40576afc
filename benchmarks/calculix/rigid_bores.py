"""Our gears with rigid bores, to compare like with like where CalculiX's bores are clamped node by node.

A massless sleeve, STIFF times as stiff as steel, fills part of the bore: the bore then moves as a rigid body, while the
gear stays free and cyclic, and all of the reduction is the same. Only the static tables are made: `te` needs no more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp

from gearfmu.body import ReducedBody, load_stage_bodies
from gearfmu.body.reduce import tooth_flank
from gearfmu.fem import hex20, surface
from gearfmu.fem.cyclic import Sector, sector_spaces
from gearfmu.femesh import FeMesh, gear_sector
from gearfmu.geometry import GearGeometry
from gearfmu.reduction.flank import Points, ToothFlank
from gearfmu.reduction.sector import SectorBody
from gearfmu.reduction.statics import static_tables
from gearfmu.spec.gear import GearSpec
from gearfmu.spec.stage import StageSpec

STIFF, INNER = 1e5, 0.7  # Young's modulus of the sleeve, parts of the gear's; its inner radius, parts of the bore's


def rigid_bore_bodies(spec: StageSpec) -> list[ReducedBody]:
    """The stored bodies of a pair with the static tables of gears whose bores are rigid. Their modes stay as they were:
    of use at level rigid only."""
    return [with_rigid_bore(spec, index, body) for index, body in enumerate(load_stage_bodies(spec))]


def with_rigid_bore(spec: StageSpec, index: int, stored: ReducedBody) -> ReducedBody:
    """The body of gear `index` with the static tables of a gear whose bore is rigid."""
    gear = spec.gears[index]
    geometry = GearGeometry.of(gear, spec.pair, (1, -1)[index])
    flank, points = tooth_flank(geometry, gear, False)
    body = SleevedBody(sleeved(gear_sector(geometry, gear.face_width, gear.body.mesh)), gear, flank, points)
    tables = static_tables(body, [], lambda what, share: None)
    return replace(stored, static_ff=tables.static_ff, static_fb=tables.static_fb, static_bb=tables.static_bb)


@dataclass(frozen=True)
class Sleeved:
    """A gear's sector and, after its nodes and elements, those of the sleeve; "bore" is the sleeve's inner surface."""

    mesh: FeMesh
    elements: int


class SleevedBody(SectorBody):
    """A SectorBody of two materials, the second without mass."""

    def __init__(self, sleeve: Sleeved, gear: GearSpec, flank: ToothFlank, points: Points):
        mesh, count = sleeve.mesh, sleeve.elements
        self.mesh, self.flank, self.points, self.teeth, self.internal = mesh, flank, points, mesh.teeth, False
        steel = gear.material
        stiff = SimpleNamespace(
            youngs_modulus=STIFF * steel.youngs_modulus, poisson_ratio=steel.poisson_ratio, density=0.0
        )
        parts = [
            hex20.assemble(mesh.nodes, elements, material)
            for elements, material in ((mesh.elements[:count], steel), (mesh.elements[count:], stiff))
        ]
        self.stiffness, self.mass_matrix = sp.csr_array(parts[0][0] + parts[1][0]), parts[0][1]
        self.spaces = sector_spaces(
            Sector(
                mesh.nodes, mesh.elements, self.stiffness, self.mass_matrix, mesh.teeth, mesh.cut_minus, mesh.cut_plus,
                bool(flank.base_helix_angle),
            )
        )  # fmt: skip
        self._inputs = [self._space_inputs(space) for space in self.spaces]


def sleeved(mesh: FeMesh) -> Sleeved:
    """The sector with one layer of elements inside the bore."""
    faces = surface.faces_within(mesh.elements, mesh.sets["bore"])
    used = np.unique(faces)
    corners = np.unique(faces[:, :4])
    inner, middle = (np.full(len(mesh.nodes), -1) for _ in range(2))
    inner[used] = len(mesh.nodes) + np.arange(len(used))
    middle[corners] = len(mesh.nodes) + len(used) + np.arange(len(corners))
    radial = np.array([1.0, 1.0, 0.0])
    nodes = np.concatenate(
        [
            mesh.nodes,
            mesh.nodes[used] * (1 - (1 - INNER) * radial),
            mesh.nodes[corners] * (1 - (1 - INNER) / 2 * radial),
        ]
    )
    elements = np.hstack([faces[:, :4], inner[faces[:, :4]], faces[:, 4:], inner[faces[:, 4:]], middle[faces[:, :4]]])
    cuts = []
    for cut in (mesh.cut_minus, mesh.cut_plus):
        more = np.concatenate([inner[cut], middle[cut]])
        cuts.append(np.concatenate([cut, more[more >= 0]]))
    whole = replace(
        mesh,
        nodes=nodes,
        elements=np.concatenate([mesh.elements, elements]),
        sets=mesh.sets | {"bore": inner[used]},
        cut_minus=cuts[0],
        cut_plus=cuts[1],
    )
    return Sleeved(whole, len(mesh.elements))
