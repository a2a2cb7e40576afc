"""Scene files: the shipped ones are what the field expects of them; bad ones are told everything at once."""

from __future__ import annotations

import math

import pytest

from gearfmu.errors import SpecError
from gearfmu.scenefile.scene import SHIPPED, load_scene, shipped_scenes


def test_shipped_scenes():
    pairs = [
        "clutch_closure",
        "clutch_closure_housed",
        "clutch_closure_train",
        "clutch_dump",
        "pair_light",
        "pair_loaded",
        "pair_runup",
        "train_runup",
        "train_runup_housed",
    ]
    sets = {name: "planetary54" for name in ("planetary_backfire", "planetary_paper", "planetary_closure")}
    sets |= {"planetary_runup": "planetary54/stage_pin_error", "planetary_shift": "planetary54/stage_ring_port"}
    assert shipped_scenes() == sorted([*pairs, *sets])
    for name, stage in sets.items():
        scene = load_scene(name)
        assert (scene.name, scene.stage.name, scene.stage.level) == (name, stage, "fast")
    for name in pairs:
        scene, housed = load_scene(name), "housed" in name
        train = "train" in name or housed
        assert scene.name == name
        own = "two_stage/stage_housed" if housed else "two_stage" if train else "fzg_c/stage_relief"
        assert scene.stage.name == own
        level = "fast" if "runup" in name or train else "standard"
        assert (scene.stage.level, scene.stage.slices) == (level, 7 if train else 5)


@pytest.mark.parametrize("stage", ["fzg_c", "reduced_models/planetary54", "reduced_models/fzg_c/stage_relief.toml"])
def test_a_stage_is_no_scene_and_says_so(stage):
    with pytest.raises(SpecError, match=r"this is a stage: name it in a scene under \[stage\]"):
        load_scene(stage)


def test_a_misspelt_scene_is_asked_about():
    with pytest.raises(SpecError, match='did you mean "pair_loaded"'):
        load_scene("pair_loded")


def test_clutch_closure_is_the_demo():
    scene = load_scene("clutch_closure")
    assert (scene.start.slip, scene.duration, scene.coupling.step, scene.coupling.master) == (
        52.0,
        0.4,
        1e-4,
        "gs_mean",
    )
    assert (
        scene.clutch.capacity == ((0.0, 0.0), (0.05, 250.0))
        and scene.passenger_car.chain_in_fmu
        and scene.steps == 4000
    )


@pytest.mark.parametrize(("name", "torque", "rpm"), [("pair_loaded", 302.0, 2000.0), ("pair_light", 80.0, 6000.0)])
def test_pairs_run_at_least_20_mesh_periods_after_settling(name, torque, rpm):
    scene = load_scene(name)
    assert scene.test_rig.torque == torque and scene.start.pinion_speed == pytest.approx(rpm * 2 * math.pi / 60)
    assert scene.settle == 0.05 and (scene.duration - scene.settle) * rpm / 60 * 16 >= 20


def test_hash_follows_values_not_text(tmp_path):
    text = (SHIPPED / "pair_light.toml").read_text(encoding="utf-8")
    (tmp_path / "a.toml").write_text(
        text.replace('"80 N*m"', '"0.08 kN*m"').replace("# Light", "# Very light"), encoding="utf-8"
    )
    (tmp_path / "b.toml").write_text(text.replace('"80 N*m"', '"81 N*m"'), encoding="utf-8")
    assert load_scene(tmp_path / "a.toml").hash == load_scene("pair_light").hash != load_scene(tmp_path / "b.toml").hash


BAD = """
name = "Bad Scene"
description = "everything wrong"
duration = "0.1"
[stage]
name = "fzg_c"
level = "superb"
slices = 21
[coupling]
step = "100 N"
mastr = "jacobi"
[start]
pinion_speed = 100
[clutch]
capacity = [["0 s", "-5 N*m"]]
"""


