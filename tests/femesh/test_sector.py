"""The sector meshes of gears and rings, spur and helical: exact flanks, paired cuts, volume, symmetry, joining."""

from __future__ import annotations

import math
from dataclasses import replace

import meshio
import numpy as np
import pytest
from sections import section

from gearfmu.errors import MeshError
from gearfmu.fem import hex20
from gearfmu.femesh.mesh import FeMesh, rotated
from gearfmu.femesh.quality import scaled_jacobian, volume, write_vtu
from gearfmu.femesh.section import graded, transfinite
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import GearGeometry
from gearfmu.stagefile.forms.shapes import gear_geometry, ring_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import MeshSpec

STAGE, SET = load_stage("fzg_c"), load_stage("planetary54").written
SHAPES = [gear_geometry(gear, STAGE.written.pair) for gear in STAGE.gears]
RING = ring_geometry(SET.ring, SET.set)
WIDTH = STAGE.gears[0].face_width
COARSE = MeshSpec(scale=0.4)
BODIES = {
    "pinion": SHAPES[0],
    "wheel": SHAPES[1],
    "helical": replace(SHAPES[1], beta=math.radians(20)),
    "ring": RING,
    "helical ring": replace(RING, beta=math.radians(-20), r_a=RING.r_a + 3e-3, r_f=RING.r_f + 3e-3),
}


@pytest.fixture(scope="module", params=BODIES)
def case(request: pytest.FixtureRequest) -> tuple[GearGeometry, FeMesh]:
    """A gear or ring and its sector."""
    shape = BODIES[request.param]
    return shape, gear_sector(shape, WIDTH, COARSE)


