"""Sweeps: the numbers are those of the functions for one point; nothing is computed twice, failures are named."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gearfmu as gf
from gearfmu import cli
from gearfmu.api import plans
from gearfmu.errors import SpecError
from gearfmu.sweeps import table as tables
from gearfmu.sweeps.charts import write_charts
from gearfmu.sweeps.page import write_page
from gearfmu.sweeps.plan import RUN, SIMULATE, TE, SweepError, key_and_values, plan, split
from gearfmu.sweeps.runners import in_this_process
from gearfmu.sweeps.table import SweepTable

STAGE = "fzg_c/stage_relief"
RELIEF = "stage.gears.pinion.tip_relief.amount"
TORQUES = ["80 N*m", 302.0]


@pytest.fixture(scope="module")
def harris(tmp_path_factory: pytest.TempPathFactory) -> gf.SweepTable:
    over = {"torque": TORQUES, RELIEF: ["10 um", "1 mm"], "positions": 8}
    return gf.sweep(STAGE, over, tmp_path_factory.mktemp("harris"), on=1)


def test_a_point_has_the_numbers_of_the_function_for_one(harris: gf.SweepTable) -> None:
    stage = gf.load(STAGE, {"gears.pinion.tip_relief.amount": "10 um"})
    one = gf.te(stage, TORQUES, 8)
    good = harris["outcome"] == "ok"
    assert harris["torque_Nm"][good].tolist() == [80.0, 302.0]
    assert harris["te_mean_um"][good] == pytest.approx(1e6 * one.te.mean(axis=1), rel=1e-12)
    assert harris["te_order_1_um"][good] == pytest.approx(1e6 * one.harmonics(1)[:, 0], rel=1e-12)
    for name in ("mesh_stiffness", "stage_stiffness"):
        values = 1e-6 * getattr(one, name)
        assert harris[f"{name}_mean_N_per_um"][good] == pytest.approx(values.mean(axis=1), rel=1e-8)
        assert harris.curves[f"{name}_N_per_um"] == pytest.approx(values.ravel(), rel=1e-8)
    assert harris.curves["te_um"] == pytest.approx(1e6 * one.te.ravel(), rel=1e-12)


def test_a_point_that_fails_is_a_row_with_its_reason(harris: gf.SweepTable) -> None:
    assert harris["outcome"].tolist() == ["ok", "SpecError"] * 2
    assert len(harris.failures) == 2 and "amount = 1 mm: more than a tenth of the module" in harris.failures[0]
    assert np.isnan(harris["te_mean_um"][1])


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Points are computed in this process: `harris` and test_runners.py have workers."""
    monkeypatch.setattr(plans, "on_this_machine", lambda workers: in_this_process)


@pytest.mark.needs("xarray")
def test_results_over_the_swept_keys(harris: gf.SweepTable) -> None:
    grid = harris.to_xarray()["te_mean_um"]
    assert grid.dims == ("torque_Nm", f"{RELIEF}_m") and grid.shape == (2, 2)
    assert float(grid[1, 0]) == harris["te_mean_um"][2]


def test_pictures(harris: gf.SweepTable, tmp_path: Path) -> None:
    names = [path.name for path in write_charts(harris, tmp_path)]
    assert names == ["harris.png", "te_orders.png"]
    assert all((tmp_path / name).stat().st_size > 10_000 for name in names)


@pytest.mark.usefixtures("here")
def test_a_sweep_goes_on_where_it_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last line of the journal is cut off, as by a process that was killed, and one point is new: two are computed
    and the line of the other stays. Where pyarrow is missing the table is CSV."""
    monkeypatch.setattr(tables, "has", lambda module: False)
    gf.sweep(STAGE, {"torque": [50.0, 100.0], "positions": 4}, tmp_path, on=1)
    journal = tmp_path / "points.jsonl"
    kept, _ = journal.read_text(encoding="utf-8").splitlines()
    journal.write_text(f'{kept}\n{{"identity": "cut o', encoding="utf-8")
    done: list[float] = []
    table = gf.sweep(
        STAGE,
        {"torque": [50.0, "100 N*m", 150.0], "positions": 4},
        tmp_path,
        on=1,
        progress=lambda part, text="": done.append(part),
    )
    assert done == [pytest.approx(2 / 3), 1.0]
    lines = journal.read_text(encoding="utf-8").splitlines()
    assert lines[0] == kept and len(lines) == 4 and all(json.loads(line)["name"] == "ok" for line in lines[2:])
    with (tmp_path / "sweep.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["te_mean_um"]) for row in rows] == table["te_mean_um"].tolist()
    assert np.all(np.diff(table["te_mean_um"]) > 0)


@pytest.mark.usefixtures("here")
def test_a_scene_and_a_stage_alone_by_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Levels over torque and speed with traces; a run that is stopped, here refused by the kernel, is counted."""
    short = ["--over", "duration=40 ms", "--over", "settle=10 ms", "--jobs", "1", "--out", str(tmp_path)]
    over = ["--over", "torque=100, 200 N*m", "--over", "speed=3000 rpm", "--over", "level=rigid, fas"]
    assert cli.outcome(["sweep", STAGE, *over, *short, "--traces"]) == 2
    out, err = capsys.readouterr()
    assert "4 points, 2 failed" in out and err.count("level = fas: expected rigid | fast") == 2
    traces = sorted((tmp_path / "traces").glob("*.h5"))
    assert len(traces) == 2 and (tmp_path / "levels.png").is_file()
    force = {t.meta["torque"]: t.window(0.01)["mesh.force"].mean() for t in map(gf.Trace.load, traces)}
    assert force[200.0] == pytest.approx(2 * force[100.0], rel=2e-3)

    over = ["--over", "torque=100, 200 N*m", "--over", "stage.level=rigid", "--over", "coupling.step=50 us"]
    assert cli.outcome(["sweep", "pair_loaded", *over, *short]) == 0
    scene = {
        "torque": "200 N*m",
        "stage.level": "rigid",
        "coupling.step": "50 us",
        "duration": "40 ms",
        "settle": "10 ms",
    }
    alone = gf.run(gf.load_scene("pair_loaded", scene), unit="kernel")
    table = gf.sweep("pair_loaded", [scene], tmp_path, on=1)  # known already: nothing is computed
    assert table["mesh_force_mean_N"][0] == pytest.approx(alone.window(0.01)["mesh.force"].mean(), rel=1e-12)
    assert len((tmp_path / "points.jsonl").read_text(encoding="utf-8").splitlines()) == 6


