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
from gears import hex20_deck, pinion, stage

from gearfmu.body import reduce_bodies
from gearfmu.errors import GearfmuError, MeshError, SpecError
from gearfmu.fem import solids
from gearfmu.fem.factor import FactorError
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


def deck(folder: Path, nodes: np.ndarray, cells: np.ndarray, **sets: np.ndarray) -> Path:
    return write_deck(folder / "pinion.inp", 1e3 * nodes, {"hexahedron20": cells}, sets)


def inverted(folder: Path) -> str:
    nodes = pinion(False).nodes.copy()
    corner = pinion(False).elements[40, 6]
    nodes[corner] += 3 * (nodes[pinion(False).elements[40, 0]] - nodes[corner])
    deck(folder, nodes, pinion(False).elements)
    return "inverted or folded"


def mirrored(folder: Path) -> str:
    deck(folder, pinion(False).nodes * [1, 1, -1], pinion(False).elements)
    return "all 128 elements .* inside out"


def duplicate_nodes(folder: Path) -> str:
    """One element with nodes of its own, as an unmerged part has them."""
    cells = pinion(False).elements.copy()
    extra = pinion(False).nodes[cells[7]]
    cells[7] = len(pinion(False).nodes) + np.arange(20)
    deck(folder, np.concatenate([pinion(False).nodes, extra]), cells)
    return "20 pairs of nodes lie at the same place .* merge"


def disconnected(folder: Path) -> str:
    nodes, cells = pinion(False).nodes, pinion(False).elements
    far = nodes + np.array([0.0, 0.0, 0.1])
    deck(folder, np.concatenate([nodes, far]), np.concatenate([cells, cells + len(nodes)]))
    return "2 parts that share no node"


def hinge_by_an_edge(folder: Path) -> str:
    """Two bricks that meet in one edge."""
    nodes, cells = brick("hexahedron20", (1, 1, 1), (10.0, 10.0, 10.0))
    other = nodes + [10.0, 10.0, 0.0]
    distance = np.abs(other[:, None] - nodes[None]).sum(axis=2)
    same = np.where(distance.min(axis=1) < 1e-9, distance.argmin(axis=1), -1)
    new = np.where(same >= 0, same, len(nodes) + np.cumsum(same < 0) - 1)
    write_deck(
        folder / "pinion.inp",
        np.concatenate([nodes, other[same < 0]]),
        {"hexahedron20": np.vstack([cells, new[cells]])},
    )
    return "2 parts of the mesh hang together only by nodes or edges"


def loose_node(folder: Path) -> str:
    deck(folder, np.concatenate([pinion(False).nodes, [[0, 0, 0.1]]]), pinion(False).elements)
    return "1 nodes belong to no element .* `ignore`"


def wrong_length(folder: Path) -> str:
    write_deck(folder / "pinion.inp", pinion(False).nodes, {"hexahedron20": pinion(False).elements})
    return "base circle|not the gear|no involute"


def other_gear(folder: Path) -> str:
    deck(folder, 1.01 * pinion(False).nodes, pinion(False).elements)
    return "not the gear of the stage file: base radius 34.16. mm instead of 33.829 mm|no involutes"


def narrow_gear(folder: Path) -> str:
    deck(folder, pinion(False).nodes * [1, 1, 0.9], pinion(False).elements)
    return "face width 12.6 mm instead of 14 mm"


def no_involute(folder: Path) -> str:
    """Flanks hollowed by 30 µm between form and tip."""
    mesh = pinion(False)
    nodes = mesh.nodes.copy()
    for side, grid in mesh.flank.items():
        low, high = grid.roll.min(), grid.roll.max()
        depth = 30e-6 * np.sin(np.pi * (grid.roll - low) / (high - low))
        t = 0.1213458 - grid.roll / 0.0338289
        nodes[grid.quads] = mesh.nodes[grid.quads] - depth[..., None] * np.stack(
            [-np.sin(t), (1 - 2 * side) * np.cos(t), 0 * t], axis=-1
        )
    deck(folder, nodes, mesh.elements)
    return r"the flanks are no involutes: nodes lie up to \d+(\.\d+)? µm .* allowed are 5 µm"


def half_a_gear(folder: Path) -> str:
    middle = pinion().nodes[pinion().elements].mean(axis=1)
    cells = pinion().elements[middle[:, 1] > 0]
    used = np.unique(cells)
    new = np.full(len(pinion().nodes), -1)
    new[used] = np.arange(len(used))
    deck(folder, pinion().nodes[used], new[cells])
    return "neither a whole gear nor one sector|cut faces|one pitch"


@pytest.mark.parametrize(
    "make",
    [inverted, mirrored, duplicate_nodes, disconnected, hinge_by_an_edge, loose_node, wrong_length, other_gear,
    narrow_gear, no_involute, half_a_gear],
    ids=lambda make: make.__name__,
)  # fmt: skip
def test_a_bad_mesh_is_refused(tmp_path: Path, make: Callable[[Path], str]) -> None:
    wanted = make(tmp_path)
    text = refused(tmp_path)
    print(text)
    assert re.search(wanted, text), text


def test_a_missing_set_names_those_there_are(tmp_path: Path) -> None:
    hex20_deck(tmp_path / "pinion.inp", whole=False)
    assert "there is no node set 'HUB'; sets in the file: BORE, NALL" in refused(tmp_path, SECTION + 'bore = "HUB"')


