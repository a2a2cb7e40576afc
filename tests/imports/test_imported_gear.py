"""An imported gear is the gear: whole or one sector, hexahedra or tetrahedra, cyclic method or mean tooth."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from decks import write_deck
from gears import hex20_deck, pinion, stage, tetrahedra, without, write_matrices
from scipy.spatial import cKDTree
from small_gear import GEAR, STEEL, coarse, flank
from turned_rows import on_tooth

from gearfmu.body import Body, reduce_body
from gearfmu.body.layout import value_of
from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows, rigid_modes
from gearfmu.femesh.quality import write_vtu
from gearfmu.reduction.cyclic.frf import FrfCase, frf_error
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import COMPONENTS, FullOrder, Interface
from gearfmu.reduction.imported.flank import tooth_loads
from gearfmu.reduction.imported.mean_tooth import WholeGear, mean_frf, mean_modes, mean_statics
from gearfmu.reduction.toothed import toothed_full_order
from gearfmu.stagefile.stored import expected_hash

SECTION = 'file = "pinion.inp"\nlength = "1 mm"\n'
TABLES = ("flank.static", "flank.node", "static", "mass")


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Body:
    return reduce_body(stage(tmp_path_factory.mktemp("native")), "pinion")


def imported(folder: Path, section: str = SECTION) -> Body:
    return reduce_body(stage(folder, section), "pinion")


def assert_same(body: Body, native: Body, tolerance: float) -> None:
    assert body.modes == native.modes
    assert np.abs(body.frequency / native.frequency - 1).max() < tolerance
    for name in TABLES:
        own, other = value_of(body, name), value_of(native, name)
        assert np.abs(own - other).max() < tolerance * np.abs(other).max(), name
    assert body.error.max_error == pytest.approx(native.error.max_error, rel=1e-3)


def turn(axis: int, angle: float) -> np.ndarray:
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[[a, a, b, b], [a, b, a, b]] = [np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)]
    return matrix


def elsewhere(folder: Path) -> None:
    """Axis along x, off the origin, tilted by 0.2°, tooth 0 anywhere."""
    points = pinion().nodes @ turn(2, 0.7) @ turn(0, np.radians(0.2)) + np.array([3e-4, -2e-4, 0.1])
    hex20_deck(folder / "pinion.inp", points[:, [2, 0, 1]])


MATRICES = SECTION + 'stiffness = "k.npz"\nmass = "m.npz"\n'
VTU = 'file = "pinion.vtu"\nlength = "1 m"\nbore = "bore"'
ROADS: dict[str, tuple[Callable[[Path], object], str, float]] = {  # writes the files, section, tolerance
    "whole": (lambda folder: hex20_deck(folder / "pinion.inp"), SECTION + 'bore = "bore"', 1e-9),
    "sector": (lambda folder: hex20_deck(folder / "pinion.inp", whole=False), SECTION + 'bore = "bore"', 1e-9),
    "elsewhere": (elsewhere, SECTION + 'bore = "BORE"\naxis = "x"', 1e-7),
    "vtu": (lambda folder: write_vtu(pinion(whole=False), folder / "pinion.vtu"), VTU, 1e-9),
}


@pytest.mark.parametrize("road", ROADS)
def test_our_own_mesh_comes_back_as_the_same_body(tmp_path: Path, native: Body, road: str) -> None:
    """Cut into sectors again, or one sector as such."""
    write, section, tolerance = ROADS[road]
    write(tmp_path)
    body = imported(tmp_path, section)
    assert_same(body, native, tolerance)
    assert body.how.mesh["method"] == "cyclic" and body.how.mesh["fit"]["residual_max_um"] < 1e-3


@pytest.mark.full
def test_tetrahedra_of_one_sector(tmp_path: Path, native: Body) -> None:
    """tet10 on the same curved geometry: elements differ, the gear does not."""
    points, cells = tetrahedra(pinion(whole=False))
    write_deck(tmp_path / "pinion.inp", 1e3 * points, {"tetra10": cells})
    body = imported(tmp_path)
    assert body.how.mesh["method"] == "cyclic" and body.how.mesh["elements"] == {"tetra10": len(cells)}
    assert np.abs(body.frequency[:40] / native.frequency[:40] - 1).max() < 0.01
    middle = (0, 0, 0, 4, 4, 0, 0)
    assert body.flank.static[middle] == pytest.approx(native.flank.static[middle], rel=0.02)


@lru_cache(maxsize=1)
def keyway_cells() -> np.ndarray:
    """The whole pinion without the elements of a keyway: on the bore, one pitch wide."""
    mesh = pinion()
    middle = mesh.nodes[mesh.elements].mean(axis=1)
    radius, angle = np.hypot(middle[:, 0], middle[:, 1]), np.arctan2(middle[:, 1], middle[:, 0])
    return mesh.elements[~((radius < 19e-3) & (np.abs(angle) < np.pi / 16))]


@pytest.mark.full
def test_a_keyway_is_the_mean_tooth_and_its_error_is_stated(tmp_path: Path, native: Body) -> None:
    cells = keyway_cells()
    assert 0 < len(pinion().elements) - len(cells) < 20
    nodes, left = without(pinion(), cells)
    write_deck(tmp_path / "pinion.inp", 1e3 * nodes, {"hexahedron20": left})
    body = imported(tmp_path)
    assert body.how.mesh["method"] == "mean tooth"
    assert 1e-4 < body.how.mesh["teeth_deviation"] < 0.2 and body.how.mesh["compliance_left_to_residual"] < 0.02
    assert native.total_mass * 0.97 < body.total_mass < native.total_mass
    middle = (0, 0, 0, 4, 4, 0, 0)
    assert body.flank.static[middle] == pytest.approx(native.flank.static[middle], rel=0.05)
    assert body.error.max_error > native.error.max_error
    modes_and_rest(body)


def modes_and_rest(body: Body) -> None:
    """Static compliance minus that of the modes is still a compliance: positive semidefinite."""
    size = body.flank.rows[..., 0].size
    rows = body.flank.rows.reshape(size, -1) / (2 * np.pi * body.frequency)
    table = body.flank.static[:, :, 0].transpose(0, 2, 4, 1, 3, 5).reshape(size, size)
    values = np.linalg.eigvalsh(table - rows @ rows.T)
    assert values.min() > -1e-6 * values.max()


def test_the_hash_covers_the_contents_of_the_file(tmp_path: Path) -> None:
    deck = hex20_deck(tmp_path / "pinion.inp")
    spec = stage(tmp_path, SECTION)
    before = expected_hash(spec, "pinion")
    deck.write_text(deck.read_text(encoding="utf-8") + "** a comment\n", encoding="utf-8")
    assert expected_hash(spec, "pinion") != before
    moved = deck.rename(tmp_path / "other.inp")
    assert expected_hash(stage(tmp_path, SECTION.replace("pinion.inp", moved.name)), "pinion") != before


# ---- the full model, for every method that reduces it ----------------------------------------------------------------
def places(body: FullOrder) -> np.ndarray:
    """(N, 3) m of the nodes, from the rigid rotations of the body."""
    turn_x, turn_z = body.rigid[:, 3].reshape(-1, 3), body.rigid[:, 5].reshape(-1, 3)
    return np.column_stack([turn_z[:, 1], -turn_z[:, 0], -turn_x[:, 1]])


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> FullOrder:
    return toothed_full_order(stage(tmp_path_factory.mktemp("native")).by_file["pinion"], scale=1.0)


@pytest.mark.parametrize(
    ("whole", "ready"),
    [(True, False), (False, True), *(pytest.param(both, both, marks=pytest.mark.full) for both in (False, True))],
)
def test_the_same_full_model_whatever_the_road(tmp_path: Path, exact: FullOrder, whole: bool, ready: bool) -> None:
    """Whole mesh or sector, our elements or ready-made matrices: K, M and the rows of all interfaces."""
    hex20_deck(tmp_path / "pinion.inp", whole=whole)
    if ready:
        write_matrices(tmp_path, pinion(whole))
    section = MATRICES + 'force_unit = "1e-3 N"\n' if ready else SECTION
    body = toothed_full_order(stage(tmp_path, section).by_file["pinion"])
    assert [i.name for i in body.interfaces] == [i.name for i in exact.interfaces] and body.ground == ("bore",)
    assert body.length == exact.length and body.size == exact.size
    for own, other in zip(body.interfaces, exact.interfaces, strict=True):
        assert np.allclose(own.point, other.point, atol=1e-8)
    distance, order = cKDTree(places(body)).query(places(exact))
    dofs = (3 * order[:, None] + np.arange(3)).ravel()
    assert distance.max() < 1e-8 and len(np.unique(order)) == len(order)
    for name in ("stiffness", "mass"):
        own, other = getattr(body, name)[dofs][:, dofs], getattr(exact, name)
        assert np.abs(own - other).max() < 1e-6 * np.abs(other).max(), name
    assert np.abs(body.rows()[:, dofs] - exact.rows()).max() < 1e-6 * np.abs(exact.rows("bore")).max()


# ---- the mean tooth: that of the cyclic method for a cyclic body, and the exact mean for any other -------------------
COUNT = 49


@lru_cache(maxsize=1)
def whole() -> WholeGear:
    mesh = coarse().mesh.full()
    elements = {"hexahedron20": mesh.elements}
    faces = solids.boundary(elements)
    rows = tuple(
        tooth_loads(mesh.nodes, faces, flank(), coarse().points, 2 * np.pi * k / GEAR.z) for k in range(GEAR.z)
    )
    bore = sp.csr_array(averaging_rows(mesh.nodes, faces.within(mesh.sets["bore"])))
    body = FullOrder(
        "gear", *solids.assemble(mesh.nodes, elements, STEEL), rigid_modes(mesh.nodes),
        (Interface("bore", bore, COMPONENTS, np.zeros(3), "averaging"),), ("bore",), GEAR.r,
        mesh.elements, np.repeat(np.arange(len(mesh.nodes)), 3),
    )  # fmt: skip
    return WholeGear(body, rows, coarse().points)


@lru_cache(maxsize=1)
def unequal() -> WholeGear:
    """The same with a lump of mass on one side of the rim: no two teeth are alike."""
    body = whole().body
    place = coarse().mesh.full().nodes
    lump = np.exp(-np.sum((place - [11e-3, 2e-3, 0]) ** 2, axis=1) / (3e-3) ** 2)
    mass = body.mass + sp.diags_array(np.repeat(3e-6 * lump, 3))
    values = {
        name: getattr(body, name)
        for name in ("name", "stiffness", "rigid", "interfaces", "ground", "length", "cells", "node_of_dof")
    }
    return WholeGear(FullOrder(mass=sp.csr_array(mass), **values), whole().flank_rows, whole().points)


def test_a_cyclic_body_is_its_own_mean() -> None:
    space = Elastic(whole().body)
    modes, left = mean_modes(whole(), space, COUNT)
    statics, deviation = mean_statics(whole(), space, [0, 5])
    own, tables = elastic_modes(coarse(), COUNT), static_tables(coarse(), [0, 5])
    assert left < 1e-12 and deviation < 1e-9
    assert np.allclose(modes.frequency, own.frequency, rtol=1e-7)
    for name in ("nodal_diameter", "part", "parity"):
        assert np.array_equal(getattr(modes, name), getattr(own, name)), name
    for name in ("static_ff", "static_fb", "static_bb"):
        mine, theirs = getattr(statics, name), getattr(tables, name)
        assert np.abs(mine - theirs).max() < 1e-9 * np.abs(theirs).max(), name
    case = FrfCase(0.01, 150e3, GEAR.r)
    mine, theirs = mean_frf(whole(), space, modes, statics, case), frf_error(coarse(), own, tables, case)
    assert mine.max_error == pytest.approx(theirs.max_error, rel=1e-4)


def test_of_an_unequal_body_it_is_the_mean_of_the_transfer_matrices() -> None:
    """Modes + residual of the mean tooth against the mean over all turns of the whole body's, between its first
    frequencies, which the lump of mass has split."""
    gear, space = unequal(), Elastic(unequal().body)
    modes, left = mean_modes(gear, space, 80)
    statics, deviation = mean_statics(gear, space, [0])
    assert 1e-6 < left < 0.01 and 1e-4 < deviation < 0.1
    squared, shapes = space.modes(80)
    own = (2 * np.pi * modes.frequency) ** 2
    rows, size = np.stack([r @ shapes for r in gear.flank_rows]), len(modes.flank_rows)
    for frequency in (10e3, 35e3):
        s = (2 * np.pi * frequency) ** 2
        for offset in (0, 1, 5):
            static = statics.static_ff[:, :, offset].transpose(0, 2, 4, 1, 3, 5).reshape(size, size)
            exact = static + np.mean(
                [(rows[j] * (s / squared / (squared - s))) @ rows[(j + offset) % GEAR.z].T for j in range(GEAR.z)],
                axis=0,
            )
            ours = (
                static
                + (modes.flank_rows * (s / own / (own - s))) @ on_tooth(modes, modes.flank_rows, offset, GEAR.z).T
            )
            assert np.abs(ours - exact).max() < 5e-3 * np.abs(statics.static_ff[:, :, 0]).max()
