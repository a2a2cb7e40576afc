"""A Stage and the file that it was expanded from: whatever changes one changes the other, or parts them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu.errors import SpecError
from gearfmu.scenefile.scene import load_scene
from gearfmu.stagefile.forms.expand import expand, rewritten, with_ports
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import PortSpec

FILES = ["fzg_c", "helical_demo", "planetary54", "two_stage"]


@pytest.mark.parametrize("name", FILES)
def test_what_is_written_expands_to_the_stage(name: str) -> None:
    stage = load_stage(name)
    assert expand(stage.written) == stage == rewritten(stage)
    assert set(stage.model_dump()) == set(type(stage).model_fields) - {"bearings", "operating"}, "the file is no field"


@pytest.mark.parametrize("name", FILES)
def test_a_copy_says_what_its_file_says_or_has_none(name: str) -> None:
    stage = load_stage(name)
    moved = stage.model_copy(update={"source": Path("elsewhere.toml")})
    assert moved.written.source == moved.source != stage.source and moved.limits == stage.limits
    parted = stage.model_copy(update={"slices": stage.slices + 1})
    assert parted.written is parted and parted.bodies == stage.bodies and stage.written.kind != parted.name
    with pytest.raises(AttributeError, match="no misspelt"):
        stage.model_copy(update={"misspelt": 1})


@pytest.mark.parametrize("name", FILES)
def test_ports_change_in_both(name: str) -> None:
    stage = load_stage(name)
    first = next(iter(stage.ports))
    changed = with_ports(stage, {first: PortSpec(kind="torque")})
    assert changed.ports[first].kind == changed.written.ports[first].kind == "torque"
    assert changed.ports[first].body == stage.ports[first].body and changed.ports[first].k is None


def test_planets_share_a_file_and_a_table() -> None:
    stage = load_stage("planetary54")
    assert stage.files == ("sun", "planet", "ring", "carrier")
    bodies = stage.by_name([object() for _ in stage.files])
    assert list(bodies) == list(stage.bodies) and len(set(bodies.values())) == 4
    assert bodies["planet1"] is bodies["planet4"] and stage.table_of("planet3") == "planet"
    assert load_stage("two_stage").table_of("wheel1") == "bodies.wheel1"


def test_fields_of_the_file_are_told_where_they_are() -> None:
    with pytest.raises(AttributeError, match="stage.written"):
        _ = load_stage("fzg_c").pair


# ---- fields changed in Python are read, checked and refused as if the file said so -----------------------------------
def test_a_changed_stage_is_the_one_of_a_changed_file(tmp_path: Path) -> None:
    """By text and by SI number; a pair's gears by name, a train's bodies, a set's list."""
    base = find_stage("fzg_c/stage_relief").as_posix()
    path = tmp_path / "stage.toml"
    path.write_text(f'base = "{base}"\n[gears.pinion.tip_relief]\namount = "20 um"\n', encoding="utf-8")
    key = "gears.pinion.tip_relief.amount"
    written = load_stage(path)
    for value in ("20 um", 2e-5, np.float64(2e-5)):
        assert load_stage("fzg_c/stage_relief", {key: value}).gears == written.gears
    train = load_stage("two_stage", {"bodies.pinion1.face_width": 0.021, "slices": 4.0})  # a count of a range
    assert train.bodies["pinion1"].face_width == 0.021 and train.slices == 4
    moved = load_stage("planetary54", {"set.pin_errors.0": ["0 um", 12e-6]})
    assert moved.written.set.pin_errors == {0: (0.0, 12e-6)}
    assert load_stage("fzg_c").gears != written.gears  # the file stays
    assert load_stage("fzg_c/stage_relief", {"gears.pinion.tip_relief": None}).gears[0].tip_relief is None


def test_torque_and_speed_of_a_scene() -> None:
    rig = load_scene("pair_loaded", {"torque": 200.0, "speed": "1000 rpm"})
    assert rig.test_rig is not None and rig.test_rig.torque == 200.0
    assert rig.start.pinion_speed == pytest.approx(1000 * np.pi / 30)
    car = load_scene("clutch_closure", {"torque": "80 N*m"}).passenger_car
    assert car is not None and car.engine_torque == 80.0
    assert load_scene("planetary_backfire", {"speed": 20.0}).start.pinion_speed == 20.0  # the file says input_speed
    with pytest.raises(SpecError, match="no single torque: name the field"):
        load_scene("planetary_backfire", {"torque": 1.0})


def test_all_that_is_wrong_is_told() -> None:
    with pytest.raises(SpecError) as caught:
        load_stage("fzg_c", {"gears.pinion.teth": 17, "torque_max": -1.0, "contact.slices": "5 mm"})
    assert {problem.field for problem in caught.value.problems} == {"gears.pinion.teth", "torque_max", "contact.slices"}
    with pytest.raises(SpecError, match="settle.*shorter than the duration"):
        load_scene("pair_loaded", {"duration": "10 ms"})