def test_a_missing_file_and_a_wrong_pair_of_fields(tmp_path: Path) -> None:
    text = refused(tmp_path)
    assert "gears.pinion.import.file = pinion.inp" in text and "relative to the stage file" in text
    with pytest.raises(SpecError, match="stiffness and mass come together"):
        stage(tmp_path, SECTION + 'mass = "m.npz"')
    with pytest.raises(SpecError, match='gears.pinion.import.lenght = "1 mm": unknown key: did you mean "length"'):
        stage(tmp_path, SECTION + 'lenght = "1 mm"')


def test_missing_files_are_told_at_load_with_all_other_problems(tmp_path: Path) -> None:
    """Also where the file could not be read for another reason."""
    files = READY + 'unknowns = "pinion.dof"\n'
    for wrong, also in (("bore_coupling = 3", "bore_coupling"), ('flank_tolerance = "5 kg"', "flank_tolerance")):
        with pytest.raises(SpecError) as caught:
            stage(tmp_path, files + wrong)
        fields = [problem.field.removeprefix("gears.pinion.import.") for problem in caught.value.problems]
        assert sorted(fields) == sorted([also, "file", "stiffness", "mass", "unknowns"])


def test_paths_are_relative_to_the_file_that_holds_them(tmp_path: Path) -> None:
    """A variant in another folder takes the import from its base."""
    hex20_deck(tmp_path / "pinion.inp", whole=False)
    stage(tmp_path, SECTION)
    (tmp_path / "variants").mkdir()
    variant = tmp_path / "variants" / "stage.toml"
    variant.write_text('base = "../stage.toml"\nname = "variant"\n', encoding="utf-8")
    assert Path(load_stage(variant).gears[0].imported.file).resolve() == (tmp_path / "pinion.inp").resolve()


@pytest.fixture(scope="module")
def matrices() -> tuple[sp.csr_array, sp.csr_array]:
    mesh = pinion(False)
    return solids.assemble(mesh.nodes, {"hexahedron20": mesh.elements}, STEEL)


READY = SECTION + 'stiffness = "k.npz"\nmass = "m.npz"\nforce_unit = "1e-3 N"\n'


def grounded(k: sp.csr_array, m: sp.csr_array) -> tuple:
    return (
        k + sp.diags_array(np.where(np.arange(k.shape[0]) < 30, 1e9, 0.0)),
        m,
        r"rigid motion \(x, y, z.*export the free body",
    )


def light(k: sp.csr_array, m: sp.csr_array) -> tuple:
    return k, 1e-3 * m, "mass matrix weighs .* `mass_unit`"


def soft(k: sp.csr_array, m: sp.csr_array) -> tuple:
    return 1e-3 * k, m, "waves of 2.* m/s, the material 5.1e\\+03 m/s: check `force_unit`"


def shuffled(k: sp.csr_array, m: sp.csr_array) -> tuple:
    order = np.arange(k.shape[0])[::-1]
    return k[order][:, order], m[order][:, order], "rigid motion .* rows belong to these nodes"


def short(k: sp.csr_array, m: sp.csr_array) -> tuple:
    return (
        k[:-3][:, :-3],
        m[:-3][:, :-3],
        "2628 rows, but the mesh has 877 nodes, that is 2631 unknowns: give `unknowns`",
    )


def lopsided(k: sp.csr_array, m: sp.csr_array) -> tuple:
    return sp.csr_array(sp.tril(k)), m, "the matrix is not symmetric: write both halves"


@pytest.mark.parametrize("spoil", [grounded, light, soft, shuffled, short, lopsided], ids=lambda spoil: spoil.__name__)
def test_bad_matrices_are_refused(tmp_path: Path, matrices, spoil) -> None:
    stiffness, mass, wanted = spoil(*matrices)
    hex20_deck(tmp_path / "pinion.inp", whole=False)
    sp.save_npz(tmp_path / "k.npz", sp.csr_matrix(stiffness))
    sp.save_npz(tmp_path / "m.npz", sp.csr_matrix(mass))
    text = refused(tmp_path, READY)
    print(text)
    assert re.search(wanted, text), text


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


@pytest.mark.parametrize("case", DECKS)
def test_decks_that_would_be_read_wrongly_are_refused(tmp_path: Path, case: str) -> None:
    text, wanted = DECKS[case]
    path = tmp_path / "pinion.inp"
    path.write_text(text + "\n", encoding="utf-8")
    with pytest.raises(MeshError, match=wanted):
        read_mesh(path, MM)


@pytest.mark.parametrize(("whole", "size"), [(False, "unknowns a sector"), (True, "unknowns")])
def test_what_does_not_fit_the_memory_is_refused_before_the_work(
    whole: bool, size: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tmp_path.mkdir(exist_ok=True)
    hex20_deck(tmp_path / "pinion.inp", whole=whole)
    monkeypatch.setattr(memory, "available_memory", lambda: 1e8)
    text = refused(tmp_path, SECTION + ('bore = "BORE"\nbore_coupling = "rigid"' if whole else ""))
    assert re.search(rf"about 0\.\d GB of memory \(\d+ {size}\), 0\.1 GB are free: mesh the body coarser", text)
