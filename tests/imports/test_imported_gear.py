"""An imported gear is the gear: whole or one sector, hexahedra or tetrahedra, cyclic method or mean tooth."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from decks import write_deck
from gearfmu.body.imported import imported_full_order
from gears import hex20_deck, pinion, stage, tetrahedra, without, write_matrices
from scipy.spatial import cKDTree

from gearfmu.body import Body, reduce_body
from gearfmu.body.layout import value_of
from gearfmu.femesh.quality import write_vtu
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.toothed import gear_full_order
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
    return gear_full_order(stage(tmp_path_factory.mktemp("native")).by_file["pinion"], 1.0)


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
    body = imported_full_order(stage(tmp_path, section).by_file["pinion"])
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
