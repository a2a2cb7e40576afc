"""A housing that another program has reduced: as good as its finite elements, in every format, and CalculiX's own."""

from __future__ import annotations

import re
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import scipy.io
import scipy.linalg as sl
import scipy.sparse as sp
from decks import brick, write_deck
from test_formats import dmig, op4

from gearfmu.body import Body, reduce_body
from gearfmu.body.whole import housing_order, reduced_housing
from gearfmu.errors import MeshError
from gearfmu.reduction.imported.housing import ImportedHousing
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.housing import HousingBody

SIZE = (20.0, 16.0, 40.0)
STEEL = {"youngs_modulus": 206e9, "poisson_ratio": 0.3, "density": 7850.0}
SEAT, FOOT, SENSOR = 9001, 9003, 4200
COARSE = (1, 1, 2)


def deck(path: Path, tail: str = "") -> None:
    """A steel brick of 40 mm on end faces A and B, with a sensor and its outside."""
    nodes, cells = brick("hexahedron20", COARSE, SIZE)
    ends = {"A": np.flatnonzero(nodes[:, 2] == 0), "B": np.flatnonzero(nodes[:, 2] == SIZE[2])}
    outside = np.flatnonzero(np.any((nodes == 0) | (nodes == np.array(SIZE)), axis=1))
    sensor = np.array([sensor_node(nodes)])
    write_deck(path, nodes, {"hexahedron20": cells}, {**ends, "S": sensor, "OUT": outside}, tail)


def sensor_node(nodes: np.ndarray) -> int:
    return int(np.argmin(np.linalg.norm(nodes - [20.0, 16.0, 20.0], axis=1)))


def imported(path: Path, **more: Any) -> HousingBody:
    source = {"file": str(path), "length": 1e-3, "seats": {"a": "A"}, "feet": {"b": "B"}, "sensors": {"s": "S"}}
    table = source | {"seat_coupling": "rigid"} | more
    return HousingBody(name="housing", kind="housing", material=STEEL, method="modal", **{"import": table})


@cache
def whole() -> ImportedHousing:
    """The brick of finite elements; the last 12 of its unknowns are the motions of a and b."""
    with tempfile.TemporaryDirectory() as folder:
        deck(Path(folder) / "brick.inp")
        return housing_order(imported(Path(folder) / "brick.inp", skin="OUT"))


MM = np.array([1.0, 1, 1, 1e3, 1e3, 1e3])  # a force on a point, N, and its moment, N·mm, per N·m


