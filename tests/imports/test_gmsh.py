"""Files that Gmsh 4 wrote in its default format: a brick of 40 × 20 × 10 mm with named, overlapping surfaces.

Of named_tet10.msh (text) only physical groups are saved; of all_hex20.msh (binary) all entities. Made by Gmsh's Python
interface: addBox, addPhysicalGroup of x = 0 ("left"), of x = 0 and x = 40 ("ends"), of the volume ("solid").
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from decks import STEEL

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.femesh.imported import read_mesh
from gearfmu.quantities import to_si

HERE = Path(__file__).parent / "gmsh"
MM = to_si("1 mm", "m")


@pytest.mark.parametrize("name, kind", [("named_tet10", "tetra10"), ("all_hex20", "hexahedron20")])
def test_brick_of_the_default_format(name: str, kind: str) -> None:
    mesh = read_mesh(HERE / f"{name}.msh", MM)
    assert list(mesh.elements) == [kind] and set(mesh.sets) == {"left", "ends", "solid"}
    assert {round(1e3 * x) for x in mesh.nodes[mesh.node_set("left"), 0]} == {0}
    assert {round(1e3 * x) for x in mesh.nodes[mesh.node_set("ends"), 0]} == {0, 40}
    assert len(mesh.node_set("ends")) == 2 * len(mesh.node_set("left")), "the surface in two groups is in both"
    assert len(mesh.node_set("solid")) == len(mesh.nodes) == len(mesh.labels)


@pytest.mark.parametrize("name", ["named_tet10", "all_hex20"])
def test_its_nodes_stand_where_the_elements_want_them(name: str) -> None:
    """Mass, and the exact force of a brick pulled uniformly: mid nodes in another order would spoil both."""
    mesh = read_mesh(HERE / f"{name}.msh", MM)
    stiffness, mass = solids.assemble(mesh.nodes, mesh.elements, STEEL)
    assert mass.sum() / 3 == pytest.approx(7850 * 8e-6, rel=1e-9)
    pulled = mesh.nodes * [1.0, -0.3, -0.3]
    force = (stiffness @ pulled.ravel()).reshape(-1, 3)
    assert force[mesh.nodes[:, 0] > 39.9e-3, 0].sum() == pytest.approx(206e9 * 2e-4, rel=1e-9)
    assert np.abs(force[mesh.nodes[:, 0] < 1e-6, 0].sum() + 206e9 * 2e-4) < 1.0


@pytest.mark.parametrize("name", ["named_tet10", "all_hex20"])
def test_files_that_end_early_are_said_to(tmp_path: Path, name: str) -> None:
    whole = (HERE / f"{name}.msh").read_bytes()
    path = tmp_path / "short.msh"
    for part in np.linspace(0.05, 0.95, 19):
        path.write_bytes(whole[: int(part * len(whole))])
        with pytest.raises(MeshError, match="short.msh: (not a gmsh file that can be read|there are no solid)"):
            read_mesh(path, MM)


def test_what_is_not_read_is_refused_with_the_remedy(tmp_path: Path) -> None:
    whole, path = (HERE / "named_tet10.msh").read_text(encoding="utf-8"), tmp_path / "a.msh"
    for old, new, said in (
        ("4.1 0 8", "4.0 0 8", "format 4.0 is not read: save the mesh again as 'MSH 4.1'"),
        ("$Entities", "$PartitionedEntities\n$EndPartitionedEntities\n$Entities", "save it without partitions"),
        ("3 1 11 ", "3 1 29 ", "elements of Gmsh type 29 are not read: mesh with order 1 or 2"),
    ):
        assert old in whole
        path.write_text(whole.replace(old, new), encoding="utf-8")
        with pytest.raises(MeshError, match=said):
            read_mesh(path, MM)