def test_every_problem_of_a_file_at_once(tmp_path):
    (tmp_path / "bad.toml").write_text(BAD, encoding="utf-8")
    with pytest.raises(SpecError) as told:
        load_scene(tmp_path / "bad.toml")
    fields = {problem.field for problem in told.value.problems}
    assert {
        "name",
        "duration",
        "stage.level",
        "stage.slices",
        "coupling.step",
        "coupling.mastr",
        "start.pinion_speed",
    } <= fields
    assert any(field.startswith("clutch.capacity") for field in fields)
    assert 'did you mean "master"?' in str(told.value) and all(
        problem.file.endswith("bad.toml") for problem in told.value.problems
    )


@pytest.mark.parametrize(
    ("old", "new", "field", "remedy"),
    [
        ('[test_rig]\ntorque = "80 N*m"', "", "", "exactly one of"),
        ('settle = "0.05 s"', 'settle = "0.2 s"', "settle", "shorter than the duration"),
        ('step = "20 us"', 'step = "30 us"', "coupling.step", "whole number of steps"),
        (
            'step = "20 us"',
            'step = "20 us"\nmicro_step = "50 us"',
            "coupling.micro_step",
            "not exceed the communication step",
        ),
        ('pinion_speed = "6000 rpm"', 'pinion_speed = "6000 rpm"\nslip = "1 rad/s"', "start.slip", "remove it"),
        (
            "[test_rig]",
            '[clutch]\ncapacity = [["1 s", "1 N*m"], ["0 s", "2 N*m"]]\n[test_rig]',
            "clutch.capacity",
            "must not decrease",
        ),
    ],
)
def test_what_no_single_field_shows(tmp_path, old, new, field, remedy):
    text = (SHIPPED / "pair_light.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "scene.toml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(SpecError) as told:
        load_scene(tmp_path / "scene.toml")
    assert any(problem.field == field and remedy in problem.remedy for problem in told.value.problems), told.value


def test_a_car_without_clutch_and_a_peak_inside_the_fmu(tmp_path):
    text = (SHIPPED / "clutch_closure.toml").read_text(encoding="utf-8")
    (tmp_path / "a.toml").write_text(
        text.replace('[clutch]\ncapacity = [["0 s", "0 N*m"], ["50 ms", "250 N*m"]]', ""), encoding="utf-8"
    )
    (tmp_path / "b.toml").write_text(text.replace("[clutch]", "[clutch]\npeak = 1.2"), encoding="utf-8")
    for name, words in (("a", "the passenger car has a clutch"), ("b", "has no peak")):
        with pytest.raises(SpecError, match=words):
            load_scene(tmp_path / f"{name}.toml")


VALUES = ["1", "-1", "0.0", "nan", "inf", "1e400", "99999999999999999999", "true", '""', '"1"', '"1 s"', '"-5 N*m"',
          '"1e9 rad/s"', '"1e-30 s"', '"nan s"', '"a\\u0000b"', "[]", "[[]]", '[["0 s", "1 N*m"]]', '[["1 s"]]',
          "{}", "{ a = 1 }", "1979-05-27"]  # fmt: skip


def test_whatever_stands_in_a_field_it_loads_or_lists_problems(tmp_path):
    """Every value of the shipped scenes, in the first that has the field, replaced by everything that does not belong
    there."""
    refused, tried, seen = 0, 0, set()
    for name in shipped_scenes():
        lines, table = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8").splitlines(), ""
        for number, line in enumerate(lines):
            key, sign, _ = line.partition(" = ")
            table = line if line.startswith("[") else table
            if not sign or key.startswith("#") or (table, key) in seen:
                continue
            seen.add((table, key))
            for value in VALUES:
                changed = [*lines[:number], f"{key} = {value}", *lines[number + 1 :]]
                (tmp_path / "scene.toml").write_text("\n".join(changed), encoding="utf-8")
                tried += 1
                try:
                    load_scene(tmp_path / "scene.toml")
                except SpecError as error:
                    refused += 1
                    assert all(problem.file and problem.remedy for problem in error.problems)
    assert tried > 1500 and 0.7 * tried < refused < tried


def test_unknown_scene_names_the_shipped_ones():
    with pytest.raises(SpecError, match="clutch_closure_housed, clutch_closure_train, clutch_dump"):
        load_scene("nothing")