@cache
def condensed() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Craig–Bampton of the brick with all modes, in N, mm and t: K, M, recovery of the sensor and of the points of the
    surface, and rows (label, component), those of a modal coordinate 0."""
    full, (sensor,), skin = whole().full, whole().sensors, whole().skin
    k, m = full.stiffness.toarray(), full.mass.toarray()
    own, held = np.arange(len(k) - 12), np.arange(len(k) - 12, len(k))
    shapes = sl.eigh(k[np.ix_(own, own)], m[np.ix_(own, own)])[1]
    static = -np.linalg.solve(k[np.ix_(own, own)], k[np.ix_(own, held)])
    basis = np.block([[static, shapes], [np.eye(12), np.zeros((12, len(own)))]])
    rows = [(label, c) for label in (SEAT, FOOT) for c in range(1, 7)] + [(7000 + j, 0) for j in range(len(own))]
    scale = np.concatenate([MM, MM, np.ones(len(own))])
    k, m = (1e-3 * np.outer(scale, scale) * (basis.T @ matrix @ basis) for matrix in (k, m))
    return k, m, sp.vstack([sensor.rows, skin]) @ basis * scale, np.array(rows)


def superelement(folder: Path, form: str = "mtx", **more: Any) -> HousingBody:
    """The files of the condensed brick, in some format of matrices, and the table that names them."""
    k, m, recovery, rows = condensed()
    points = [(SEAT, (10, 8, 0)), (FOOT, (10, 8, 40)), (SENSOR, tuple(1e3 * whole().sensors[0].point))]
    grids = [f"GRID,{label},,{x:.9g},{y:.9g},{z:.9g}" for label, (x, y, z) in points]
    (folder / "points.bdf").write_text("\n".join(grids) + "\n", encoding="ascii")
    scipy.io.mmwrite(folder / "r.mtx", sp.coo_array(recovery), precision=16)
    for name, matrix in (("k", k), ("m", m)):
        path = folder / f"{name}.{form}"
        if form == "pch":
            dmig(path, matrix, rows)
        elif form == "op4":
            op4(path, matrix, name == "k")
        elif form == "npz":
            sp.save_npz(path, sp.csr_matrix(matrix))
        else:
            scipy.io.mmwrite(path, sp.coo_array(matrix), precision=16)
    (folder / "rows.txt").write_text("".join(f"{n}.{c}\n" for n, c in rows), encoding="ascii")
    surface = whole().surface
    assert surface is not None
    labels = [SENSOR, *range(1, len(surface.points) + 1)]
    (folder / "seen.txt").write_text("".join(f"{n}.{c}\n" for n in labels for c in (1, 2, 3)), encoding="ascii")
    meshio.Mesh(1e3 * surface.points, [("quad", surface.faces)]).write(folder / "outside.vtu")
    table: dict[str, Any] = {
        "file": str(folder / "points.bdf"), "length": 1e-3, "mass_unit": 1e3, "unknowns": str(folder / "rows.txt"),
        "stiffness": str(folder / f"k.{form}"), "mass": str(folder / f"m.{form}"),
        "recovery": str(folder / "r.mtx"), "recovered": str(folder / "seen.txt"),
        "seats": {"a": SEAT}, "feet": {"b": FOOT}, "sensors": {"s": SENSOR},
        "surface": str(folder / "outside.vtu"),
    }  # fmt: skip
    return HousingBody(name="housing", kind="housing", reduced={k: v for k, v in (table | more).items() if v})


def compliance(body: Body, frequency: float) -> np.ndarray:
    """(15, 12): motion of a, b and the sensor per unit load on a and b, free, undamped."""
    assert body.sensors is not None
    rows = np.vstack([body.rows, body.sensors.rows])
    rigid = np.vstack([body.rigid_rows, body.sensors.rigid_rows])
    square = (2 * np.pi * frequency) ** 2
    modal = rows / ((2 * np.pi * body.frequency) ** 2 - square)
    residual = np.vstack([body.static, body.sensors.static]) - (rows / (2 * np.pi * body.frequency) ** 2) @ body.rows.T
    return modal @ body.rows.T + residual - rigid @ np.linalg.solve(body.mass, body.rigid_rows.T) / square


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> Body:
    folder = tmp_path_factory.mktemp("brick")
    deck(folder / "brick.inp")
    return reduced_housing(imported(folder / "brick.inp", skin="OUT"))


@pytest.mark.parametrize("form", ["mtx", "npz", "op4", "pch"])
def test_it_is_the_body_of_its_finite_elements(tmp_path: Path, exact: Body, form: str) -> None:
    """As a Craig–Bampton superelement with all its modes: mass, frequencies, statics, and motion between two modes.
    Margin: text of ten digits leaves 1e-8."""
    body = reduced_housing(superelement(tmp_path, form))
    assert body.mass == pytest.approx(exact.mass, rel=1e-6, abs=1e-9)
    assert body.frequency == pytest.approx(exact.frequency, rel=1e-6)
    assert body.skin.points == pytest.approx(exact.skin.points) and len(body.skin.faces) == len(exact.skin.faces)
    assert body.skin.modes[:6] == pytest.approx(exact.skin.modes[:6], abs=1e-6)
    for frequency in (5e3, 45e3):
        found, wanted = compliance(body, frequency), compliance(exact, frequency)
        size = np.sqrt(np.abs(np.diag(wanted)))
        assert np.abs((found - wanted)[:12] / np.outer(size, size)).max() < 1e-6, frequency
        assert np.abs((found - wanted)[12:] / size).max() < 1e-6 * np.abs(wanted[12:] / size).max(), frequency


STAGE = """
[bodies.housing]
kind = "housing"

