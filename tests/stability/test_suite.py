"""The suite as a program: table, going on with it, counting of failures; and its judges against known signals."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evidence.stability import bench, checks, loads, record, suite
from evidence.stability.__main__ import stability as command
from evidence.stability.case import Case, Finding
from evidence.stability.motion import RPM, Constant, Step, UpAndDown, loaded, winding
from evidence.stability.scenes import SCENES, what
from evidence.stability.suite import Row, Task, run_suite, tasks
from gearfmu.errors import GearfmuError, SimulationError
from gearfmu.stage import loaded_te

GOOD = Finding("completed", 5e-6, 1e-6, 1e-5, 1.0)
SHORT = ["--scene", "start_in_mid_backlash", "--level", "fast", "--jobs", "1"]


def row(finding: Finding, step: str = "default", h: float = 0.0) -> Row:
    return Row("jammed", Case("fast", step, h), finding, "")


def program(given: list[str]) -> int:
    return int(command(given, standalone_mode=False))


def test_what_counts_as_a_failure() -> None:
    stopped = replace(GOOD, outcome="diverged@0.01")
    drifted = replace(GOOD, outcome="failed", complaints=("energy",))
    assert not row(GOOD).failed and row(stopped).failed and row(drifted).failed
    assert not row(stopped, "half").failed and not row(stopped, "given", 5e-6).failed
    assert row(drifted, "half").failed and row(drifted, "given", 5e-6).failed


def test_scenes_are_listed_without_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert program(["--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(": ")[0] for line in lines] == list(SCENES)


def test_a_table_is_written_and_gone_on_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rows of the same kernel, bodies and scenes stay; others are run again."""
    out = tmp_path / "hard.csv"
    assert program([*SHORT, "--h", "20 us", "--out", str(out)]) == 0
    rows = list(csv.reader(out.open()))
    assert rows[0] == list(suite.COLUMNS) and len(rows) == 2
    assert rows[1][:2] == ["start_in_mid_backlash", "fast"] and float(rows[1][2]) == 2e-5 and rows[1][3] == "completed"
    assert rows == list(csv.reader(capsys.readouterr().out.splitlines()))
    facts = json.loads(out.with_suffix(".json").read_text())
    facts[0]["finding"]["penetration"] = 0.125
    out.with_suffix(".json").write_text(json.dumps(facts))
    assert program([*SHORT[:-1], "2", "--h", "20 us", "--h", "25 us", "--out", str(out)]) == 0
    rows = list(csv.DictReader(out.open()))
    assert {float(r["h_s"]): float(r["penetration_m"]) == 0.125 for r in rows} == {2e-5: True, 2.5e-5: False}
    facts = [entry | {"key": "other kernel"} for entry in facts]
    out.with_suffix(".json").write_text(json.dumps(facts))
    assert program([*SHORT, "--h", "20 us", "--out", str(out)]) == 0
    assert float(next(csv.DictReader(out.open()))["penetration_m"]) < 1e-3


