"""docs/howto-import.md does what it says, and CalculiX's matrices have CalculiX's frequencies."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from decks import STEEL
from verbs import call

from gearfmu.body import load_body
from gearfmu.fem import solids
from gearfmu.fem.coupling import rigid_modes
from gearfmu.fem.matrices import read_matrix, read_unknowns
from gearfmu.femesh.imported import read_mesh, repeated_cells
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.stage import Trace

ROOT = Path(__file__).resolve().parents[2]
DECK = ROOT / "examples" / "imported_pinion" / "pinion.inp"


def commands() -> str:
    """The first block of the page."""
    return (ROOT / "docs" / "howto-import.md").read_text(encoding="utf-8").split("```")[1]


def test_the_deck_of_the_page_is_the_one_that_mesh_writes(tmp_path: Path) -> None:
    command = re.search(r"`gearfmu (mesh fzg_c .*?)`", (ROOT / "docs" / "howto-import.md").read_text(encoding="utf-8"))[
        1
    ]
    assert call(*command.split(), "--out", tmp_path)[0] == 0
    assert (tmp_path / "pinion.inp").read_text(encoding="utf-8") == DECK.read_text(encoding="utf-8")


def test_import_prints_the_section(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, _ = call("import", DECK, "fzg_c", "pinion", "--length", "1 mm", "--bore", "BORE")
    assert code == 0 and '[gears.pinion.import]\nfile = "pinion.inp"\nlength = "1 mm"\nbore = "BORE"' in out
    assert re.search(r"base_radius_m +0\.0338289", out) and re.search(r"method +cyclic", out)
    assert not list(tmp_path.iterdir())


@pytest.mark.full
@pytest.mark.needs("ccx")
def test_the_page_runs_as_it_stands(tmp_path: Path) -> None:
    for name in ("examples", "reduced_models"):
        (tmp_path / name).symlink_to(ROOT / name)
    script = f'set -e\ngearfmu() {{ "{sys.executable}" -m gearfmu.cli "$@"; }}\n' + commands()
    done = subprocess.run(
        ["bash", "-c", script], capture_output=True, text=True, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    body, shipped = (
        load_body(tmp_path / "mine" / "pinion.h5"),
        load_body(ROOT / "reduced_models" / "fzg_c" / "pinion.h5"),
    )
    assert body.how.mesh["method"] == "cyclic" and body.how.mesh["fit"]["residual_max_um"] < 1e-3
    assert np.abs(body.frequency[:60] / shipped.frequency[:60] - 1).max() < 0.015  # a coarse mesh
    te = re.search(r"302\.0 N·m: mean ([\d.]+) µm, peak to peak ([\d.]+) µm", done.stdout)
    assert te, done.stdout
    mean = subprocess.run(
        [sys.executable, "-m", "gearfmu.cli", "te", "fzg_c", "--torque", "302 N*m", "--positions", "12", "--out",
        str(tmp_path / "te.csv")], capture_output=True, text=True, check=True, cwd=tmp_path, env=os.environ |
        {"PYTHONPATH": str(ROOT)}, ).stdout  # fmt: skip
    assert float(te[1]) == pytest.approx(float(re.search(r"mean ([\d.]+)", mean)[1]), rel=0.02)
    trace = Trace.load(next((tmp_path / "mine").rglob("trace.h5")))
    late = trace.time > 5e-3
    assert trace["mesh.force"][late].mean() == pytest.approx(302 / 0.033829, rel=0.02)


STEP = "{bore}*STEP\n*FREQUENCY\n{count}\n*END STEP\n"


@pytest.mark.full
@pytest.mark.needs("ccx")
def test_with_calculix_matrices_our_frequencies_are_calculix_own(tmp_path: Path) -> None:
    """The sector of the deck: K and M as CalculiX stores them, its first 20 frequencies as it prints them. With the
    bore held to the last printed digit; free, CalculiX solves with a singular matrix and its own figures are 5e-5 off
    those of ARPACK on the same matrices."""
    text = DECK.read_text(encoding="utf-8")
    mesh_only = text.split("** CalculiX writes")[0]
    (tmp_path / "pinion.inp").write_text(text, encoding="utf-8")
    (tmp_path / "held.inp").write_text(
        mesh_only + STEP.format(bore="*BOUNDARY\nBORE, 1, 3\n", count=40), encoding="utf-8"
    )
    (tmp_path / "free.inp").write_text(mesh_only + STEP.format(bore="", count=40), encoding="utf-8")
    for job in ("pinion", "held", "free"):
        subprocess.run(["ccx", job], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    mesh = read_mesh(tmp_path / "pinion.inp", 1e-3)
    unknowns = read_unknowns(tmp_path / "pinion.dof")
    stiffness, mass = (1e3 * read_matrix(tmp_path / f"pinion.{s}", unknowns, mesh.labels) for s in ("sti", "mas"))
    of_dof = np.repeat(np.arange(len(mesh.nodes)), 3)
    cells = repeated_cells(mesh.elements)
    free = FullOrder("sector", stiffness, mass, rigid_modes(mesh.nodes), (), (), 1.0, cells, of_dof)
    bore = (3 * mesh.node_set("BORE")[:, None] + np.arange(3)).ravel()
    held = free.held(sp.csr_array(sp.eye_array(free.size, format="csr")[bore]))
    off = {}
    for name, body, first in (("held", held, 0), ("free", free, 6)):
        printed = calculix_eigenvalues(tmp_path / f"{name}.dat")[first : first + 20]
        off[name] = float(np.abs(np.sqrt(Elastic(body).modes(20)[0] / printed) - 1).max())
    own = solids.assemble(mesh.nodes, mesh.elements, STEEL)
    print(f"{off}; elements: K {difference(own[0], stiffness):.1e}, M {difference(own[1], mass):.1e}")
    assert off["held"] < 1e-6 and off["free"] < 2e-4
    assert difference(own[0], stiffness) < 1e-9 and difference(own[1], mass) < 1e-9


def difference(a, b) -> float:
    return float(np.abs((a - b).data).max() / np.abs(b.data).max())


def calculix_eigenvalues(path: Path) -> np.ndarray:
    """ω² (rad²/s²) of the table "E I G E N V A L U E   O U T P U T"."""
    table = path.read_text(encoding="utf-8").split("E I G E N V A L U E")[1].split("P A R T I C I P A T I O N")[0]
    rows = [line.split() for line in table.splitlines()]
    return np.array([float(row[1]) for row in rows if len(row) == 5 and row[0].isdigit()])