def untwisted(shape: GearGeometry, vectors: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Transverse parts (…, 2) of vectors at the heights z, as they stand in the section at mid-width."""
    c, s = np.cos(shape.twist * z), np.sin(shape.twist * z)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x + s * y, c * y - s * x], axis=-1)


def rows(points: np.ndarray) -> set[tuple[float, ...]]:
    return {tuple(row) for row in np.round(points * 1e9).astype(int).tolist()}


def test_flank_nodes_lie_on_the_involute_with_their_roll(case: tuple[GearGeometry, FeMesh]) -> None:
    shape, mesh = case
    for side, sg in ((0, 1), (1, -1)):
        grid = mesh.flank[side]
        points = mesh.nodes[grid.quads]
        assert np.abs(untwisted(shape, points, grid.z) - shape.flank_point(grid.roll, sg)).max() < 1e-15
        assert np.array_equal(points[..., 2], grid.z)
        assert [grid.roll.min(), grid.roll.max()] == sorted((shape.s_form, shape.s_tip))
        assert (grid.z.min(), grid.z.max()) == pytest.approx((-WIDTH / 2, WIDTH / 2))
        assert grid.quads.shape == (grid.shape[0] * grid.shape[1], 8)


def test_flank_faces_look_out_of_the_tooth_and_are_faces_of_elements(case: tuple[GearGeometry, FeMesh]) -> None:
    shape, mesh = case
    elements = [set(element) for element in mesh.elements.tolist()]
    for side, sg in ((0, 1), (1, -1)):
        grid = mesh.flank[side]
        corners = mesh.nodes[grid.quads[:, :4]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
        outward = shape.flank_normal(grid.roll.mean(axis=1), sg)
        across = untwisted(shape, normal, grid.z.mean(axis=1))
        assert (across * outward).sum(axis=1) == pytest.approx(np.linalg.norm(across, axis=1), rel=0.02)
        for quad in grid.quads[:: grid.shape[1]].tolist():
            assert sum(set(quad) <= element for element in elements) == 1
        # mid nodes (4 … 7) lie between the corners they belong to
        middle = 0.5 * (mesh.nodes[grid.quads[:, :4]] + mesh.nodes[grid.quads[:, [1, 2, 3, 0]]])
        assert np.abs(mesh.nodes[grid.quads[:, 4:]] - middle).max() < 0.1 * np.linalg.norm(
            corners[:, 2] - corners[:, 0]
        )


def test_flank_elements_are_equal_in_arc_length_and_halved_by_their_mid_nodes(
    case: tuple[GearGeometry, FeMesh],
) -> None:
    _, mesh = case
    grid = mesh.flank[0]
    arc = grid.roll**2
    length = np.ptp(arc[:, :4], axis=1)
    assert length == pytest.approx(length[0], rel=1e-10)
    assert arc[:, 4:].sum(axis=1) == pytest.approx(arc[:, :4].sum(axis=1), rel=1e-12)


def test_cuts_are_paired_by_the_rotation(case: tuple[GearGeometry, FeMesh]) -> None:
    shape, mesh = case
    turned = rotated(mesh.nodes[mesh.cut_minus], 2 * math.pi / shape.z)
    assert np.abs(turned - mesh.nodes[mesh.cut_plus]).max() < 1e-15
    flat = untwisted(shape, mesh.nodes, mesh.nodes[:, 2])
    on_cut = np.abs(np.arctan2(flat[:, 1], flat[:, 0]) - shape.half_pitch) < 1e-9
    assert set(np.flatnonzero(on_cut)) == set(mesh.cut_plus)
    assert len(set(mesh.cut_plus)) == len(mesh.cut_plus) == len(mesh.cut_minus)


def test_every_node_on_bore_or_rim_is_in_its_set(case: tuple[GearGeometry, FeMesh]) -> None:
    shape, mesh = case
    ((name, nodes),) = mesh.sets.items()
    radius = np.linalg.norm(mesh.nodes[:, :2], axis=1)
    there = radius > shape.r_rim * (1 - 1e-9) if name == "rim" else radius < shape.r_bore * (1 + 1e-9)
    assert set(np.flatnonzero(there)) == set(nodes)
    assert radius[nodes] == pytest.approx(shape.r_rim if name == "rim" else shape.r_bore, rel=1e-14)


def test_mesh_is_its_own_mirror_image(case: tuple[GearGeometry, FeMesh]) -> None:
    """Of a helical one turned over."""
    shape, mesh = case
    for mirror in ([1, -1, -1],) if shape.beta else ([1, 1, -1], [1, -1, 1]):
        assert rows(mesh.nodes) == rows(mesh.nodes * mirror)
        centres = mesh.nodes[mesh.elements].mean(axis=1)
        assert rows(centres) == rows(centres * mirror)


def test_no_two_nodes_coincide_and_all_are_used(case: tuple[GearGeometry, FeMesh]) -> None:
    _, mesh = case
    assert len(rows(mesh.nodes)) == len(mesh.nodes)
    assert np.array_equal(np.unique(mesh.elements), np.arange(len(mesh.nodes)))


@pytest.mark.parametrize("shape", SHAPES, ids=["pinion", "wheel"])
def test_volume_converges_to_the_section_with_high_order(shape: GearGeometry) -> None:
    """Curved quadratic edges leave fourth order at least."""
    exact = section(shape)[0] * WIDTH
    errors = [
        abs(volume(gear_sector(shape, WIDTH, MeshSpec(root=10, scale=scale, width=1))) / exact - 1)
        for scale in (0.5, 1, 2)
    ]
    assert errors[1] < 2e-6
    assert math.log2(errors[0] / errors[2]) / 2 > 3


def test_full_body_joins_all_sectors(case: tuple[GearGeometry, FeMesh]) -> None:
    shape, mesh = case
    full = mesh.full()
    assert len(full.nodes) == shape.z * (len(mesh.nodes) - len(mesh.cut_plus)) == len(rows(full.nodes))
    assert volume(full) == pytest.approx(shape.z * volume(mesh), rel=1e-13)
    assert (full.teeth, len(full.cut_plus), full.full()) == (1, 0, full)
    assert len(*full.sets.values()) == shape.z * np.setdiff1d(*mesh.sets.values(), mesh.cut_plus).size
    for sector in (0, 1, shape.z - 1):
        there = full.nodes[mesh.sector_nodes(sector)]
        assert np.abs(there - rotated(mesh.nodes, 2 * math.pi * sector / shape.z)).max() < 1e-15
    assert np.array_equal(full.nodes[full.flank[1].quads], mesh.nodes[mesh.flank[1].quads])


BRICK = 0.5 * (hex20.NATURAL + 1)


def test_scaled_jacobian_of_a_sheared_brick_is_the_sine_of_its_angle() -> None:
    for degrees in (90, 60, 30):
        angle = math.radians(degrees)
        sheared = BRICK @ np.array([[3, 0, 0], [2 * math.cos(angle), 2 * math.sin(angle), 0], [0, 0, 0.1]])
        mesh = FeMesh(sheared, np.arange(20)[None], {})
        assert scaled_jacobian(mesh)[0] == pytest.approx(math.sin(angle), rel=1e-13)
        assert volume(mesh) == pytest.approx(0.6 * math.sin(angle), rel=1e-13)
    folded = BRICK.copy()
    folded[(BRICK == 1).all(axis=1)] = 0.2
    assert scaled_jacobian(FeMesh(folded, np.arange(20)[None], {}))[0] < 0


def test_volume_is_exact_for_quadratic_maps() -> None:
    """A face whose mid nodes bulge as a parabola of height 0.2: 2/3 of the rectangle."""
    bulge, nodes = 0.2, BRICK.copy()
    nodes[(BRICK[:, 0] == 0.5) & (BRICK[:, 1] == 1), 1] += bulge
    assert volume(FeMesh(nodes, np.arange(20)[None], {})) == pytest.approx(1 + 2 / 3 * bulge, rel=1e-13)


def test_graded_and_transfinite() -> None:
    corners = graded(4, 2.0)[::2]
    assert np.diff(corners)[1:] / np.diff(corners)[:-1] == pytest.approx(2)
    assert graded(4, 2.0)[1::2] == pytest.approx(0.5 * (corners[1:] + corners[:-1]))
    u, v = np.linspace(0, 1, 5)[:, None], np.linspace(0, 1, 7)[:, None] ** 2
    low, high = u * [2, 0], u * [2, 0] + [0, 3]
    start, end = v * [0, 3], v * [0, 3] + [2, 0]
    lattice = transfinite(low, high, start, end)
    assert lattice == pytest.approx(np.stack(np.broadcast_arrays(2 * u, 3 * v.T), axis=-1))


def test_a_bore_that_leaves_no_rim_is_refused() -> None:
    shape = SHAPES[0]
    wide = GearGeometry(**{**vars(shape), "r_bore": shape.r_f * 1.001})
    with pytest.raises(MeshError, match="bore smaller"):
        gear_sector(wide, WIDTH, COARSE)


def test_vtu_comes_back_as_written(tmp_path, case: tuple[GearGeometry, FeMesh]) -> None:
    _, mesh = case
    write_vtu(mesh, tmp_path / "body.vtu")
    back = meshio.read(tmp_path / "body.vtu")
    assert np.array_equal(back.points, mesh.nodes)
    assert np.array_equal(back.cells[0].data, mesh.elements)
    ((name, nodes),) = mesh.sets.items()
    assert np.array_equal(np.flatnonzero(back.point_data[name]), np.sort(nodes))
    assert set(back.point_data[name]) == {0.0, 1.0}
    assert np.array_equal(back.point_data["roll"][mesh.flank[0].quads], mesh.flank[0].roll)
    assert back.cell_data["scaled_jacobian"][0] == pytest.approx(scaled_jacobian(mesh))
    assert [path.name for path in tmp_path.iterdir()] == ["body.vtu"]
