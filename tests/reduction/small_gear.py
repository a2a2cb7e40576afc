"""Small gears (z = 12, m_n = 2.5 mm), spur and helical, on a coarse mesh, by one sector; and any body by one sector as
whole finite elements."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace

import numpy as np
from blocks import free_body

from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import averaging_rows
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import GearGeometry
from gearfmu.geometry.plane import about_z
from gearfmu.reduction.couplings import Elements
from gearfmu.reduction.cyclic.flank import Points, ToothFlank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.elastic import Elastic
from gearfmu.stagefile.tables.bodies import MeshSpec

STEEL = SimpleNamespace(youngs_modulus=206e9, poisson_ratio=0.3, density=7850.0)
WIDTH = 8e-3
MODULE = 2.5e-3
BETA = math.radians(20)
GEAR = GearGeometry(
    z=12,
    m=MODULE,
    alpha=math.radians(20),
    x=0.35,
    r_a=18.2e-3,
    r_bore=5e-3,
    tip_edge=2e-4,
    h_fp=1.25 * MODULE,
    rho_fp=0.38 * MODULE,
)
COARSE = MeshSpec(flank=4, thickness=1, root=2, rim=1, width=2)
FINER = MeshSpec(flank=16, thickness=3, root=4, rim=2, width=4)


def gear(beta: float) -> GearGeometry:
    """The small spur gear with another helix angle (rad) and the tip circle that goes with it."""
    own = replace(GEAR, beta=beta)
    return replace(own, r_a=GEAR.r_a + own.r - GEAR.r)


def flank(half_width: float = 3e-4, shape: GearGeometry = GEAR) -> ToothFlank:
    return ToothFlank(
        shape.r_b, shape.psi_b, shape.s_form, shape.s_tip, WIDTH, half_width, base_helix_angle=shape.beta_b
    )


def body(beta: float = 0.0, mesh: MeshSpec = COARSE, rolls: int = 4, functions: int = 3) -> SectorBody:
    own = flank(shape=gear(beta))
    return SectorBody(gear_sector(gear(beta), WIDTH, mesh), STEEL, own, Points(own.chebyshev_rolls(rolls), functions))


@cache
def coarse(beta: float = 0.0) -> SectorBody:
    return body(beta)


@dataclass(frozen=True, eq=False)
class Whole:
    """A body without any symmetry: its sector, its finite elements, and these as a free body."""

    sector: SectorBody
    elements: Elements
    free: Elastic

    def loads(self, tooth: int) -> np.ndarray:
        """(m, 3N): all loads of a tooth, as those of tooth 0 in the sector (`load_matrix`), turned."""
        mesh, rows = self.sector.mesh, self.sector.load_matrix.toarray()
        result = np.zeros((len(rows), len(self.elements.nodes), 3))
        local = rows.reshape(len(rows), -1, 3) @ about_z(2 * np.pi * tooth / mesh.teeth).T
        np.add.at(result, (slice(None), mesh.sector_nodes(tooth)), local)
        return result.reshape(len(rows), -1)

    def held_rows(self) -> np.ndarray:
        """(6, 3N): the averaging node of the bore, of a ring that of its rim."""
        nodes = self.sector.mesh.full().sets["rim" if self.sector.internal else "bore"]
        return averaging_rows(self.elements.nodes, surface.faces_within(self.elements.elements, nodes))


@cache
def whole(sector: SectorBody) -> Whole:
    full = sector.mesh.full()
    elements = Elements(full.nodes, full.elements, *hex20.assemble(full.nodes, full.elements, sector.material))
    return Whole(sector, elements, free_body(elements.stiffness, elements.mass, full.nodes, full.elements))
