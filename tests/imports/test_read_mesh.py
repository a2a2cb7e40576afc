"""Meshes of other programs: what is read is what stands in the file, and its matrices are ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from decks import STEEL, brick, write_deck

from gearfmu.fem import hex20, solids
from gearfmu.fem.free import FreeBody
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.femesh.imported import read_mesh
from gearfmu.reduction.imported import Matrices, SetInterface, full_order

MM = 1e-3


def frequencies(nodes, elements, stiffness, mass, count=6) -> np.ndarray:
    cells = np.concatenate([np.pad(b, ((0, 0), (0, 20 - b.shape[1])), constant_values=-1) for b in elements.values()])
    squared, _ = lowest_modes(FreeBody(stiffness, mass, nodes, cells), count)
    return np.sqrt(squared) / (2 * np.pi)


def test_a_deck_gives_the_frequencies_of_our_own_elements(tmp_path: Path) -> None:
    nodes, hexes = brick("hexahedron20")
    ends = {"LEFT": np.flatnonzero(nodes[:, 0] == 0), "RIGHT": np.flatnonzero(nodes[:, 0] == 40)}
    mesh = read_mesh(write_deck(tmp_path / "b.inp", nodes, {"hexahedron20": hexes}, ends), MM)
    body = full_order(mesh, Matrices(*solids.assemble(mesh.nodes, mesh.elements, STEEL)), [SetInterface("left", "rigid"), SetInterface("RIGHT")])
    own = hex20.assemble(MM * nodes, hexes, STEEL)
    found = frequencies(mesh.nodes, mesh.elements, *solids.assemble(mesh.nodes, mesh.elements, STEEL))
    assert found == pytest.approx(frequencies(MM * nodes, {"": hexes}, *own), rel=1e-12)
    assert np.abs(body.stiffness @ body.rigid).max() < 1e-9 * np.abs(body.stiffness).max()
    assert body.rigid[:, 0] @ body.mass @ body.rigid[:, 0] == pytest.approx(7850 * 3.2e-6)
    left, right = (i.rows @ body.rigid for i in body.interfaces)
    assert np.allclose(left[3:], np.eye(6)[3:], atol=1e-12)
    assert np.allclose(right[:3, 3:], [[0, 4e-3, -5e-3], [-4e-3, 0, 4e-2], [5e-3, -4e-2, 0]], atol=1e-12)
