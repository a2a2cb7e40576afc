"""Bad finite elements: one clear message that names the file and what to do, and no body is written."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from blocks import free_body
from decks import STEEL, brick, write_deck
from gears import hex20_deck, pinion, stage, without, write_matrices

from gearfmu.body import reduce_bodies
from gearfmu.errors import GearfmuError, MeshError
from gearfmu.fem import solids
from gearfmu.fem.factor import FactorError
from gearfmu.fem.matrices import read_matrix
from gearfmu.femesh.imported import read_mesh
from gearfmu.reduction import memory
from gearfmu.reduction.imported.gear import hinge_problem
from gearfmu.stagefile.stage import load_stage

SECTION = 'file = "pinion.inp"\nlength = "1 mm"\n'
MM = 1e-3


def refused(folder: Path, section: str = SECTION) -> str:
    """The message with which the stage's pinion is refused; nothing is written beside its files."""
    before = {path for path in folder.rglob("*") if path.suffix != ".toml"}
    with pytest.raises(GearfmuError) as caught:
        reduce_bodies(stage(folder, section))
    assert {path for path in folder.rglob("*") if path.suffix != ".toml"} == before
    text = str(caught.value)
    assert "\n" not in text and str(folder) in text and "pinion" in text
    return text


Mesh = tuple[np.ndarray, np.ndarray]  # nodes (N, 3) m, elements (E, 20)


def inverted(nodes: np.ndarray, cells: np.ndarray) -> Mesh:
    moved, corner = nodes.copy(), cells[40, 6]
    moved[corner] += 3 * (nodes[cells[40, 0]] - nodes[corner])
    return moved, cells


def unmerged(nodes: np.ndarray, cells: np.ndarray) -> Mesh:
    """One element with nodes of its own."""
    own = cells.copy()
    own[7] = len(nodes) + np.arange(20)
    return np.concatenate([nodes, nodes[cells[7]]]), own


def hinged(*_: np.ndarray) -> Mesh:
    """Two bricks that meet in one edge."""
    nodes, cells = brick("hexahedron20", (1, 1, 1), (10.0, 10.0, 10.0))
    other = nodes + [10.0, 10.0, 0.0]
    distance = np.abs(other[:, None] - nodes[None]).sum(axis=2)
    same = np.where(distance.min(axis=1) < 1e-9, distance.argmin(axis=1), -1)
    new = np.where(same >= 0, same, len(nodes) + np.cumsum(same < 0) - 1)
    return MM * np.concatenate([nodes, other[same < 0]]), np.vstack([cells, new[cells]])


def hollowed(nodes: np.ndarray, cells: np.ndarray) -> Mesh:
    """Flanks hollowed by 30 µm between form and tip."""
    moved = nodes.copy()
    for side, grid in pinion(False).flank.items():
        low, high = grid.roll.min(), grid.roll.max()
        depth = 30e-6 * np.sin(np.pi * (grid.roll - low) / (high - low))
        t = 0.1213458 - grid.roll / 0.0338289
        normal = np.stack([-np.sin(t), (1 - 2 * side) * np.cos(t), 0 * t], axis=-1)
        moved[grid.quads] = nodes[grid.quads] - depth[..., None] * normal
    return moved, cells


def halved(*_: np.ndarray) -> Mesh:
    middle = pinion().nodes[pinion().elements].mean(axis=1)
    return without(pinion(), pinion().elements[middle[:, 1] > 0])


BAD_MESHES: dict[str, tuple[Callable[[np.ndarray, np.ndarray], Mesh], str]] = {  # what is made of the pinion's sector
    "inverted": (inverted, "inverted or folded"),
    "mirrored": (lambda nodes, cells: (nodes * [1, 1, -1], cells), "all 128 elements .* inside out"),
    "unmerged": (unmerged, "20 pairs of nodes lie at the same place .* merge"),
    "twice": (
        lambda nodes, cells: (
            np.concatenate([nodes, nodes + [0, 0, 0.1]]),
            np.concatenate([cells, cells + len(nodes)]),
        ),
        "2 parts that share no node",
    ),
    "hinged": (hinged, "2 parts of the mesh hang together only by nodes or edges"),
    "a loose node": (
        lambda nodes, cells: (np.concatenate([nodes, [[0, 0, 0.1]]]), cells),
        "1 nodes belong to no element .* `ignore`",
    ),
    "in metres": (lambda nodes, cells: (MM * nodes, cells), "base circle|not the gear|no involute"),
    "another gear": (
        lambda nodes, cells: (1.01 * nodes, cells),
        "not the gear of the stage file: base radius 34.16. mm instead of 33.829 mm|no involutes",
    ),
    "narrow": (lambda nodes, cells: (nodes * [1, 1, 0.9], cells), "face width 12.6 mm instead of 14 mm"),
    "hollowed": (hollowed, r"the flanks are no involutes: nodes lie up to \d+(\.\d+)? µm .* allowed are 5 µm"),
    "half a gear": (halved, "neither a whole gear nor one sector|cut faces|one pitch"),
}


