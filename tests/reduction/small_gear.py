"""A small gear (z = 12, m = 2.5 mm) on a coarse mesh, and the same gear as one whole finite-element model."""

from __future__ import annotations

import math
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
from blocks import free_body

from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import averaging_rows
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import GearGeometry
from gearfmu.reduction.cyclic.flank import Points, ToothFlank, flank_loads
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.stagefile.tables.bodies import MeshSpec

STEEL = SimpleNamespace(youngs_modulus=206e9, poisson_ratio=0.3, density=7850.0)
WIDTH = 8e-3
MODULE = 2.5e-3
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


def flank(half_width: float = 3e-4) -> ToothFlank:
    return ToothFlank(GEAR.r_b, GEAR.psi_b, GEAR.s_form, GEAR.s_tip, WIDTH, half_width)


def body(mesh: MeshSpec = COARSE, rolls: int = 4, functions: int = 3) -> SectorBody:
    shape = flank()
    return SectorBody(gear_sector(GEAR, WIDTH, mesh), STEEL, shape, Points(shape.chebyshev_rolls(rolls), functions))


@lru_cache(maxsize=1)
def coarse() -> SectorBody:
    return body()


@lru_cache(maxsize=1)
def whole() -> SimpleNamespace:
    """The coarse gear without any symmetry: free body, flank rows (2·R·A, 3N) of every tooth, bore rows (6, 3N)."""
    sector, full = coarse().mesh, coarse().mesh.full()
    free = free_body(*hex20.assemble(full.nodes, full.elements, STEEL), full.nodes, full.elements)
    rows = []
    for tooth in range(GEAR.z):
        index = sector.sector_nodes(tooth)
        angle = 2 * np.pi * tooth / GEAR.z
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        local = coarse().flank_rows.reshape(-1, len(sector.nodes), 3)
        whole_rows = np.zeros((len(local), len(full.nodes), 3))
        np.add.at(whole_rows, (slice(None), index), local @ turn.T)
        rows.append(whole_rows.reshape(len(local), -1))
    bore = averaging_rows(full.nodes, surface.faces_within(full.elements, full.sets["bore"]))
    own = np.concatenate([flank_loads(full.nodes, full.flank[s].quads, flank(), s, coarse().points) for s in (0, 1)])
    return SimpleNamespace(free=free, flank_rows=np.array(rows), bore_rows=bore, tooth_0=own.reshape(len(rows[0]), -1))
