"""Meshes of carriers: quality, cuts, node sets, any number and place of planets; moments of ring and carrier."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from sections import carrier_moments, section
from test_many_gears import cut_gap

from gearfmu.errors import MeshError
from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import rigid_modes
from gearfmu.femesh.carrier import carrier_sector, whole_carrier
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.quality import scaled_jacobian, volume
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry.mesh import CarrierGeometry
from gearfmu.stagefile.forms.planetary import CarrierMeshSpec
from gearfmu.stagefile.forms.shapes import carrier_geometry, ring_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import MeshSpec

SPEC = load_stage("planetary54")
RING, WIDTH = ring_geometry(SPEC.written.ring, SPEC.written.set), SPEC.written.ring.face_width
CARRIER = carrier_geometry(SPEC.bodies["carrier"])
UNIT = SimpleNamespace(youngs_modulus=1.0, poisson_ratio=0.3, density=1.0)
COUNTS = MeshSpec(flank=6, thickness=2, root=3, rim=2, width=2)


@pytest.fixture(scope="module")
def carrier() -> FeMesh:
    return carrier_sector(CARRIER, CarrierMeshSpec(scale=0.5, sides=6))


def test_inertia_of_ring_and_carrier_is_the_analytic_one(carrier):
    """Consistent mass with density 1: mass = volume, polar inertia = polar moment, carrier's centre of mass."""
    (middle, about), (area, polar) = carrier_moments(CARRIER), section(RING)
    shapes = ((carrier, CARRIER.volume, about, middle), (None, RING.z * area * WIDTH, RING.z * polar * WIDTH, 0.0))
    for mesh, size, inertia, centre in shapes:
        sector = mesh or gear_sector(RING, WIDTH, COUNTS.model_copy(update={"width": 1}))
        fields = rigid_modes(sector.nodes)
        mass = fields.T @ (hex20.assemble(sector.nodes, sector.elements, UNIT)[1] @ fields)
        assert sector.teeth * mass[0, 0] == pytest.approx(size, rel=1e-4)
        assert sector.teeth * mass[5, 5] == pytest.approx(inertia, rel=1e-4)
        assert mass[0, 4] / mass[0, 0] == pytest.approx(centre, rel=1e-4, abs=1e-12)


def test_carrier_elements_are_good_cuts_match_and_sets_are_the_seats(carrier):
    assert scaled_jacobian(carrier).min() > 0.4
    assert cut_gap(carrier) < 1e-15
    seat = carrier.nodes[carrier.sets["bolt"]]
    assert np.hypot(seat[:, 0] - CARRIER.a, seat[:, 1]) == pytest.approx(CARRIER.r_bolt, rel=1e-12)
    assert (seat[:, 2].min(), seat[:, 2].max()) == (-10e-3, 10e-3)
    assert np.hypot(*carrier.nodes[carrier.sets["bore"], :2].T) == pytest.approx(CARRIER.r_bore, rel=1e-12)
    faces = surface.faces_within(carrier.elements, carrier.sets["bolt"]).quads
    points = carrier.nodes[faces]
    area = np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 3] - points[:, 0]), axis=1).sum()
    assert area == pytest.approx(2 * math.pi * CARRIER.r_bolt * CARRIER.seat, rel=0.03)


def evenly(planets: int) -> tuple[float, ...]:
    return tuple(2 * math.pi * k / planets for k in range(planets))


@pytest.mark.parametrize("planets", [3, 5, 6])
def test_carriers_with_other_numbers_of_planets_mesh(planets):
    g = CarrierGeometry(evenly(planets), 45e-3, 20e-3, 60e-3, 8e-3, 12e-3, 2e-3, 20e-3)
    mesh = carrier_sector(g, CarrierMeshSpec(scale=0.5))
    assert scaled_jacobian(mesh).min() > 0.15 and cut_gap(mesh) < 1e-14
    assert planets * volume(mesh) == pytest.approx(g.volume, rel=2e-4)


def test_bolts_stand_where_unequally_spaced_planets_are():
    """72 teeth of sun and ring, five planets: two of the steps are longer than the others."""
    uneven = tuple(turn / 72 for turn in (0, 14, 29, 43, 58))
    g = carrier_geometry(SPEC.bodies["carrier"].model_copy(update={"bolts": uneven}))
    sector = carrier_sector(g, CarrierMeshSpec(scale=0.5))
    mesh = whole_carrier(g, sector)
    for k, turn in enumerate((0, 14, 29, 43, 58)):
        x, y, _ = g.bolt_axis(k)
        assert math.atan2(y, x) == pytest.approx(math.remainder(2 * math.pi * turn / 72, 2 * math.pi), abs=1e-12)
        seat = mesh.nodes[sector.sector_nodes(k)[sector.sets["bolt"]]]
        assert np.hypot(seat[:, 0] - x, seat[:, 1] - y) == pytest.approx(g.r_bolt, rel=1e-12)
    assert scaled_jacobian(mesh).min() > 0.15
    assert volume(mesh) == pytest.approx(g.volume, rel=5e-4)
    with pytest.raises(MeshError, match="move the planets apart"):
        whole_carrier(replace(g, angles=(0.0, 0.4, *g.angles[2:])), sector)


def test_bolts_without_room_are_refused():
    crowded = CarrierGeometry(evenly(8), 45e-3, 20e-3, 60e-3, 17e-3, 12e-3, 2e-3, 20e-3)
    with pytest.raises(MeshError, match="give the bolts more room"):
        carrier_sector(crowded, CarrierMeshSpec(scale=0.5))
