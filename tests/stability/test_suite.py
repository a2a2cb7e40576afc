"""The suite as a program: table, counting of failures; and its judges against known signals, those of sets by overlap
of the flanks from places in two kinds of axes."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evidence.stability import record, suite
from evidence.stability.__main__ import main as program
from evidence.stability.bench import internal_step
from evidence.stability.case import Case, Finding
from evidence.stability.motion import Constant, Step, Swinging, Turn, UpAndDown
from evidence.stability.pair import Pair, overlap
from evidence.stability.planetary import CENTRALS, MESHES, SPEED, PlanetSet, set_overlap, sun_torque
from evidence.stability.record import Record
from evidence.stability.scenes import PAIR, SCENES, Scene
from evidence.stability.suite import Row, Task
from gearfmu.errors import GearfmuError, SimulationError
from gearfmu.stage import loaded_te

GOOD = Finding("completed", 5e-6, 1e-6, 1e-5, 1.0)


def row(finding: Finding, step: str = "default", h: float = 0.0) -> Row:
    return Row("pair_jammed", Case("fast", step, h), finding)


def test_what_counts_as_a_failure() -> None:
    stopped = replace(GOOD, outcome="diverged@0.01")
    drifted = replace(GOOD, outcome="failed", complaints=("energy",))
    assert not row(GOOD).failed and row(stopped).failed and row(drifted).failed
    assert not row(stopped, "half").failed and not row(stopped, "given", 5e-6).failed
    assert row(drifted, "half").failed and row(drifted, "given", 5e-6).failed


def test_a_table_is_written_and_read_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "hard.csv"
    short = ["--scene", "pair_mid_backlash", "--level", "fast", "--jobs", "1"]
    assert program([*short, "--h", "20 us", "--out", str(out)]) == 0
    rows = list(csv.reader(out.open()))
    assert rows == list(csv.reader(capsys.readouterr().out.splitlines()))
    assert rows[0] == list(suite.COLUMNS) and len(rows) == 2
    assert rows[1][:2] == ["pair_mid_backlash", "fast"] and float(rows[1][2]) == 2e-5 and rows[1][3] == "completed"
    assert suite.table(suite.read(out)) == out.read_text()
    out.with_suffix(".json").write_text('[{"scene": 1}]')
    with pytest.raises(GearfmuError, match="make it again"):
        suite.read(out)


def test_failures_are_counted_and_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    bad = replace(GOOD, outcome="failed", complaints=("the mesh sings",))
    monkeypatch.setattr(suite, "run_suite", lambda *_: [row(bad), row(GOOD), row(bad)])
    assert program([]) == 2
    assert "the mesh sings" in capsys.readouterr().err
    monkeypatch.setattr(suite, "run_suite", lambda *_: [row(bad)] * 120)
    assert program([]) == 99


def test_what_the_kernel_refuses_is_an_outcome(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(bench: Pair, case: Case) -> Finding:
        raise SimulationError("no equilibrium", "no_equilibrium", 0.0)

    monkeypatch.setitem(SCENES, "pair_jammed", Scene(none, PAIR))
    at_default, at_half = (suite.judge(Task("pair_jammed", Case("fast", step))) for step in ("default", "half"))
    assert at_default.outcome == at_half.outcome == "no_equilibrium@0"
    assert at_default.complaints and not at_half.complaints
    refused = suite.judge(Task("pair_mid_backlash", Case("fast", "given", 9e-4)))
    assert refused.outcome == "refused"


@pytest.fixture(scope="module")
def calm() -> record.Record:
    """302 N·m at rest for 10 ms."""
    return PAIR.loaded(Case("fast"), Constant(0.0), 302.0, 0.01)


def test_half_and_quarter_are_of_the_kernels_own_step(calm: record.Record) -> None:
    own = internal_step(PAIR.model, Case("fast", "half")) * 2
    assert calm.h <= own <= 7.5e-6 and own > 0.99 * 7.5e-6
    assert internal_step(PAIR.model, Case("fast", "quarter")) == own / 4


def test_overlap_at_rest_is_the_elastic_approach(calm: record.Record) -> None:
    """On rigid bearings the transmission error is all approach of the involutes."""
    approach = loaded_te(PAIR.model, [302.0], 16, **{"effect.bearings": 0.0}).te[0]
    depth = overlap(calm, PAIR.geometry)
    assert approach.min() * 0.98 < depth[0] < approach.max() * 1.02 and np.ptp(depth) < 1e-9


def test_judges_hear_what_is_wrong(calm: record.Record) -> None:
    assert PAIR.finding(calm).outcome == "completed" and not PAIR.finding(calm).complaints
    values = dict(calm.values)
    values["mesh.te"] = np.where(calm.time > 0.005, np.nan, values["mesh.te"])
    assert "mesh.te is not finite" in PAIR.finding(replace(calm, values=values)).complaints
    leak = 2e-4 * calm["energy.stored"].max() * calm.time / calm.time[-1]
    leaking = dict(calm.values) | {"energy.stored": calm["energy.stored"] + leak}
    assert "energy" in PAIR.finding(replace(calm, values=leaking)).complaints[0]
    deeper = calm["pinion.gear.phi"] + np.where(calm.time > 0.00995, 60e-6 / PAIR.geometry.gears[0].r_b, 0.0)
    sunk = dict(calm.values) | {"pinion.gear.phi": deeper}
    assert "overlap by 102.0 µm at 0.01 s" in PAIR.finding(replace(calm, values=sunk)).complaints[0]
    unsolved = dict(calm.values) | {"solver.retried_steps": np.where(calm.time > 0.005, 1.0, 0.0)}
    assert "left unsolved is 1" in PAIR.finding(replace(calm, values=unsolved)).complaints[0]
    assert PAIR.finding(calm, ["too quiet"]).outcome == "failed"
    assert PAIR.finding(replace(calm, outcome="diverged")).outcome == "diverged@0.01"


def test_a_run_that_stops_is_named_with_its_last_good_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """From 3 ms on the pinion's shaft end turns by 100 rad a step: no scene, but what a scene would make of it."""

    def mad(bench: Pair, case: Case) -> Finding:
        calm = bench.turning(Constant(100.0), (Step(0.0, 1.0, 302.0, 302.0),))

        def inputs(time: float) -> dict[str, float]:
            return dict(calm(time)) | ({"pinion.phi": 1e6 * time} if time > 3e-3 else {})

        made = bench.run(case, inputs, 0.02)
        raise AssertionError(f"this cannot run to its end: {made.time[-1]}")

    monkeypatch.setitem(SCENES, "pair_jammed", Scene(mad, PAIR))
    found = suite.judge(Task("pair_jammed", Case("fast")))
    outcome, _, time = found.outcome.partition("@")
    assert outcome in {"diverged", "penetration", "energy"} and 0.003 <= float(time) < 0.02
    assert found.realtime_factor > 0 and found.penetration > 0 and row(found).failed


