"""Scene files, and what their drives ask of a stage. Messages: tests/stagefile/broken.json."""

from __future__ import annotations

import pytest

from gearfmu.cosim.scene_run import drive_of, in_drivetrain
from gearfmu.errors import SpecError
from gearfmu.scenefile.scene import SHIPPED, load_scene, shipped_scenes
from gearfmu.stagefile.stage import load_stage


@pytest.mark.parametrize("stage", ["fzg_c", "reduced_models/planetary54", "reduced_models/fzg_c/stage_relief.toml"])
def test_a_stage_is_no_scene_and_says_so(stage):
    with pytest.raises(SpecError, match=r"this is a stage: name it in a scene under \[stage\]"):
        load_scene(stage)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("pair_loded", 'did you mean "pair_loaded"'),
        ("nothing", "clutch_closure_housed, clutch_closure_train, clutch_dump"),
    ],
)
def test_an_unknown_scene_is_asked_about(name, words):
    with pytest.raises(SpecError, match=words):
        load_scene(name)


def test_hash_follows_values_not_text():
    one, other = (load_scene("pair_light", {"test_rig.torque": torque}).hash for torque in ("0.08 kN*m", "81 N*m"))
    assert one == load_scene("pair_light").hash != other


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


@pytest.mark.parametrize("name", shipped_scenes())
def test_a_stage_with_the_ports_that_a_drive_needs_has_the_same_drive(name):
    """Scenes are run on the stage that has their ports already, an FMU brings its own."""
    scene = load_scene(name)
    bare = load_stage(scene.stage.name)
    ready = in_drivetrain(scene, load_stage(scene.stage.name))
    first, second = drive_of(scene, bare), drive_of(scene, ready)
    assert first.ports == second.ports and first.ports
    assert first.start() == second.start() and first.silent == second.silent
    for port, wanted in first.ports.items():
        assert (ready.ports[port].kind, ready.ports[port].chain) == (wanted.kind, wanted.chain)
    if second.with_shafts is not None:
        own = {name: port.model_copy(update={"k": 2 * port.k}) for name, port in ready.ports.items() if port.k}
        other = drive_of(second.with_shafts({**ready.ports, **own}), ready)
        assert {name: port.k for name, port in other.ports.items()} == {name: own[name].k for name in other.ports}


def test_alternating_torques_and_clutches_of_a_drive_are_known():
    known = {name: load_scene(name) for name in ("planetary_backfire", "clutch_closure", "planetary_shift")}
    drives = {name: drive_of(s, load_stage(s.stage.name)) for name, s in known.items()}
    assert drives["planetary_backfire"].frequencies == (300.0,) and not drives["planetary_backfire"].watched
    assert drives["clutch_closure"].watched == () and drives["clutch_closure"].signals  # its clutch is in the stage
    assert set(drives["planetary_shift"].watched) == set(known["planetary_shift"].drivetrain.clutches)
