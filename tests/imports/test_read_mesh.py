"""Meshes of other programs: what is read is what stands in the file, and its matrices are ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from blocks import free_body
from decks import STEEL, brick, write_deck

from gearfmu.errors import MeshError
from gearfmu.fem import hex20, solids
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.femesh.imported import ImportedMesh, read_mesh
from gearfmu.reduction.couplings import full_order
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.couplings import elements_of, set_coupling

MM = 1e-3


def frequencies(nodes, elements, stiffness, mass, count=6) -> np.ndarray:
    cells = np.concatenate([np.pad(b, ((0, 0), (0, 20 - b.shape[1])), constant_values=-1) for b in elements.values()])
    squared, _ = lowest_modes(free_body(stiffness, mass, nodes, cells), count)
    return np.sqrt(squared) / (2 * np.pi)


def coupled(mesh: ImportedMesh, interfaces: list[tuple[str, str]]) -> FullOrder:
    """The free body of a mesh with node sets and their kinds as interfaces."""
    faces = solids.boundary(mesh.elements)
    couplings = [set_coupling(mesh, faces, name, kind) for name, kind in interfaces]
    return full_order("b", elements_of(mesh, None, STEEL), couplings, (), 0.05)


def test_a_deck_gives_the_frequencies_of_our_own_elements(tmp_path: Path) -> None:
    nodes, hexes = brick("hexahedron20")
    ends = {"LEFT": np.flatnonzero(nodes[:, 0] == 0), "RIGHT": np.flatnonzero(nodes[:, 0] == 40)}
    mesh = read_mesh(write_deck(tmp_path / "b.inp", nodes, {"hexahedron20": hexes}, ends), MM)
    body = coupled(mesh, [("left", "rigid"), ("RIGHT", "averaging")])
    own = hex20.assemble(MM * nodes, hexes, STEEL)
    found = frequencies(mesh.nodes, mesh.elements, *solids.assemble(mesh.nodes, mesh.elements, STEEL))
    assert found == pytest.approx(frequencies(MM * nodes, {"": hexes}, *own), rel=1e-12)
    assert np.abs(body.stiffness @ body.rigid).max() < 1e-9 * np.abs(body.stiffness).max()
    assert body.rigid[:, 0] @ body.mass @ body.rigid[:, 0] == pytest.approx(7850 * 3.2e-6)
    left, right = (i.rows @ body.rigid for i in body.interfaces)
    assert np.allclose(left[3:], np.eye(6)[3:], atol=1e-12)
    assert np.allclose(right[:3, 3:], [[0, 4e-3, -5e-3], [-4e-3, 0, 4e-2], [5e-3, -4e-2, 0]], atol=1e-12)


@pytest.mark.parametrize("kind", ["hexahedron20", "tetra10", "hexahedron"])
def test_rigid_and_averaging_sets_of_every_element(tmp_path: Path, kind: str) -> None:
    """A bar pulled at averaging and rigid ends: the static stretch is F L / (E A), in between for the rigid ends."""
    nodes, cells = brick(kind, (8, 2, 2))
    ends = {"LEFT": np.flatnonzero(nodes[:, 0] == 0), "RIGHT": np.flatnonzero(nodes[:, 0] == 40)}
    mesh = read_mesh(write_deck(tmp_path / "b.inp", nodes, {kind: cells}, ends), MM)
    stretch = {}
    for coupling in ("averaging", "rigid"):
        body = coupled(mesh, [("LEFT", coupling), ("RIGHT", coupling)])
        assert np.abs(body.stiffness @ body.rigid).max() < 1e-8 * np.abs(body.stiffness).max()
        pull = body.rows("RIGHT")[[0]] - body.rows("LEFT")[[0]]
        stretch[coupling] = float((pull @ Elastic(body.held(body.rows("LEFT"))).flexibility(pull.T.toarray()))[0, 0])
    exact = 0.04 / (206e9 * 8e-5)
    assert stretch["averaging"] == pytest.approx(exact, rel=1e-2)
    assert 0.95 * exact < stretch["rigid"] < stretch["averaging"]


def test_a_set_in_one_line_is_refused(tmp_path: Path) -> None:
    nodes, cells = brick("hexahedron20")
    edge = {"EDGE": np.flatnonzero((nodes[:, 1] == 0) & (nodes[:, 2] == 0))}
    mesh = read_mesh(write_deck(tmp_path / "b.inp", nodes, {"hexahedron20": cells}, edge), MM)
    with pytest.raises(MeshError, match="'edge' lie in one line"):
        coupled(mesh, [("edge", "averaging")])


def test_a_byte_order_mark_and_line_ends_change_no_deck(tmp_path: Path) -> None:
    nodes, hexes = brick("hexahedron20")
    ends = {"LEFT": np.flatnonzero(nodes[:, 0] == 0)}
    plain = write_deck(tmp_path / "a.inp", nodes, {"hexahedron20": hexes}, ends)
    marked = tmp_path / "b.inp"
    marked.write_bytes(plain.read_text(encoding="utf-8").replace("\n", "\r\n").encode("utf-8-sig"))
    one, other = read_mesh(plain, MM), read_mesh(marked, MM)
    assert np.array_equal(one.nodes, other.nodes) and np.array_equal(one.sets["LEFT"], other.sets["LEFT"])
    assert all(np.array_equal(cells, other.elements[kind]) for kind, cells in one.elements.items())
