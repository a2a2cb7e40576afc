"""A plan from request to run, on a short window of a loaded pair."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfmu.cosim.scene_run import stage_model
from gearfmu.errors import SpecError
from gearfmu.fmu import export
from gearfmu.planning.book import Plan, Segment
from gearfmu.planning.choice import Choice, space
from gearfmu.planning.make import Job, make
from gearfmu.planning.request import request
from gearfmu.planning.run import planned_scene, planned_stage, run_planned
from gearfmu.planning.table import plan_text, run_text
from gearfmu.report.plan import plan_sections
from gearfmu.scenefile.scene import SHIPPED, load_scene
from gearfmu.stage.effects import DISSIPATION, EFFECTS
from gearfmu.sweeps.runners import in_this_process

BAND = ("500 Hz", "5 kHz")
SCENE: dict[str, Any] = {"settle": "20 ms", "duration": "80 ms"}
MEASURED = ("bound", "error", "noise", "price", "realtime", "price_full", "price_default", "error_default")
NOTHING: dict[str, Any] = dict.fromkeys(MEASURED, 0.0)  # of a plan by hand


def by_hand(path: Path, scene: str, duration: str, choice: Choice, bearing: bool, **of_segment: Any) -> Plan:
    """A plan of the first 80 ms of a shipped scene, with one segment under load; written to `path`."""
    text = (SHIPPED / f"{scene}.toml").read_text(encoding="utf-8")
    assert (old := f'duration = "{duration}"') in text
    path.write_text(text.replace(old, 'duration = "80 ms"'), encoding="utf-8")
    segment = Segment("all", 0.0, 0.08, "loaded", choice, 0.02, safety=1.25, **NOTHING, **of_segment)
    outputs = ["mesh.te", "bearing.pinion.fx"] if bearing else ["mesh.te"]
    asked = {"outputs": outputs, "band": ["500 Hz", "5000 Hz"], "budget": "0.2 dB" if bearing else "1 dB"}
    return Plan(str(path), "", load_scene(str(path)).coupling.step, asked, (segment,))


@pytest.fixture
def poor(tmp_path: Path) -> Plan:
    """A plan whose set is far from its budget."""
    choice = Choice("rigid", 2e-5, 1, ("tip_contact",))
    return by_hand(tmp_path / "loaded.toml", "pair_loaded", "0.15 s", choice, True, window=0.012, settle=0.005)


@pytest.fixture
def made_by_hand(tmp_path: Path) -> Plan:
    """A plan that takes the coast flank out where the clutch is dumped."""
    choice = Choice("fast", 1e-5, 1, ("coast_flank",))
    return by_hand(tmp_path / "dump.toml", "clutch_dump", "0.3 s", choice, False, window=0.01, settle=0.01)


@pytest.fixture(scope="module")
def made() -> Plan:
    scene = load_scene("pair_loaded", SCENE)
    model = stage_model(scene)
    asked = request(scene, model, ["te", "bearing.pinion.fx"], BAND, "1 dB")
    return make(Job(scene, model, asked, in_this_process, force=("coast_flank",)), "pair_loaded")


def test_a_request_is_refused_with_all_that_is_wrong() -> None:
    scene = load_scene("pair_loaded")
    with pytest.raises(SpecError) as caught:
        request(scene, stage_model(scene), ["tee"], ("200 Hz", "50 kHz"), "5 %", "1 dB")
    assert [p.field for p in caught.value.problems] == ["--output", "--band", "--budget", "--waveform"]
    assert '--step "9 us"' in str(caught.value)


def test_dissipation_and_the_static_residual_are_no_candidates() -> None:
    scene = load_scene("pair_loaded")
    names = {knob.name for knob in space(scene, stage_model(scene), least_share=-10.0).candidates}
    assert names >= {"modes", "step", "slices", "hertz", "coast_flank"}
    assert not names & {"contact_damping", "modal_damping", "residual", "roll_motion"}


def test_every_switch_of_the_table_of_effects_is_a_knob() -> None:
    scene = load_scene("pair_loaded")
    model = stage_model(scene)
    there = {variable.name for variable in model.kernel_variables()}
    switched = {e.name for e in EFFECTS if e.off_setting and set(e.off_setting) <= there}
    without = {"friction", "film"}  # this stage says nothing of them: they are off, and no choice
    assert {knob.name for knob in space(scene, model).knobs} == (switched - without) | {"step"}


def test_friction_that_the_stage_has_is_never_left_out() -> None:
    scene = load_scene("pair_loaded")
    model = stage_model(scene).with_starts({"effect.friction": 1.0})
    known = {knob.name: knob for knob in space(scene, model, least_share=-10.0).knobs}
    assert known["friction"].kept == DISSIPATION
    assert "friction" not in {knob.name for knob in space(scene, model, -10.0, force=["friction"]).candidates}


@pytest.mark.full
def test_the_chosen_set_keeps_the_budget_and_is_cheaper(made: Plan) -> None:
    (segment,) = made.segments
    assert segment.kept and segment.bound * segment.safety <= 1.0
    assert segment.price < 0.3 * segment.price_full
    assert "coast_flank" in segment.choice.off  # loaded: it does nothing, and it may go
    lines = {line.effect: line for line in segment.lines}
    assert lines["tip_contact"].verdict == "on" and lines["tip_contact"].error > 0.8
    assert "predicted" in plan_text(made)


@pytest.mark.full
def test_a_plan_survives_its_file(made: Plan, tmp_path: Path) -> None:
    assert str(Plan.load(made.save(tmp_path / "plan.toml"))) == str(made)
    (tmp_path / "other.toml").write_text("format = 7\n", encoding="utf-8")
    with pytest.raises(SpecError, match="no plan"):
        Plan.load(tmp_path / "other.toml")


@pytest.mark.full
def test_a_planned_run_is_checked_from_its_own_states(made: Plan) -> None:
    trace = run_planned(made)
    assert trace.meta["outcome"] == "ok" and not trace.meta["plan"]["trips"]
    assert all(check["kept"] for check in trace.meta["plan"]["checks"]) and trace.meta["plan"]["checks"]
    assert "spot check at" in plan_sections(trace.meta["plan"])[0]


def test_a_segment_that_loses_contact_trips_and_goes_on_with_the_coast_flank(made_by_hand: Plan) -> None:
    trace = run_planned(made_by_hand, verify=False)
    (first, *_) = trace.meta["plan"]["trips"]
    assert first["wire"] == "coast flank" and "coast_flank off" not in first["answer"]
    assert trace.meta["outcome"] == "ok" and trace["mesh.force_coast"].max() > 0
    assert trace.time.size == 1601 and trace["mesh.te"].min() > -400e-6  # teeth do not pass through each other


def test_the_fmu_runs_a_plan_as_the_kernel_does(made_by_hand: Plan, tmp_path: Path) -> None:
    """A tripwire, a change of segments and a spot check on the way: the same numbers."""
    first = replace(made_by_hand.segments[0], end=0.06)
    then = replace(first, name="then", start=0.06, end=0.08, choice=Choice("standard", 5e-6, 3), window_start=0.061)
    plan = replace(made_by_hand, segments=(first, replace(then, window=0.004, settle=0.002)))
    by_kernel, by_fmu = (run_planned(plan, tmp_path, unit=unit) for unit in ("kernel", "fmu"))
    assert by_fmu.meta["unit"] == "fmu" and by_kernel.meta["plan"]["trips"] and by_kernel.meta["plan"]["checks"]
    assert by_fmu.meta["plan"] == by_kernel.meta["plan"]
    for name in ("mesh.te", "mesh.force", "bearing.pinion.fx", "drive.vehicle.w"):
        assert np.array_equal(by_fmu[name], by_kernel[name]), name


def test_a_missed_spot_check_leads_to_a_richer_set(poor: Plan) -> None:
    """Rigid gears without tip corners for 0.2 dB, which tip corners alone miss by far."""
    trace = run_planned(poor)
    missed, *again = trace.meta["plan"]["checks"]
    assert not missed["kept"] and missed["error"] > 2.0 and "tip_contact off" not in missed["answer"]
    assert again[0]["start"] == missed["start"] and again[0]["kept"]  # the same window, with the richer set
    assert all(check["kept"] for check in again) and len(again) == 2
    assert trace.time.size == 4001 and np.all(np.diff(trace.time) > 0)
    told = run_text(trace.meta["plan"])
    assert f"MISSED: back to where it began, on with {missed['answer']}" in told


def test_what_keeps_its_budget_is_not_planned_anew(poor: Plan) -> None:
    rich = replace(poor.segments[0], choice=Choice("fast", 1e-5, 1))
    trace = run_planned(replace(poor, segments=(rich,)))
    checks = trace.meta["plan"]["checks"]
    assert len(checks) == 2 and all(check["kept"] and not check["answer"] for check in checks)


def test_a_plan_takes_the_fmu_of_its_own_model_and_no_other(poor: Plan, tmp_path: Path) -> None:
    model = stage_model(planned_scene(poor))
    own = export(model, tmp_path / "own.fmu")
    assert planned_stage(poor, own).model.hash == planned_stage(poor).model.hash == model.hash
    other = export(model.with_starts({"slices": 3.0}), tmp_path / "other.fmu")
    with pytest.raises(SpecError, match="was made for another model"):
        planned_stage(poor, other)
