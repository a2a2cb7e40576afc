"""The notebooks run from top to bottom as they stand, and their numbers are right."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = ROOT / "examples" / "notebooks"
BASE_RADIUS = 0.5 * 4.5e-3 * 16 * 0.9396926207859084  # m, pinion of fzg_c

pytestmark = [pytest.mark.full, pytest.mark.needs("nbclient", "ipykernel", "xarray")]


def executed(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The code cells of a notebook, run in `folder`; an error in a cell is raised here."""
    import nbformat
    from nbclient import NotebookClient

    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    book = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
    NotebookClient(book, timeout=900, resources={"metadata": {"path": str(folder)}}).execute()
    return [cell for cell in book.cells if cell.cell_type == "code"]


def printed(cells: list[Any]) -> str:
    outputs = [output for cell in cells for output in cell.outputs]
    return "".join(output.get("text", "") or output.get("data", {}).get("text/plain", "") for output in outputs)


def pictures(cells: list[Any]) -> int:
    return sum("image/png" in output.get("data", {}) for cell in cells for output in cell.outputs)


def test_first_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mesh force is torque over base radius; four pictures; a trace is shown; FMU, report, table."""
    cells = executed("first_steps", tmp_path, monkeypatch)
    force = re.search(r"mean mesh force (\d+) N, outcome completed", printed(cells))
    assert force and float(force[1]) == pytest.approx(302 / BASE_RADIUS, rel=5e-3)
    assert pictures(cells) == 4
    shown = [output.get("data", {}) for cell in cells for output in cell.outputs if cell.source == "trace"]
    assert shown and "text/html" in shown[0] and "'mesh.force_drive'" in printed(cells)
    made = {path.name for path in (tmp_path / "out" / "first_steps").iterdir()}
    assert {"fzg_c_relief.fmu", "report.html", "bearing.csv"} <= made


def test_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The notebook asserts that more relief suits more torque; the middle point carries 200 N·m."""
    cells = executed("sweep", tmp_path, monkeypatch)
    force = re.search(r"torque_Nm = 200, .*: mean mesh force (\d+) N", printed(cells))
    assert force and float(force[1]) == pytest.approx(200 / BASE_RADIUS, rel=5e-3)
    assert pictures(cells) == 2 and (tmp_path / "out" / "notebook_sweep" / "levels" / "levels.png").is_file()


def test_every_notebook_has_its_test_and_no_output() -> None:
    import nbformat

    names = {path.stem for path in NOTEBOOKS.glob("*.ipynb")}
    tested = set(re.findall(r'executed\("(\w+)"', Path(__file__).read_text(encoding="utf-8")))
    assert names == tested
    for name in names:
        book = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
        assert not [cell for cell in book.cells if cell.get("outputs") or cell.get("execution_count")]