def test_a_row_is_of_its_kernel_its_stage_and_its_own_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Contact damping changes no body, and yet the rows are others; a check of sets is none of pairs."""
    (tmp_path / "stage.toml").write_text(
        f'base = "{bench.model(bench.Variant(bench.PLAIN)).spec.source}"\n[contact]\ndamping = "100e3 N*s/m^2"\n'
    )
    scenes = ("jammed", "set_jammed", "train_reversal")

    def moved(before: list[str]) -> list[str]:
        return [scene for scene, key in zip(scenes, before, strict=True) if suite.key_of(scene) != key]

    before = [suite.key_of(scene) for scene in scenes]
    assert not moved(before)
    with monkeypatch.context() as changed:
        changed.setattr(suite, "PLAIN", str(tmp_path / "stage.toml"))
        assert "jammed" in moved(before)
    sources = suite._source
    for file, touched in {"set_loads": ["set_jammed"], "trains": ["train_reversal"], "checks": list(scenes)}.items():
        with monkeypatch.context() as changed:
            changed.setattr(suite, "_source", lambda name, file=file: sources(name) + "#" * (name == file))
            assert moved(before) == touched
    monkeypatch.setenv("GEARFMU_BEHAVIOUR", "other inputs")
    assert moved(before) == list(scenes)


def test_failures_are_counted_and_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    bad = replace(GOOD, outcome="failed", complaints=("the mesh sings",))
    monkeypatch.setattr(suite, "run_suite", lambda *_: [row(bad), row(GOOD), row(bad)])
    assert program([]) == 2
    assert "the mesh sings" in capsys.readouterr().err
    monkeypatch.setattr(suite, "run_suite", lambda *_: [row(bad)] * 120)
    assert program([]) == 99


def test_an_unknown_scene_and_a_damaged_table_are_named(tmp_path: Path) -> None:
    with pytest.raises(GearfmuError, match="jamed"):
        program(["--scene", "jamed"])
    (tmp_path / "a.csv").write_text("")
    (tmp_path / "a.json").write_text('[{"scene": 1}]')
    with pytest.raises(GearfmuError, match="remove the file"):
        run_suite([], tmp_path / "a.csv", 1)


def test_tasks_are_every_combination() -> None:
    wanted = tasks(tuple(SCENES), ("fast", "full"), ("default", 5e-6))
    assert len(wanted) == 4 * len(SCENES) == len(set(wanted))
    assert wanted[1] == Task("ten_million_steps", Case("fast", "given", 5e-6))
    assert all(len(what(name)) > 20 for name in SCENES)


def test_what_the_kernel_refuses_is_an_outcome(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(case: Case) -> Finding:
        raise SimulationError("no equilibrium", "no_equilibrium", 0.0)

    monkeypatch.setitem(SCENES, "jammed", none)
    at_default, at_half = (suite.judge(Task("jammed", Case("fast", step))) for step in ("default", "half"))
    assert at_default.outcome == at_half.outcome == "no_equilibrium@0"
    assert at_default.complaints and not at_half.complaints
    refused = suite.judge(Task("start_in_mid_backlash", Case("fast", "given", 9e-4)))
    assert refused.outcome == "refused"


@pytest.fixture(scope="module")
def calm() -> record.Record:
    """302 N·m at rest for 10 ms."""
    inputs = loaded(loads.RELIEVED, Constant(0.0), loads.NOMINAL)
    return record.run(bench.kernel(bench.model(loads.RELIEVED), Case("fast")), inputs, 0.01, 1e-4)


def test_half_and_quarter_are_of_the_kernels_own_step(calm: record.Record) -> None:
    stage = bench.model(loads.RELIEVED)
    own = bench.internal_step(stage, Case("fast", "half")) * 2
    assert calm.h <= own <= 7.5e-6 and own > 0.99 * 7.5e-6
    assert bench.internal_step(stage, Case("fast", "quarter")) == own / 4


def test_overlap_at_rest_is_the_elastic_approach(calm: record.Record) -> None:
    """On rigid bearings the transmission error is all approach of the involutes."""
    pair = bench.geometry(loads.RELIEVED)
    approach = loaded_te(bench.model(loads.RELIEVED), [loads.NOMINAL], 16, rigid_bearings=True).te[0]
    depth = record.overlap(calm, pair)
    assert approach.min() * 0.98 < depth[0] < approach.max() * 1.02 and np.ptp(depth) < 1e-9


def test_judges_hear_what_is_wrong(calm: record.Record) -> None:
    pair = bench.geometry(loads.RELIEVED)
    assert checks.finding(calm, pair).outcome == "completed" and not checks.finding(calm, pair).complaints
    values = dict(calm.values)
    values["mesh.te"] = np.where(calm.time > 0.005, np.nan, values["mesh.te"])
    assert "mesh.te is not finite" in checks.finding(replace(calm, values=values), pair).complaints
    leak = 2e-4 * calm["energy.stored"].max() * calm.time / calm.time[-1]
    leaking = dict(calm.values) | {"energy.stored": calm["energy.stored"] + leak}
    assert "energy" in checks.finding(replace(calm, values=leaking), pair).complaints[0]
    deeper = calm["pinion.gear.phi"] + np.where(calm.time > 0.00995, 60e-6 / pair.gears[0].r_b, 0.0)
    sunk = dict(calm.values) | {"pinion.gear.phi": deeper}
    assert "overlap by 102.0 µm at 0.01 s" in checks.finding(replace(calm, values=sunk), pair).complaints[0]
    unsolved = dict(calm.values) | {"solver.retried_steps": np.where(calm.time > 0.005, 1.0, 0.0)}
    assert "left unsolved is 1" in checks.finding(replace(calm, values=unsolved), pair).complaints[0]
    assert checks.finding(calm, pair, ["too quiet"]).outcome == "failed"
    assert checks.finding(replace(calm, outcome="diverged"), pair).outcome == "diverged@0.01"


def test_a_run_that_stops_is_named_with_its_last_good_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """From 3 ms on the pinion's shaft end turns by 100 rad a step: no scene, but what a scene would make of it."""
    calm = loaded(loads.RELIEVED, Constant(100.0), loads.NOMINAL)

    def mad(case: Case) -> Finding:
        def inputs(time: float) -> dict[str, float]:
            return dict(calm(time)) | ({"pinion.phi": 1e6 * time} if time > 3e-3 else {})

        made = record.run(bench.kernel(bench.model(loads.RELIEVED), case), inputs, 0.02, 1e-4)
        raise AssertionError(f"this cannot run to its end: {made.time[-1]}")

    monkeypatch.setitem(SCENES, "jammed", mad)
    found = suite.judge(Task("jammed", Case("fast")))
    outcome, _, time = found.outcome.partition("@")
    assert outcome in {"diverged", "penetration", "energy"} and 0.003 <= float(time) < 0.02
    assert found.realtime_factor > 0 and found.penetration > 0 and row(found).failed


