"""A small ring (z = 24, m_n = 2.5 mm, six mounts), spur or helical, on a coarse mesh: by one sector, and as one whole
model."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp
from blocks import free_body

from gearfmu.fem import hex20
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.reduction.couplings import Elements
from gearfmu.reduction.cyclic.flank import flank_loads, tooth_flank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.toothed import mount_springs, ring_mounts
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.planetary import MountsSpec, RingSpec
from gearfmu.stagefile.forms.shapes import ring_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import BodySpec, MeshSpec

COARSE = MeshSpec(flank=4, thickness=1, root=2, rim=1, width=2)
MOUNTS = MountsSpec(points=6, stiffness=5e7)


def ring_spec(modes: int = 81, mounts: MountsSpec | None = MOUNTS) -> RingSpec:
    body = BodySpec(strip_half_width=5e-4, modes=modes, roll_points=4, width_functions=3, mesh=COARSE)
    return RingSpec(
        teeth=24, tip_diameter=57.6e-3, rim_diameter=76e-3, face_width=8e-3, mounts=mounts, body=body,
        material=load_stage("planetary54").written.ring.material,
    )  # fmt: skip


def set_spec(**changes) -> Stage:
    """planetary54 with the small ring, for builders that take a whole set."""
    return rewritten(load_stage("planetary54"), ring=ring_spec(**changes))


GEOMETRY = ring_geometry(ring_spec(), load_stage("planetary54").written.set)
STEEL = ring_spec().material


def geometry(beta: float) -> InternalGearGeometry:
    """The ring with another helix angle (rad): what stands off its reference circle goes with it."""
    own = replace(GEOMETRY, beta=beta)
    grown = own.r - GEOMETRY.r
    return replace(own, r_a=own.r_a + grown, r_f=own.r_f + grown, r_rim=own.r_rim + grown)


@lru_cache(maxsize=4)
def coarse(beta: float = 0.0) -> SectorBody:
    own = geometry(beta)
    return SectorBody(gear_sector(own, 8e-3, COARSE), STEEL, *tooth_flank(own, ring_spec()))


@lru_cache(maxsize=2)
def whole(beta: float = 0.0) -> SimpleNamespace:
    """Without symmetry: free body, flank rows (2·R·A, 3N) of every space, mounts and their springs."""
    made = coarse(beta)
    sector, full = made.mesh, made.mesh.full()
    free = free_body(*hex20.assemble(full.nodes, full.elements, STEEL), full.nodes, full.elements)
    rows = [whole_rows(made.flank_rows, tooth) for tooth in range(GEOMETRY.z)]
    elements = Elements(full.nodes, full.elements, free.stiffness, free.mass_matrix)
    mounts = ring_mounts(sector, elements, MOUNTS)
    own = [flank_loads(full.nodes, full.flank[s].quads, made.flank, s, made.points) for s in (0, 1)]
    return SimpleNamespace(
        free=free, flank_rows=np.array(rows), springs=mount_springs(elements, mounts, MOUNTS.stiffness),
        elements=elements, mounts=mounts, space_0=np.concatenate(own).reshape(len(rows[0]), -1),
    )  # fmt: skip


def whole_rows(rows: np.ndarray, tooth: int) -> np.ndarray:
    """Rows (m, 3N) of sector 0 on the whole body's nodes, at another sector."""
    sector = coarse().mesh
    count = GEOMETRY.z * (len(sector.nodes) - len(sector.cut_plus))
    result = np.zeros((len(rows), count, 3))
    local = rows.reshape(len(rows), -1, 3) @ turn(tooth).T
    np.add.at(result, (slice(None), sector.sector_nodes(tooth)), local)
    return result.reshape(len(rows), -1)


def turn(tooth: int) -> np.ndarray:
    """(3, 3): vectors in the frame of a sector → in the body's frame."""
    angle = 2 * np.pi * tooth / GEOMETRY.z
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


@lru_cache(maxsize=1)
def mounted_stiffness() -> sp.csr_array:
    """K of the whole ring with its six springs."""
    springs = whole().springs
    return sp.csr_array(whole().free.stiffness + springs.rows.T @ sp.diags_array(springs.stiffness) @ springs.rows)
