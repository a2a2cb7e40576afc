"""Frequency response of imported bodies before reduction: the same as of our own, for every method."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from gears import hex20_deck, pinion, stage
from scipy.spatial import cKDTree

from gearfmu.fem import solids
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.toothed import toothed_full_order

SECTION = 'file = "pinion.inp"\nlength = "1 mm"\n'
READY = 'stiffness = "k.npz"\nmass = "m.npz"\nforce_unit = "1e-3 N"\n'


def imported(folder: Path, section: str = SECTION) -> FullOrder:
    spec = stage(folder, section)
    return toothed_full_order(spec.by_file[spec.gears[0].name])


def store_matrices(folder: Path, whole: bool) -> None:
    mesh, material = pinion(whole), stage(folder).gears[0].material
    matrices = solids.assemble(mesh.nodes, {"hexahedron20": mesh.elements}, material)
    for name, matrix in zip(("k", "m"), matrices, strict=True):
        sp.save_npz(folder / f"{name}.npz", sp.csr_matrix(matrix))


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> FullOrder:
    return toothed_full_order(stage(tmp_path_factory.mktemp("native")).by_file["pinion"], scale=1.0)


def places(body: FullOrder) -> np.ndarray:
    """(N, 3) m of the nodes, from the rigid rotations of the body."""
    turn_x, turn_z = body.rigid[:, 3].reshape(-1, 3), body.rigid[:, 5].reshape(-1, 3)
    return np.column_stack([turn_z[:, 1], -turn_z[:, 0], -turn_x[:, 1]])


@pytest.mark.parametrize(
    ("whole", "ready"),
    [(True, False), (False, True), *(pytest.param(both, both, marks=pytest.mark.full) for both in (False, True))],
)
def test_the_same_full_model_whatever_the_road(tmp_path: Path, native: FullOrder, whole: bool, ready: bool) -> None:
    """Whole mesh or sector, our elements or ready-made matrices: K, M and the rows of all interfaces."""
    hex20_deck(tmp_path / "pinion.inp", whole=whole)
    if ready:
        store_matrices(tmp_path, whole)
    body = imported(tmp_path, SECTION + (READY if ready else ""))
    assert [i.name for i in body.interfaces] == [i.name for i in native.interfaces] and body.ground == ("bore",)
    assert body.length == native.length and body.size == native.size
    for own, other in zip(body.interfaces, native.interfaces, strict=True):
        assert np.allclose(own.point, other.point, atol=1e-8)
    distance, order = cKDTree(places(body)).query(places(native))
    dofs = (3 * order[:, None] + np.arange(3)).ravel()
    assert distance.max() < 1e-8 and len(np.unique(order)) == len(order)
    for name in ("stiffness", "mass"):
        own, other = getattr(body, name)[dofs][:, dofs], getattr(native, name)
        assert np.abs(own - other).max() < 1e-6 * np.abs(other).max(), name
    assert np.abs(body.rows()[:, dofs] - native.rows()).max() < 1e-6 * np.abs(native.rows("bore")).max()