@pytest.mark.parametrize("case", BAD_MESHES)
def test_a_bad_mesh_is_refused(tmp_path: Path, case: str) -> None:
    make, wanted = BAD_MESHES[case]
    nodes, cells = make(pinion(False).nodes, pinion(False).elements)
    write_deck(tmp_path / "pinion.inp", 1e3 * nodes, {"hexahedron20": cells})
    assert re.search(wanted, refused(tmp_path)), refused(tmp_path)


def test_a_missing_set_names_those_there_are(tmp_path: Path) -> None:
    hex20_deck(tmp_path / "pinion.inp", whole=False)
    assert "there is no node set 'HUB'; sets in the file: BORE, NALL" in refused(tmp_path, SECTION + 'bore = "HUB"')


def test_paths_are_relative_to_the_file_that_holds_them(tmp_path: Path) -> None:
    """A variant in another folder takes the import from its base."""
    hex20_deck(tmp_path / "pinion.inp", whole=False)
    stage(tmp_path, SECTION)
    (tmp_path / "variants").mkdir()
    variant = tmp_path / "variants" / "stage.toml"
    variant.write_text('base = "../stage.toml"\nname = "variant"\n', encoding="utf-8")
    assert Path(load_stage(variant).gears[0].imported.file).resolve() == (tmp_path / "pinion.inp").resolve()


READY = SECTION + 'stiffness = "k.npz"\nmass = "m.npz"\nforce_unit = "1e-3 N"\n'
BAD_MATRICES: dict[str, tuple[Callable[[sp.csr_array, sp.csr_array], tuple[sp.csr_array, sp.csr_array]], str]] = {
    "grounded": (
        lambda k, m: (k + sp.diags_array(np.where(np.arange(k.shape[0]) < 30, 1e9, 0.0)), m),
        r"rigid motion \(x, y, z.*export the free body",
    ),
    "light": (lambda k, m: (k, 1e-3 * m), "mass matrix weighs .* `mass_unit`"),
    "soft": (
        lambda k, m: (1e-3 * k, m),
        "waves of 2.* m/s, the material 5.1e\\+03 m/s: check `force_unit`",
    ),
    "in another order": (
        lambda k, m: (k[::-1][:, ::-1], m[::-1][:, ::-1]),
        "rigid motion .* rows belong to these nodes",
    ),
    "short": (
        lambda k, m: (k[:-3][:, :-3], m[:-3][:, :-3]),
        "2628 rows, but the mesh has 877 nodes, that is 2631 unknowns: give `unknowns`",
    ),
    "lopsided": (lambda k, m: (sp.tril(k), m), "the matrix is not symmetric: write both halves"),
}


@pytest.mark.parametrize("case", BAD_MATRICES)
def test_bad_matrices_are_refused(tmp_path: Path, case: str) -> None:
    spoil, wanted = BAD_MATRICES[case]
    hex20_deck(tmp_path / "pinion.inp", whole=False)
    write_matrices(tmp_path, pinion(False), spoil)
    assert re.search(wanted, refused(tmp_path, READY)), refused(tmp_path, READY)


def test_a_body_that_is_no_solid_is_told_by_its_first_frequency() -> None:
    """A brick is sound; without the stiffness of one corner element a node flies away, though rigid motion needs no
    force."""
    nodes, cells = brick("hexahedron20", (4, 1, 1))
    sound, mass = solids.assemble(MM * nodes, {"hexahedron20": cells}, STEEL)
    space = free_body(sound, mass, MM * nodes, cells)
    assert hinge_problem(space) is None
    loose = solids.assemble(MM * nodes, {"hexahedron20": cells[1:]}, STEEL)[0]
    space = free_body(loose, mass, MM * nodes, cells)
    try:
        told = hinge_problem(space)
    except FactorError as error:
        told = str(error)
    assert "singular beyond the six rigid motions" in told or "not positive definite" in told


