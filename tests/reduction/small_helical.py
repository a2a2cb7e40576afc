"""Small helical gears (z = 12, m_n = 2.5 mm, β = ±20°) on a coarse mesh, and one of them as a whole finite-element
model."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache, lru_cache
from types import SimpleNamespace

import numpy as np
from blocks import free_body
from small_gear import GEAR, STEEL, WIDTH

from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import averaging_rows
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import GearGeometry
from gearfmu.reduction.cyclic.flank import Points, ToothFlank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.stagefile.tables.bodies import MeshSpec

BETA = math.radians(20)
COARSE = MeshSpec(flank=4, thickness=1, root=2, rim=1, width=2)


def gear(beta: float) -> GearGeometry:
    """The small spur gear with another helix angle (rad) and the tip circle that goes with it."""
    own = replace(GEAR, beta=beta)
    return replace(own, r_a=GEAR.r_a + own.r - GEAR.r)


def flank(shape: GearGeometry, half_width: float = 3e-4) -> ToothFlank:
    return ToothFlank(
        shape.r_b, shape.psi_b, shape.s_form, shape.s_tip, WIDTH, half_width, base_helix_angle=shape.beta_b
    )


def body(beta: float, mesh: MeshSpec = COARSE, rolls: int = 4, functions: int = 3) -> SectorBody:
    shape = gear(beta)
    own = flank(shape)
    return SectorBody(gear_sector(shape, WIDTH, mesh), STEEL, own, Points(own.chebyshev_rolls(rolls), functions))


@cache
def coarse(sign: int = 1) -> SectorBody:
    return body(sign * BETA)


@lru_cache(maxsize=1)
def whole() -> SimpleNamespace:
    """The coarse right-handed gear without any symmetry: free body, all load rows (4·R·A, 3N) of every tooth, bore."""
    sector, full = coarse().mesh, coarse().mesh.full()
    free = free_body(*hex20.assemble(full.nodes, full.elements, STEEL), full.nodes, full.elements)
    local = coarse().load_matrix.toarray().reshape(-1, len(sector.nodes), 3)
    rows = []
    for tooth in range(GEAR.z):
        whole_rows = np.zeros((len(local), len(full.nodes), 3))
        np.add.at(whole_rows, (slice(None), sector.sector_nodes(tooth)), local @ turned(tooth).T)
        rows.append(whole_rows.reshape(len(local), -1))
    bore = averaging_rows(full.nodes, surface.faces_within(full.elements, full.sets["bore"]))
    return SimpleNamespace(free=free, rows=np.array(rows), bore_rows=bore)


def turned(tooth: int) -> np.ndarray:
    """Turn (3, 3) by so many pitches."""
    angle = 2 * np.pi * tooth / GEAR.z
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