[bodies.housing.reduced]
file = "points.bdf"
length = "1 mm"
mass_unit = "1 t"
unknowns = "rows.txt"
stiffness = "k.mtx"
mass = "m.mtx"
recovery = "r.mtx"
recovered = "seen.txt"
seats = { a = 9001 }
feet = { b = 9003 }
sensors = { s = 4200 }

[[supports]]
name = "b"
body = "housing"
node = "b"
radial = "1e8 N/m"
"""


def test_a_stage_file_names_it(tmp_path: Path, exact: Body) -> None:
    """Read, expanded and reduced like any body of a stage."""
    superelement(tmp_path)
    text = find_stage("planetary54").read_text(encoding="utf-8")
    text = text.replace("[ring.mounts]", '[ring.mounts]\nto = "housing"\nnode = "a"')
    (tmp_path / "stage.toml").write_text(text + STAGE, encoding="utf-8")
    body = reduce_body(load_stage(tmp_path), "housing")
    assert body.frequency == pytest.approx(exact.frequency[: len(body.frequency)], rel=1e-6)
    assert body.mass == pytest.approx(exact.mass, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seats": {"a": 77}}, "seats.a: no row 77.1; points of the superelement: 9001, 9003"),
        ({"feet": {"b": SENSOR}}, "feet.b: no row 4200.4"),
        ({"unknowns": ""}, "give `unknowns`: what each of its 60 rows is"),
        ({"file": "moved.bdf"}, "rigid motion needs force up to"),
        ({"mass": "k.mtx"}, "kg along x, y and z: it must be one positive mass"),
        ({"recovery": "k.mtx"}, "60 rows and 60 columns, expected"),
        ({"file": "rows.txt"}, "no GRID card and no"),
        ({"surface": "points.bdf"}, "there is no line BEGIN BULK"),
    ],
)  # fmt: skip
def test_what_does_not_belong_together_is_told(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    """A point that is nowhere, one without rotations, rows without names, other places, other matrices."""
    (tmp_path / "moved.bdf").write_text(f"GRID,{SEAT},,0.,0.,0.\nGRID,{FOOT},,0.,20.,40.\n", encoding="ascii")
    files = {"mass", "recovery", "file", "surface"}
    own = {key: str(tmp_path / value) if key in files else value for key, value in change.items()}
    with pytest.raises(MeshError, match=re.escape(words)):
        housing_order(superelement(tmp_path, **own))


RIGID = """*NODE
9001, 10., 8., 0.
9002, 10., 8., 0.
9003, 10., 8., 40.
9004, 10., 8., 40.
*RIGID BODY, NSET=A, REF NODE=9001, ROT NODE=9002
*RIGID BODY, NSET=B, REF NODE=9003, ROT NODE=9004
*MATERIAL, NAME=STEEL
*ELASTIC
206000., 0.3
*DENSITY
7.85e-9
*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL
*STEP
*FREQUENCY, SOLVER=MATRIXSTORAGE
10
*END STEP
"""


@pytest.mark.needs("ccx")
def test_one_that_calculix_made_is_ours(tmp_path: Path, exact: Body) -> None:
    """K and M of the brick between two rigid bodies, as CalculiX stores them, rotations at their own nodes. Margin:
    1e-9, the digits of the files."""
    deck(tmp_path / "job.inp", RIGID)
    subprocess.run(["ccx", "job"], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    table = {
        "file": str(tmp_path / "job.inp"), "length": 1e-3, "mass_unit": 1e3, "stiffness": str(tmp_path / "job.sti"),
        "mass": str(tmp_path / "job.mas"), "unknowns": str(tmp_path / "job.dof"), "seats": {"a": 9001},
        "feet": {"b": 9003}, "rotations": {"a": 9002, "b": 9004},
    }  # fmt: skip
    body = reduced_housing(HousingBody(name="housing", kind="housing", reduced=table))
    assert body.mass == pytest.approx(exact.mass, rel=1e-7, abs=1e-9)
    assert body.frequency[:40] == pytest.approx(exact.frequency[:40], rel=1e-6)
    scale = np.sqrt(np.outer(np.diag(exact.static), np.diag(exact.static)))
    assert np.abs((body.static - exact.static) / scale).max() < 1e-6
