"""Meshes of ring and carrier: volumes, moments, quality, cuts, flanks on the involute, node sets; many rings."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st
from sections import carrier_moments, section

from gearfmu.errors import MeshError
from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import rigid_modes
from gearfmu.femesh.carrier import carrier_sector, whole_carrier
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.quality import mesh_report, scaled_jacobian, volume
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry.gear import InternalGearGeometry
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


def cut_gap(mesh: FeMesh) -> float:
    angle = 2 * math.pi / mesh.teeth
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    return float(np.abs(mesh.nodes[mesh.cut_minus] @ turn.T - mesh.nodes[mesh.cut_plus]).max())


@pytest.fixture(scope="module")
def ring() -> FeMesh:
    return gear_sector(RING, WIDTH, COUNTS)


@pytest.fixture(scope="module")
def carrier() -> FeMesh:
    return carrier_sector(CARRIER, CarrierMeshSpec(scale=0.5, sides=6))


def test_volume_of_the_ring_converges_to_the_analytic_one():
    errors = [
        volume(gear_sector(RING, WIDTH, COUNTS.model_copy(update={"scale": s}))) / (section(RING)[0] * WIDTH) - 1
        for s in (1, 2)
    ]
    assert abs(errors[0]) < 2e-5 and abs(errors[1]) < abs(errors[0]) / 4


def test_ring_elements_are_good_and_cuts_match(ring):
    assert scaled_jacobian(ring).min() > 0.6
    assert cut_gap(ring) < 1e-15
    assert mesh_report(ring, RING.r_b, 4e-4)["flank_elements"] == [6, 2]


def test_flank_nodes_lie_on_the_involute_with_normals_out_of_the_material(ring):
    for side, sg in ((0, 1), (1, -1)):
        grid = ring.flank[side]
        points = ring.nodes[grid.quads]
        assert np.abs(points[..., :2] - RING.flank_point(grid.roll, sg)).max() < 1e-16
        assert (grid.roll.min(), grid.roll.max()) == (RING.s_tip, RING.s_form)
        edges = points[:, 1] - points[:, 0], points[:, 3] - points[:, 0]
        normal = np.cross(*edges)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        assert (normal[:, :2] * RING.flank_normal(grid.roll.mean(axis=1), sg)).sum(axis=1).min() > 0.999
        boundary = {tuple(sorted(face)) for face in surface.boundary_faces(ring.elements).tolist()}
        assert {tuple(sorted(quad)) for quad in grid.quads.tolist()} <= boundary


def test_rim_of_the_ring_is_its_outer_surface(ring):
    radius = np.hypot(ring.nodes[:, 0], ring.nodes[:, 1])
    assert set(np.flatnonzero(radius > RING.r_rim * (1 - 1e-9))) == set(ring.sets["rim"])


def test_whole_ring_joins_its_sectors(ring):
    full = ring.full()
    owned = len(ring.nodes) - len(ring.cut_plus)
    assert len(full.nodes) == RING.z * owned == len(np.unique(np.round(full.nodes, 10), axis=0))
    assert volume(full) == pytest.approx(RING.z * volume(ring), rel=1e-12)


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


def test_default_carrier_has_about_150_000_unknowns():
    full = carrier_sector(CARRIER, SPEC.written.carrier.mesh).full()
    assert 140e3 < 3 * len(full.nodes) < 160e3
    assert len(np.unique(np.round(full.nodes, 10), axis=0)) == len(full.nodes)


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


@settings(max_examples=25, derandomize=True)
@given(
    z=st.integers(36, 160), x=st.floats(-0.3, 0.5), tip=st.floats(0.5, 0.9), fillet=st.floats(0.1, 0.3),
    rim=st.floats(1.1, 6), scale=st.sampled_from([0.5, 1.0]),
)  # fmt: skip
def test_many_rings_mesh_well(z, x, tip, fillet, rim, scale):
    m, r = 2e-3, 1e-3 * z
    r_f = r + m * (x + 1.25)
    ring = InternalGearGeometry(
        z, m, math.radians(20), x, r + m * (x - tip), r_f, r_f + rim * m, 0.04 * m, fillet * m
    )  # fmt: skip
    if ring.s_tip <= 0 or ring.fillet_centre[1] <= 0 or ring.tip_land_half_angle < 0:
        event("no such ring")
        return
    mesh = gear_sector(ring, 5 * m, MeshSpec(width=1, scale=scale))
    assert scaled_jacobian(mesh).min() > 0.35
    assert volume(mesh) == pytest.approx(section(ring)[0] * 5 * m, rel=5e-4)
    assert cut_gap(mesh) < 1e-12 * r + 1e-15