# ---- the page: every result over the keys, the points and the failures -----------------------------------------------
def test_the_page_has_figures_points_and_failures(harris: gf.SweepTable, tmp_path: Path) -> None:
    text = write_page(harris, STAGE, tmp_path).read_text(encoding="utf-8")
    assert f"<h1>{STAGE} over torque, {RELIEF}" in text and "4 points, 2 failed" in text
    assert f"torque_Nm = 302, {RELIEF}_m = 0.001: SpecError: " in text
    for title in ("Transmission error over the mesh cycle", "Transmission error, peak to peak"):
        assert f"<h2>{title}</h2>" in text
    number = f"{harris['te_pp_um'][0]:.4g}"
    assert f'<td class="n">{number}</td>' in text and harris.files[0].name in text and harris.files[1].name in text


def test_a_sweep_without_results_has_a_page_with_its_reasons(harris: gf.SweepTable, tmp_path: Path) -> None:
    columns = {name: values[3:] for name, values in harris.columns.items()}
    text = write_page(SweepTable(columns, harris.axes, tmp_path), "pair", tmp_path).read_text(encoding="utf-8")
    assert "1 points, 1 failed" in text.replace("1 point,", "1 points,") and "a tenth of the module" in text


# ---- points of a sweep: grids, keys and what they belong to, values as text ------------------------------------------
@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("torque=100, 200,300 N*m", ["100 N*m", "200 N*m", "300 N*m"]),
        ("torque=100 N*m, 0.2 kN*m", ["100 N*m", "0.2 kN*m"]),
        ("speed=1000:2000:3 rpm", ["1000 rpm", "1500 rpm", "2000 rpm"]),
        ("stage.slices=3,5", [3, 5]),
        ("final=1.5:2:2", [1.5, 2.0]),
        ("stage.level=fast, full", ["fast", "full"]),
        ("stage.effects.hertz=true,false", [True, False]),
        ("ratio=4.1", [4.1]),
    ],
)
def test_values_as_text(text: str, values: list[Any]) -> None:
    key, found = key_and_values(text)
    assert key == text.partition("=")[0] and found == values and list(map(type, found)) == list(map(type, values))


@pytest.mark.parametrize("text", ["torque", "=1", "torque=", "speed=a:b:3 rpm"])
def test_values_that_are_none(text: str) -> None:
    with pytest.raises(SweepError, match="start:end:count|KEY=VALUES"):
        key_and_values(text)


def test_the_last_key_of_a_grid_is_fastest_and_single_values_are_no_axes() -> None:
    made = plan("pair_loaded", {"torque": [1.0, 2.0], "stage.level": "fast", "speed": ["1 rpm", "2 rpm"]})
    assert made.what == RUN and made.axes == ("torque", "speed")
    assert [(p["torque"], p["speed"]) for p in made.points] == [(1, "1 rpm"), (1, "2 rpm"), (2, "1 rpm"), (2, "2 rpm")]


def test_a_stage_with_a_speed_is_run_and_without_one_is_static() -> None:
    assert plan("fzg_c", {"torque": [1.0], "speed": [2.0]}).what == SIMULATE
    assert plan("fzg_c", {"torque": [1.0]}).what == TE
    with pytest.raises(SweepError, match="its points need torque"):
        plan("fzg_c", {"speed": [1.0]})
    with pytest.raises(SweepError, match="all with the same keys"):
        plan("fzg_c", [{"torque": 1.0}, {"torque": 1.0, "level": "fast"}])
    with pytest.raises(SpecError, match="no such stage"):
        plan("fzg_q", {"torque": [1.0]})


def test_keys_belong_to_the_scene_or_to_the_stage_file() -> None:
    keys = "torque stage.level stage.contact stage.contact.damping stage.effects.hertz stage.torque_max".split()
    stage, scene = split(RUN, dict.fromkeys(keys, 1))
    assert set(stage) == {"contact.damping", "torque_max"}
    assert set(scene) == {"torque", "stage.level", "stage.contact", "stage.effects.hertz"}


@pytest.mark.parametrize(
    ("subject", "key", "unit"),
    [
        ("pair_loaded", "torque", "N*m"),
        ("clutch_closure", "torque", "N*m"),
        ("pair_loaded", "speed", "rad/s"),
        ("pair_loaded", "coupling.step", "s"),
        ("pair_loaded", "stage.level", None),
        ("pair_loaded", "stage.gears.wheel.tip_relief.amount", "m"),
        ("pair_loaded", "stage.ports.wheel.k", "N*m/rad"),
        ("two_stage", "stage.bodies.pinion1.face_width", "m"),
        ("planetary54", "stage.set.load_sharing", ""),
        ("planetary_backfire", "shaft_loads.carrier.alternating.frequency", "Hz"),
    ],
)
def test_units_of_keys(subject: str, key: str, unit: str | None) -> None:
    assert plan(subject, {"torque": 1.0, key: 1.0}).unit(key) == unit
