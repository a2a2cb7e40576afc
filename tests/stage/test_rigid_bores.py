"""Rigid bores from the stage file and from the command line: bodies of their own, a stiffer stage."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from gearfmu import cli
from gearfmu.body import load_bodies
from gearfmu.errors import BodyError
from gearfmu.stagefile.forms.expand import with_bores
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import expected_hash

ROOT = Path(__file__).parents[2]
COARSE = """
base = "{base}"

[gears.pinion.body]
modes = 12
roll_points = 8
width_functions = 3
mesh = {{ scale = 0.3 }}

[gears.wheel.body]
modes = 12
roll_points = 8
width_functions = 3
mesh = {{ scale = 0.3 }}
"""


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    """The shipped pair on a coarse mesh."""
    base = (ROOT / "reduced_models" / "fzg_c" / "stage.toml").as_posix()
    (tmp_path / "stage.toml").write_text(COARSE.format(base=base), encoding="utf-8")
    return tmp_path / "stage.toml"


def mean_te(stage: Path, *options: str) -> float:
    out = stage.parent / "te.csv"
    line = ["te", str(stage), "--torque", "302 N*m", "--positions", "6", "--rigid-bearings", "--out", str(out)]
    assert cli.outcome([*line, *options]) == 0
    with open(out, newline="", encoding="utf-8") as file:
        return float(np.mean([float(row["te_um"]) for row in csv.DictReader(file)]))


def test_te_takes_rigid_bores_and_leaves_the_bodies_of_the_stage_alone(
    stage: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the converged mesh the mean falls by 4.1 %."""
    monkeypatch.setattr("gearfmu.report.te.write_plot", lambda *of: None)
    averaged = mean_te(stage)
    own = {path.name: path.read_bytes() for path in stage.parent.glob("*.h5")}
    rigid = mean_te(stage, "--bore", "rigid")
    assert "bores rigid" in capsys.readouterr().out
    made = {path: path.stat().st_mtime_ns for path in (stage.parent / "bores_rigid").glob("*.h5")}
    assert -0.06 < rigid / averaged - 1 < -0.03
    assert mean_te(stage, "--bore", "averaging") == averaged  # what the stage file says anyway
    assert mean_te(stage, "--bore", "rigid") == rigid
    assert {path.name: path.read_bytes() for path in stage.parent.glob("*.h5")} == own
    assert {path: path.stat().st_mtime_ns for path in made} == made and len(made) == 2

    wheel = '[gears.wheel]\nbore_coupling = "rigid"\n\n[gears.wheel.body]'
    text = stage.read_text(encoding="utf-8").replace("[gears.wheel.body]", wheel)
    stage.write_text(text, encoding="utf-8")
    with pytest.raises(BodyError, match="stale"):
        load_bodies(load_stage(stage))
    one = mean_te(stage)
    assert rigid < one < averaged


def test_a_rigid_bore_has_a_hash_and_a_default_that_changes_none() -> None:
    for name in ("fzg_c", "helical_demo"):
        spec = load_stage(name)
        rigid, same = with_bores(spec, "rigid"), with_bores(spec, "averaging")
        assert same == spec
        for gear in ("pinion", "wheel"):
            assert expected_hash(rigid, gear) != expected_hash(spec, gear)
        assert [gear.rigid_bore for gear in rigid.gears] == [True, True]
    train = load_stage("two_stage")
    assert with_bores(train, "averaging") == train
    assert all(gear.rigid_bore for gear in with_bores(train, "rigid").gears)
