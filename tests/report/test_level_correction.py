"""The price list: read back as written, shown only with the bodies it was measured with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu import report
from gearfmu.body import load_bodies
from gearfmu.report import levels
from gearfmu.stage.run.trace import Channel, Trace, write_columns
from gearfmu.stagefile.stage import load_stage

ROW = ("pair_loaded", "fast", 28, 5, 6.7, 0.0123, 0.04, 0.05, -0.001, 0.15)


def write_list(path: Path, bodies: str) -> None:
    write_columns(path, {name: np.array([value]) for name, value in zip(levels.COLUMNS, (*ROW, bodies), strict=True)})


def test_list_reads_back(tmp_path: Path) -> None:
    write_list(tmp_path / "l.csv", "ab+cd")
    assert levels.read_levels(tmp_path / "l.csv") == [dict(zip(levels.COLUMNS, (*ROW, "ab+cd"), strict=True))]
    (tmp_path / "other.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    assert levels.read_levels(tmp_path / "other.csv") == [] == levels.read_levels(tmp_path / "none.csv")


@pytest.mark.parametrize("fresh", [True, False])
def test_shown_only_with_its_bodies(tmp_path: Path, fresh: bool) -> None:
    shipped = load_stage("fzg_c/stage_relief")
    bodies = load_bodies(shipped)
    spec = shipped.model_copy(update={"source": tmp_path / "stage.toml"})
    made_with = levels.fingerprint(body.how.hash for body in bodies) if fresh else "0+0"
    write_list(levels.levels_path(spec), made_with)
    t = np.arange(50) * 1e-4
    trace = Trace(t, {"mesh.force": Channel(np.sin(t), "N")}, {})
    page = report.write(trace, {"level": "fast"}, tmp_path / "out", spec, bodies).read_text(encoding="utf-8")
    assert ("pair_loaded, fast ←" in page and "1.2 %" in page) == fresh
    assert ("has not been measured" in page) != fresh
