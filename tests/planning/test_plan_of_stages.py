"""Plans of a train and of a planetary set, on bodies that are made without finite elements."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from rigid_set import RigidSet
from small_stage import body

import gearfmu as gf
from gearfmu import cli
from gearfmu.planning.book import Plan
from gearfmu.planning.choice import FULL_STEP_OF_SETS, space
from gearfmu.planning.make import Job, make
from gearfmu.planning.request import request
from gearfmu.planning.table import plan_text
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.stage import load_stage
from gearfmu.sweeps.runners import in_this_process

SHORT = {"duration": "8 ms", "settle": "2 ms", "stage.level": "fast", "stage.slices": 1}
TRAIN = {"stage.name": "two_stage", "start.pinion_speed": "6000 rpm", "test_rig.torque": "100 N*m"}
SET = {"start.input_speed": "100 rad/s", "deformation": None, "stage.h": None}
SET |= {"shaft_loads.sun.proportional": {"torque": "-130 N*m", "speed": "461.54 rad/s"}}


def planned(scene: SceneSpec, model: StageModel) -> Plan:
    """A plan of the model in this scene, for 1 dB of the transmission error."""
    asked = request(scene, model, ["te"], ("2 kHz", "5 kHz"), "1 dB")
    return make(Job(scene, model, asked, in_this_process), "loaded")


def keeps_the_budget_at_a_longer_step(plan: Plan) -> bool:
    """Levels cost the same on bodies of so few modes: which one is taken is left to the measured prices."""
    (segment,) = plan.segments
    told = plan_text(plan)
    saved = [line.share for line in segment.lines if line.by == "measured" and not math.isnan(line.share)]
    assert saved and max(saved) < 1 and "of processor time" in told
    for point in segment.points:  # what a step down saves is a ratio of prices of sets that were tried on this stage
        saved = [s for s in saved if not any(abs(1 - point.price / o.price - s) < 1e-12 for o in segment.points)]
    assert not saved
    return segment.kept and segment.choice.h > FULL_STEP_OF_SETS


@pytest.mark.full  # thirteen seconds
def test_a_train_is_planned() -> None:
    """two_stage on invented bodies."""
    spec = load_stage("two_stage")
    gears = [gear.model_copy(update={"modal_damping": 0.1}) for gear in spec.gears]
    model = assemble(spec, [body(gear, gear_shape(gear)) for gear in gears])
    plan = planned(load_scene("pair_loaded", SHORT | TRAIN), model)
    assert keeps_the_budget_at_a_longer_step(plan)
    assert plan.request["outputs"] == ["stage1.te", "stage2.te"]


def test_a_planetary_set_is_planned() -> None:
    small = RigidSet(3, contact_ratio=1.4, damping_ratio=0.1, contact_damping=2e3)
    plan = planned(load_scene("planetary_paper", SHORT | SET), small.model())
    assert keeps_the_budget_at_a_longer_step(plan)
    assert {line.effect: line for line in plan.segments[0].lines}["tip_contact"].verdict == "on"


def test_a_plan_keeps_a_housing_and_says_why() -> None:
    """On a stage that has one; a train without one has no such choice."""
    scene = load_scene("clutch_closure_housed")
    housed, train = (space(scene, gf.assemble(name)).knobs for name in (scene.stage.name, "two_stage"))
    (own,) = [knob for knob in housed if knob.name == "housing"]
    assert own.kept == "without it sensors and mounts have no signal"
    assert {knob.name for knob in housed} - {knob.name for knob in train} == {"housing"}


# ---- the two questions of docs/howto-plan.md, asked on the command line ----------------------------------------------
BAND = ("--band", "500 Hz", "5 kHz")


def told(folder: Path, monkeypatch: pytest.MonkeyPatch, *words: str) -> Plan:
    monkeypatch.setenv("GEARFMU_CACHE", str(folder))
    path = folder / "plan.toml"
    with pytest.raises(SystemExit) as ended:
        cli.main(["plan", *words, *BAND, "--out", str(path)])
    assert not ended.value.code
    return Plan.load(path)


def test_may_i_leave_the_coast_flank_out_under_load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = ("--output", "te", "--output", "bearing.pinion.fx", "--budget", "1 dB", "--may-drop", "coast_flank")
    (part,) = told(tmp_path, monkeypatch, "pair_loaded", *asked).segments
    (line,) = [line for line in part.lines if line.effect == "coast_flank"]
    assert part.kept and line.verdict == "off" and line.error < 1e-6


@pytest.mark.full
def test_may_i_leave_the_coast_flank_out_where_the_clutch_is_dumped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = ("--step", "20 us", "--output", "te", "--output", "bearing.pinion.fx", "--budget", "1 dB")
    plan = told(tmp_path, monkeypatch, "clutch_dump", *asked, "--may-drop", "coast_flank")
    verdicts = [line.verdict for part in plan.segments for line in part.lines if line.effect == "coast_flank"]
    assert verdicts[0] == verdicts[-1] == "on" and "off" in verdicts


def test_which_level_for_a_fifth_of_a_decibel_at_the_bearing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (part,) = told(tmp_path, monkeypatch, "pair_loaded", "--output", "bearing.pinion.fx", "--budget", "0.2 dB").segments
    assert part.kept and part.choice.level == "fast" and part.choice.slices == 1
    assert {line.effect: line.verdict for line in part.lines}["step"] == "10 µs"
    assert part.error_default < 1.0 < part.price_default / part.price
