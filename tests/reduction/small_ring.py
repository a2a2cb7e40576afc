"""A small ring (z = 24, m_n = 2.5 mm, six mounts), spur or helical, on a coarse mesh by one sector."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.reduction.cyclic.flank import tooth_flank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import ring_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import BodySpec, MeshSpec, MountsSpec, RingSpec

COARSE = MeshSpec(flank=4, thickness=1, root=2, rim=1, width=2)
MOUNTS = MountsSpec(points=6, stiffness=5e7)
SPEC = RingSpec(
    teeth=24, tip_diameter=57.6e-3, rim_diameter=76e-3, face_width=8e-3, mounts=MOUNTS,
    body=BodySpec(strip_half_width=5e-4, modes=81, roll_points=4, width_functions=3, mesh=COARSE),
    material=load_stage("planetary54").written.ring.material,
)  # fmt: skip
GEOMETRY = ring_geometry(SPEC, load_stage("planetary54").written.set)


def set_spec() -> Stage:
    """planetary54 with the small ring, for builders that take a whole set."""
    return rewritten(load_stage("planetary54"), ring=SPEC)


def geometry(beta: float) -> InternalGearGeometry:
    """The ring with another helix angle (rad): what stands off its reference circle goes with it."""
    own = replace(GEOMETRY, beta=beta)
    grown = own.r - GEOMETRY.r
    return replace(own, r_a=own.r_a + grown, r_f=own.r_f + grown, r_rim=own.r_rim + grown)


def body(beta: float = 0.0, mesh: MeshSpec = COARSE) -> SectorBody:
    own = geometry(beta)
    return SectorBody(gear_sector(own, SPEC.face_width, mesh), SPEC.material, *tooth_flank(own, SPEC))


@cache
def coarse(beta: float = 0.0) -> SectorBody:
    return body(beta)