DECKS = {
    "C3D4": ("*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT, TYPE=C3D4\n1,1,2,3,4", "linear tetrahedra "
    ".* quadratic"),
    "C3D6": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D6\n1,1,1,1,1,1,1", "elements of type wedge are not taken"),
    "C3D8E": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D8E\n1,1", r"pinion.inp:3: solid elements of type C3D8E are not known"),
    "shells": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=S4\n1,1,1,1,1", "no solid elements"),
    "instance moved": ("*INSTANCE, NAME=A, PART=P\n0.,0.,5.\n*NODE\n1,0,0,0", "pinion.inp:1: this "
    "\\*INSTANCE is moved"),
    "two instances": ("*INSTANCE, NAME=A\n*NODE\n1,0,0,0\n*END INSTANCE\n*INSTANCE, NAME=B\n", "a second \\*INSTANCE"),
    "system": ("*SYSTEM\n0,0,1\n*NODE\n1,0,0,0", "\\*SYSTEM moves the nodes"),
    "cylindrical": ("*NODE, SYSTEM=C\n1,0,0,0", "cylindrical"),
    "set of nothing": ("*NODE\n1,0,0,0\n*NSET, NSET=A\nB", "made of the set B, which is not defined above it"),
    "unknown node": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7,8", "name node 2, which is not in the file"),
    "short element": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D8\n1,1,1", "ends within an element"),
    "no number": ("*NODE\n1,zero,0,0", "pinion.inp:1: \\*NODE cannot be read"),
    "no include": ("*INCLUDE, INPUT=more.inp", "more.inp: the file cannot be read"),
}  # fmt: skip


FILES = {  # content, None of a file that is not there
    "brick.msh": (b"$MeshFormat\n9.9 0 8\n$EndMeshFormat\n", "brick.msh: not a gmsh file that can be read"),
    "brick.stl": (b"solid", "'.stl' is no mesh file that is read here"),
    "cards.bdf": (b"GRID,1,,0.,0.,0.\n", "BEGIN BULK"),
    "system.bdf": (b"BEGIN BULK\nGRID,1,5,0.,0.,0.\nENDDATA\n", "system.bdf:2: a GRID in coordinate system 5"),
    "k.op2": (b"x", "is no matrix file that is read here: .mtx"),
    "k.op4": (b"\x18\x00\x00\x00\x06\x00", "a binary OUTPUT4 file; ask for FORMATTED"),
    "k.mtx": (b"no header", "no sound .mtx matrix"),
    "k.npz": (b"no zip", "no sound .npz matrix|cannot be read"),
    "k.sti": (b"1 2\n", "no sound .sti matrix"),
    "k.pch": (b"$ nothing\n", "expected one DMIG matrix, found 0"),
    "nowhere.mtx": (None, "nowhere.mtx: the file cannot be read"),
}
UNREADABLE = [(name, *case) for name, case in FILES.items()]
UNREADABLE += [("pinion.inp", f"{text}\n".encode(), wanted) for text, wanted in DECKS.values()]


@pytest.mark.parametrize(("name", "content", "wanted"), UNREADABLE, ids=[*FILES, *DECKS])
def test_files_that_cannot_be_read_or_would_be_read_wrongly_are_refused(
    tmp_path: Path, name: str, content: bytes | None, wanted: str
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError, match=wanted):
        if Path(name).suffix in (".inp", ".msh", ".stl", ".bdf"):
            read_mesh(tmp_path / name, MM)
        else:
            read_matrix(tmp_path / name, None, np.array([7, 11]))


@pytest.mark.parametrize(("whole", "size"), [(False, "unknowns a sector"), (True, "unknowns")])
def test_what_does_not_fit_the_memory_is_refused_before_the_work(
    whole: bool, size: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tmp_path.mkdir(exist_ok=True)
    hex20_deck(tmp_path / "pinion.inp", whole=whole)
    monkeypatch.setattr(memory, "available_memory", lambda: 1e8)
    text = refused(tmp_path, SECTION + ('bore = "BORE"\nbore_coupling = "rigid"' if whole else ""))
    assert re.search(rf"about 0\.\d GB of memory \(\d+ {size}\), 0\.1 GB are free: mesh the body coarser", text)