@pytest.mark.parametrize(
    "motion", [UpAndDown(500.0, 1800.0, 2.0), Step(0.3, 0.9, -0.1, 0.4), Constant(3.0), Swinging(3.0, 40.0, 2.0)]
)
def test_speed_and_acceleration_are_derivatives(motion: Turn) -> None:
    d = 1e-4
    for time in (0.31, 0.5, 0.88, 1.5, 2.5, 3.9):
        before, now, after = (motion(time + k * d) for k in (-1, 0, 1))
        assert now.w == pytest.approx((after.phi - before.phi) / (2 * d), rel=1e-6, abs=1e-6)
        assert now.a == pytest.approx((after.w - before.w) / (2 * d), rel=1e-5, abs=1e-4)


# ---- what judges the scenes of sets ----------------------------------------------------------------------------------
APPROACH = {"sun": (7.0e-9, 8.8e-9), "ring": (12e-9, 15.5e-9)}  # m/N under 600 N·m


def short(bench: PlanetSet, speed: float, duration: float) -> Record:
    return bench.loaded(Case("fast"), Constant(speed), bench.nominal, duration)


@pytest.fixture(scope="module")
def turning() -> Record:
    """A sixth of a turn of the carrier, so that axes that stand and axes that turn differ."""
    return short(PlanetSet(), SPEED, math.pi / 3 / SPEED)


def approach(variant: PlanetSet, record: Record, central: str) -> np.ndarray:
    """(N, n) overlap over force, m/N."""
    rows = []
    for number, mesh in enumerate(MESHES[central]):
        force = record[f"{mesh}.force_drive"] + record[f"{mesh}.force_coast"]
        rows.append(set_overlap(variant, record, central, number) / force)
    return np.array(rows)


@pytest.mark.parametrize("central", CENTRALS)
def test_overlap_under_load_is_the_elastic_approach(turning: Record, central: str) -> None:
    """Of all planets, at rest and in the mean of a run over a sixth of a turn, though pins stand out of place."""
    low, high = APPROACH[central]
    found = approach(PlanetSet(), turning, central)
    assert np.all((low < found[:, 0]) & (found[:, 0] < high)), found[:, 0]
    late = found[:, turning.time > 0.006].mean(axis=1)
    assert np.all((low < late) & (late < high)), late


def test_overlap_does_not_know_how_far_planets_give_way() -> None:
    """Pins of 1e7 N/m, which give way by 0.33 mm: the carrier's axes turn on by two fifths of it."""
    soft = PlanetSet(pin=1e7)
    record = short(soft, 0.0, 2e-5)
    for central, (low, high) in APPROACH.items():
        found = approach(soft, record, central)[:, 0]
        assert np.all((low < found) & (found < high)), found


def test_judges_of_sets_hear_what_is_wrong(turning: Record) -> None:
    assert not PlanetSet().finding(turning).complaints
    assert 4 * sun_torque(turning, 0.006) == pytest.approx(600.0, rel=0.02)
    values = dict(turning.values)
    values["sun_planet2.te"] = values["sun_planet2.te"] - np.where(turning.time > 0.011, 30e-6, 0.0)
    sunk = PlanetSet().finding(replace(turning, values=values)).complaints
    assert len(sunk) == 1 and "flanks of sun_planet2 overlap" in sunk[0]
    leak = 1e-3 * turning.throughput[-1] * turning.time / turning.time[-1]
    leaking = dict(turning.values) | {"energy.stored": turning["energy.stored"] + leak}
    assert "energy" in PlanetSet().finding(replace(turning, values=leaking)).complaints[0]


@pytest.mark.parametrize("level", ["standard", pytest.param("full", marks=pytest.mark.full)])
def test_a_set_without_load_leaves_no_step_unsolved(level: str) -> None:
    """Meshes in the middle of their backlash: of a port that carries 2e-5 N m a pass reads rounding, which was taken
    for a change that does not settle (one step of these, at both levels)."""
    bench, nothing = PlanetSet(), Step(0.0, 1.0, 0.0, 0.0)
    record = bench.run(Case(level), bench.turning(Constant(SPEED), (nothing,)), 0.002)
    assert record["solver.retried_steps"][-1] == 0 and record["solver.steps"][-1] > 150
