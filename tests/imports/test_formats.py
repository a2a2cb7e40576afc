"""Formats: the same brick as .inp, .bdf, .msh and .vtu, with its sets; matrices in every format that is read."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from blocks import free_body
from decks import STEEL, brick, write_deck

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows, averaging_rows_uniform, rigid_fields, rigid_modes
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.fem.matrices import read_matrix, read_unknowns
from gearfmu.femesh.imported import ImportedMesh, read_mesh, repeated_cells
from gearfmu.reduction.couplings import full_order
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.files import elements_of, set_coupling

MM = 1e-3
KINDS = ("hexahedron20", "tetra10", "hexahedron")


def nastran(path: Path, nodes: np.ndarray, kind: str, cells: np.ndarray) -> Path:
    """A bulk data file in small fields, with SET 1 = the nodes at x = 0, neighbours as a THRU b."""
    left = np.flatnonzero(nodes[:, 0] == 0) + 1
    runs = np.split(left, np.flatnonzero(np.diff(left) > 1) + 1)
    items = [str(run[0]) if len(run) == 1 else f"{run[0]} THRU {run[-1]}" for run in runs]
    lines = [f"SET 1 = {', '.join(items[:4])},", f"  {', '.join(items[4:])}", "BEGIN BULK"]
    lines += [f"GRID,{k},,{x:.9g},{y:.9g},{z:.9g}" for k, (x, y, z) in enumerate(np.round(nodes, 9), 1)]
    name = {"hexahedron20": "CHEXA", "tetra10": "CTETRA", "hexahedron": "CHEXA"}[kind]
    order = (
        [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 16, 17, 18, 19, 12, 13, 14, 15]
        if kind == "hexahedron20"
        else range(cells.shape[1])
    )
    for k, row in enumerate(cells[:, list(order)] + 1, 1):
        fields = [f"{name:<8}", f"{k:<8}", f"{1:<8}", *(f"{n:<8}" for n in row)]
        lines += ["".join(fields[:9]) + "+"] if len(fields) > 9 else ["".join(fields)]
        for first in range(9, len(fields), 8):
            lines.append("+       " + "".join(fields[first : first + 8]) + ("+" if first + 8 < len(fields) else ""))
    path.write_text("\n".join([*lines, "ENDDATA"]) + "\n", encoding="utf-8")
    return path


def as_file(folder: Path, suffix: str, kind: str) -> tuple[Path, np.ndarray, np.ndarray]:
    nodes, cells = brick(kind)
    path, left = folder / f"brick{suffix}", np.flatnonzero(nodes[:, 0] == 0)
    if suffix == ".inp":
        write_deck(path, nodes, {kind: cells}, {"left": left})
    elif suffix == ".bdf":
        nastran(path, nodes, kind, cells)
    elif suffix == ".vtu":
        meshio.Mesh(nodes, [(kind, cells)], {"left": np.isin(np.arange(len(nodes)), left).astype(float)}).write(path)
    else:
        mesh = meshio.Mesh(nodes, [("vertex", left[:, None]), (kind, cells)])
        mesh.cell_data = {
            "gmsh:physical": [np.full(len(left), 7), np.full(len(cells), 8)],
            "gmsh:geometrical": [np.full(len(left), 1), np.full(len(cells), 1)],
        }
        mesh.field_data = {"left": np.array([7, 0]), "solid": np.array([8, 3])}
        meshio.gmsh.write(path, mesh, "2.2", binary=False)
    return path, nodes, left


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("suffix", [".inp", ".bdf", ".msh", ".vtu"])
def test_every_format_gives_the_same_brick(tmp_path: Path, suffix: str, kind: str) -> None:
    path, nodes, left = as_file(tmp_path, suffix, kind)
    mesh = read_mesh(path, MM)
    stiffness, mass = solids.assemble(mesh.nodes, mesh.elements, STEEL)
    assert mass.sum() / 3 == pytest.approx(7850 * 3.2e-6, rel=1e-9)
    assert min(solids.jacobian_quality(mesh.nodes, block, k).min() for k, block in mesh.elements.items()) > 0.1
    found = mesh.node_set("1" if suffix == ".bdf" else "LEFT")
    assert set(left) <= set(found) and np.allclose(mesh.nodes[found, 0], 0)
    pulled = np.zeros_like(mesh.nodes)
    pulled[:, 0], pulled[:, 1:] = mesh.nodes[:, 0], -0.3 * mesh.nodes[:, 1:]
    force = (stiffness @ pulled.ravel()).reshape(-1, 3)
    assert force[mesh.nodes[:, 0] > 39.9e-3, 0].sum() == pytest.approx(206e9 * 8e-5, rel=1e-9)
    assert mesh.raised == (16 if kind == "hexahedron" else 0)


def test_hexahedra_and_tetrahedra_in_one_deck(tmp_path: Path) -> None:
    """Two bricks side by side on faces of their own are two parts; apart from that both kinds are read."""
    nodes, hexes = brick("hexahedron20", (1, 1, 1), (10.0, 10.0, 10.0))
    others, tets = brick("tetra10", (1, 1, 1), (10.0, 10.0, 10.0))
    both = {"hexahedron20": hexes, "tetra10": tets + len(nodes)}
    mesh = read_mesh(write_deck(tmp_path / "b.inp", np.concatenate([nodes, others + 20]), both), MM)
    mass = solids.assemble(mesh.nodes, mesh.elements, STEEL)[1]
    assert mass.sum() / 3 == pytest.approx(2 * 7850e-6)
    cells = repeated_cells(mesh.elements)
    assert len(cells) == 7 and (cells[1:, 10:] == cells[1:, :1]).all()


def test_traps_of_decks(tmp_path: Path) -> None:
    """Lower-case types, several *NODE blocks, sets of sets, GENERATE, includes: read, where meshio ends the process or
    forgets."""
    nodes, cells = brick("hexahedron", (1, 1, 1), (1.0, 1.0, 1.0))
    rows = [f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(nodes, 11)]
    (tmp_path / "more.inp").write_text("*node\n" + "\n".join(rows[4:]) + "\n", encoding="utf-8")
    text = ["*Heading", "a brick", "*node, nset=low", *rows[:4], "*include, input=more.inp"]
    text += ["*element, type=c3d8r, elset=e1", "1, " + ", ".join(str(n + 11) for n in cells[0])]
    text += ['*nset, nset="High", generate', "15, 18", "*nset, nset=all", "low, High", "*nset, nset=Body, elset=e1"]
    path = tmp_path / "brick.inp"
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    mesh = read_mesh(path, 1.0)
    assert {name: len(set(members) & set(range(8))) for name, members in mesh.sets.items()} == {
        "LOW": 4,
        "HIGH": 4,
        "ALL": 8,
        "BODY": 8,
    }
    assert list(mesh.labels[:8]) == list(range(11, 19)) and mesh.raised == 1


NODES = np.array([[11, 0], [11, 1], [11, 2], [7, 0], [7, 1], [7, 2]])  # rows of the files: node and component
LABELS = np.array([7, 11])


@pytest.fixture(scope="module")
def matrix() -> np.ndarray:
    random = np.random.default_rng(4).standard_normal((6, 6))
    full = random @ random.T
    full[0, 4] = full[4, 0] = full[1, 5] = full[5, 1] = 0.0
    return full


def op4(path: Path, values: np.ndarray, sparse: bool, big: bool = False) -> Path:
    """ASCII OUTPUT4, five numbers a line of 16 characters."""
    rows = -len(values) if big else len(values)
    lines = [f"{len(values):8d}{rows:8d}{6:8d}{2:8d}{'KGG':<8}1P,5E16.9"]
    for k, column in enumerate(values.T, 1):
        words = [f"{v:16.9E}" for v in column]
        numbers = ["".join(words[i : i + 5]) for i in range(0, len(words), 5)]
        if not sparse:
            lines += [f"{k:8d}{1:8d}{len(values):8d}", *numbers]
        elif big:
            lines += [f"{k:8d}{0:8d}{2 * len(values) + 2:8d}", f"{2 * len(values) + 1:8d}{1:8d}", *numbers]
        else:
            lines += [f"{k:8d}{0:8d}{2 * len(values) + 1:8d}", f"{1 + 65536 * (2 * len(values) + 1):8d}", *numbers]
    lines += [f"{len(values) + 1:8d}{1:8d}{1:8d}", f"{1.0:16.9E}"]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path


def dmig(path: Path, values: np.ndarray, rows: np.ndarray, wide: bool = True) -> Path:
    """Lower triangle by columns, as Nastran punches a symmetric DMIG; rows: node and component, from 1."""
    star, width = ("*", 16) if wide else ("", 8)
    lines = ["".join(f"{word:<8}" for word in ("DMIG", "KAAX", 0, 6, 2, *[0] * wide))]
    for k, (node, component) in enumerate(rows):
        lines.append(f"{'DMIG' + star:<8}{'KAAX':<{width}}{node:<{width}}{component:<{width}}")
        for (row, of), value in zip(rows[k:], values[k:, k], strict=True):
            text = f"{value:.9E}".replace("E", "D") if wide else f"{value:.4f}"
            lines += [f"{star or '+':<8}{row:<{width}}{of:<{width}}{text:<{width}}"] if value else []
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path


def in_mesh_order(values: np.ndarray) -> np.ndarray:
    return values[np.ix_([3, 4, 5, 0, 1, 2], [3, 4, 5, 0, 1, 2])]


@pytest.mark.parametrize(
    "form", ["mtx", "mtx symmetric", "npz", "npz dense", "npy", "sti", "op4", "op4 sparse", "op4 big"]
)
def test_matrices_by_rows(tmp_path: Path, matrix: np.ndarray, form: str) -> None:
    path = tmp_path / f"k.{form.split()[0]}"
    writers = {
        "mtx": lambda: scipy.io.mmwrite(path, sp.coo_array(matrix), precision=16, symmetry="general"),
        "mtx symmetric": lambda: scipy.io.mmwrite(path, sp.coo_array(matrix), precision=16, symmetry="symmetric"),
        "npz": lambda: sp.save_npz(path, sp.csr_matrix(matrix)),
        "npz dense": lambda: np.savez(path, k=matrix),
        "npy": lambda: np.save(path, matrix),
        "sti": lambda: path.write_text(
            "".join(f"{i + 1} {j + 1} {matrix[i, j]:20.13e}\n" for j in range(6) for i in range(j + 1)),
            encoding="ascii",
        ),
        "op4": lambda: op4(path, matrix, False),
        "op4 sparse": lambda: op4(path, matrix, True),
        "op4 big": lambda: op4(path, matrix, True, big=True),
    }
    writers[form]()
    (tmp_path / "k.dof").write_text("".join(f"{n}.{c + 1}\n" for n, c in NODES), encoding="ascii")
    found = read_matrix(path, read_unknowns(tmp_path / "k.dof"), LABELS).toarray()
    assert np.allclose(found, in_mesh_order(matrix), rtol=0, atol=2e-8)
    assert np.allclose(read_matrix(path, None, LABELS).toarray(), matrix, rtol=0, atol=2e-8)


@pytest.mark.parametrize("wide", [True, False])
def test_dmig_names_its_own_rows(tmp_path: Path, matrix: np.ndarray, wide: bool) -> None:
    path = dmig(tmp_path / "k.pch", matrix, NODES + [0, 1], wide)
    assert np.allclose(
        read_matrix(path, None, LABELS).toarray(), in_mesh_order(matrix), rtol=0, atol=2e-8 if wide else 1e-4
    )


def test_rows_must_be_the_displacements_of_all_nodes(tmp_path: Path, matrix: np.ndarray) -> None:
    np.save(tmp_path / "k.npy", matrix)
    with pytest.raises(MeshError, match="row 11.1 is no displacement of a node"):
        read_matrix(tmp_path / "k.npy", NODES, np.array([7, 8]))
    with pytest.raises(MeshError, match=r"3 unknowns of the mesh have no row \(first: node 12\)"):
        read_matrix(tmp_path / "k.npy", NODES, np.array([7, 11, 12]))
    with pytest.raises(MeshError, match="6 rows, but `unknowns` names 5"):
        read_matrix(tmp_path / "k.npy", NODES[:5], LABELS)


# ---- sets of nodes as interfaces -------------------------------------------------------------------------------------
def coupled(mesh: ImportedMesh, interfaces: list[tuple[str, str]]) -> FullOrder:
    """The free body of a mesh with node sets and their kinds as interfaces."""
    faces = solids.boundary(mesh.elements)
    couplings = [set_coupling(mesh, faces, name, kind) for name, kind in interfaces]
    return full_order("b", elements_of(mesh, None, STEEL), couplings, (), 0.05)


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


# ---- ten-node tetrahedra: what quadratic elements must do exactly, and how fast they converge ------------------------
@pytest.fixture(scope="module")
def bar() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    nodes, cells = brick("tetra10", (3, 2, 2), (0.03, 0.01, 0.012))
    return nodes, {"tetra10": cells}


def test_rigid_motion_stretch_and_pure_bending_are_exact(bar) -> None:
    """Pure bending is quadratic in the coordinates: no force inside, the couple at the ends."""
    nodes, elements = bar
    stiffness, mass = solids.assemble(nodes, elements, STEEL)
    scale = np.abs(stiffness).max()
    assert np.abs(stiffness @ rigid_modes(nodes)).max() < 1e-9 * scale * 0.03
    fields = rigid_modes(nodes)
    inertia = fields.T @ (mass @ fields)
    assert inertia[0, 0] == pytest.approx(7850 * 3.6e-6, rel=1e-12)
    assert inertia[5, 5] == pytest.approx(7850 * 3.6e-6 * (0.03**2 + 0.01**2) / 3, rel=1e-12)
    x, y, z = nodes.T
    y = y - 0.005
    z = z - 0.006
    nu, curvature = 0.3, 0.1
    bent = curvature * np.column_stack([x * y, -(x**2) / 2 - nu * (y**2 - z**2) / 2, -nu * y * z])
    force = (stiffness @ bent.ravel()).reshape(-1, 3)
    inner = (x > 1e-9) & (x < 0.03 - 1e-9)
    end = x > 0.03 - 1e-9
    assert np.abs(force[inner]).max() < 1e-9 * np.abs(force).max()
    couple = force[end, 0] @ y[end]
    assert couple == pytest.approx(206e9 * curvature * 0.012 * 0.01**3 / 12, rel=1e-9)


def test_frequencies_converge_with_the_fourth_power() -> None:
    """Free bar, lowest bending mode: against fine hexahedra, the error falls by about 2³ to 2⁴ when elements
    are halved."""
    found = []
    for count in (1, 2):
        nodes, cells = brick("tetra10", (4 * count, count, count), (0.04, 0.01, 0.008))
        body = free_body(*solids.assemble(nodes, {"tetra10": cells}, STEEL), nodes, cells)
        found.append(np.sqrt(lowest_modes(body, 1)[0][0]))
    nodes, cells = brick("hexahedron20", (16, 4, 4), (0.04, 0.01, 0.008))
    body = free_body(*solids.assemble(nodes, {"hexahedron20": cells}, STEEL), nodes, cells)
    exact = np.sqrt(lowest_modes(body, 1)[0][0])
    error = np.array(found) / exact - 1
    print(error)
    assert error[1] < 4e-3 and 6 < error[0] / error[1] < 40


def test_patches_of_triangles_average_like_surfaces(bar) -> None:
    nodes, elements = bar
    faces = solids.boundary(elements).within(np.flatnonzero(nodes[:, 0] == 0))
    assert len(faces.triangles) == 8 and len(faces.quads) == 0
    rows = averaging_rows(nodes, faces)
    motion = np.array([1e-3, -2e-3, 3e-3, 0.01, -0.02, 0.03])
    assert np.allclose(rows @ (rigid_fields(nodes) @ motion).ravel(), motion, rtol=1e-10)
    stretched = np.zeros_like(nodes)
    stretched[:, 0] = (nodes[:, 1] / 0.01) ** 2
    assert (rows @ stretched.ravel())[0] + (rows @ stretched.ravel())[4] * 0.006 - (rows @ stretched.ravel())[
        5
    ] * 0.005 == pytest.approx(1 / 3, rel=1e-9)
    uniform = averaging_rows_uniform(nodes, faces.nodes)
    assert abs((uniform @ stretched.ravel())[0] - (rows @ stretched.ravel())[0]) > 1e-3


def test_an_inverted_tetrahedron_is_refused(bar) -> None:
    nodes, elements = bar
    cells = elements["tetra10"].copy()
    cells[5] = cells[5][[1, 0, 2, 3, 4, 6, 5, 8, 7, 9]]
    with pytest.raises(MeshError, match="1 elements have a Jacobian determinant"):
        solids.assemble(nodes, {"tetra10": cells}, STEEL)
    assert (solids.jacobian_quality(nodes, cells, "tetra10") <= 0).sum() == 1