def test_levels_of_a_sine() -> None:
    """10 N rms at 500 Hz are 20 dB in their band and nothing in the other."""
    time = np.arange(4001) * 1e-4
    values = {"mesh.force_mean": 100 + 10 * np.sqrt(2) * np.sin(2 * np.pi * 500 * time)}
    made = record.Record(time, values, time, "completed", 1.0)
    found = checks.levels(made)
    assert found["level_200_1000_Hz_dB"] == pytest.approx(20.0, abs=0.05) and found["level_1000_4000_Hz_dB"] < -20


@pytest.mark.parametrize("motion", [UpAndDown(500.0, 1800.0, 2.0), Step(0.3, 0.9, -0.1, 0.4), Constant(3.0)])
def test_speed_and_acceleration_are_derivatives(motion: UpAndDown | Step | Constant) -> None:
    d = 1e-4
    for time in (0.31, 0.5, 0.88, 1.5, 2.5, 3.9):
        before, now, after = (motion(time + k * d) for k in (-1, 0, 1))
        assert now.w == pytest.approx((after.phi - before.phi) / (2 * d), rel=1e-6, abs=1e-6)
        assert now.a == pytest.approx((after.w - before.w) / (2 * d), rel=1e-5, abs=1e-4)


def test_winding_carries_the_torque_on_either_side() -> None:
    """At rest under the winding of ±T the wheel's shaft holds T times the ratio."""
    for torque in (302.0, -302.0):
        stage = bench.model(loads.RELIEVED)
        inputs = loaded(loads.RELIEVED, Constant(100 * RPM), torque)
        made = record.run(bench.kernel(stage, Case("fast")), inputs, 0.05, 1e-4)
        assert made["wheel.tau_mean"][100:].mean() == pytest.approx(-torque * 1.5, rel=0.02)
        assert np.sign(winding(loads.RELIEVED, torque)) == np.sign(torque)
