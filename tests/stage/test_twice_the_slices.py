"""Slices of helical stages as a discretisation: what te, reports and plans say of their number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu import cli
from gearfmu.cosim.scene_run import stage_model
from gearfmu.planning.choice import space
from gearfmu.scenefile.scene import load_scene
from gearfmu.stage import StageModel, loaded_te
from gearfmu.stage.run import refinement
from gearfmu.stage.run.refinement import HEARD, ORDERS, POSITIONS, Change, left_of_slices, twice


def test_the_change_is_that_of_two_runs(helical: StageModel) -> None:
    """The largest change of an order, in metres, and in level of those that change by over ten nanometres."""
    left = left_of_slices(helical, [100.0], slices=3)
    three, six = (loaded_te(helical, [100.0], POSITIONS, slices=n).harmonics(ORDERS)[0] for n in (3.0, 6.0))
    heard = np.abs(six - three) > HEARD
    assert left.slices == 6 and left.length == pytest.approx(np.abs(six - three).max(), rel=1e-12)
    assert left.level == pytest.approx(np.abs(20 * np.log10(six / three))[heard].max(), rel=1e-12)
    assert left.text.startswith("orders 1 to 8 change by at most ") and left.text.endswith(" dB with 6 slices")


def test_spur_stages_have_nothing_to_say(plain: StageModel) -> None:
    assert left_of_slices(plain, [302.0]) is None and twice(plain.stage, 5) == 5


def test_no_more_slices_than_a_model_takes(helical: StageModel) -> None:
    assert [twice(helical.stage, n) for n in (1, 7, 10, 14, 20)] == [2, 14, 20, 20, 20]
    assert left_of_slices(helical, [100.0], slices=20) is None


@pytest.fixture
def one_table(helical: StageModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever `te` is asked for, its table is one, and without pictures."""
    result = loaded_te(helical, [100.0], 2)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gearfmu.stage.loaded_te", lambda *of, **where: result)
    for picture in ("write_plot", "write_flanks"):
        monkeypatch.setattr(f"gearfmu.report.te.{picture}", lambda *of: None)


@pytest.mark.usefixtures("one_table")
def test_te_says_what_the_slices_leave_open(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the stage as it was asked for: with held axes here."""

    def left(model: StageModel, torques: tuple[float], slices: None, mesh: str, **parameters: float) -> Change:
        assert (model.name, *torques, slices, parameters) == ("helical_demo", 100.0, None, {"effect.bearings": 0.0})
        return Change(14, 12e-9, 0.3)

    monkeypatch.setattr(refinement, "left_of_slices", left)
    with pytest.raises(SystemExit) as ended:
        cli.main(["te", "helical_demo", "--torque", "100 N*m", "--positions", "4", "--rigid-bearings"])
    assert not ended.value.code and Change(14, 12e-9, 0.3).text in capsys.readouterr().out


@pytest.mark.usefixtures("one_table")
@pytest.mark.parametrize(
    ("stage", "option", "said"),
    [
        ("helical_demo", [], 1),
        ("helical_demo", ["--once"], 0),
        ("two_stage", [], 0),
        ("two_stage", ["--twice-slices"], 2),
    ],
)
def test_te_says_it_of_pairs_and_where_it_is_asked(
    stage: str, option: list[str], said: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once a mesh; trains and sets, where it takes long, on request alone."""
    asked: list[str] = []
    monkeypatch.setattr(refinement, "left_of_slices", lambda *of, **parameters: asked.append(stage))
    with pytest.raises(SystemExit):
        cli.main(["te", stage, "--torque", "100 N*m", "--positions", "2", *option])
    assert len(asked) == said


@pytest.mark.parametrize(("name", "times"), [("train_runup", 2), ("pair_loaded", 1)])
def test_plans_measure_against_twice_the_slices_of_helical_stages(name: str, times: int) -> None:
    scene = load_scene(name)
    found = space(scene, stage_model(scene))
    own = scene.stage.slices
    assert found.full.slices == times * own == max(found.slices) and own in found.slices
