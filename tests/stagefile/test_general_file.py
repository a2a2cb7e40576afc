"""Stage files of kind general: what is right is read, what is wrong is refused with a remedy, all at once; pair files
expand into the same terms."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from broken import problems

from gearfmu.body import reduce_body
from gearfmu.errors import MeshError, SpecError
from gearfmu.stagefile.proposals.new import new_stage
from gearfmu.stagefile.reading.base import field_path
from gearfmu.stagefile.reading.files import find_stage, read_layers
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import differences, expected_hash, restored, stored

HOUSED = "two_stage/stage_housed"


def test_a_body_that_another_carries_is_not_planar():
    """Held in the plane alone a spur set still turns with its carrier."""
    stage = load_stage("planetary54")
    flat = tuple(s.model_copy(update={"axial": None, "tilt": None, "at": None}) for s in stage.supports)
    gears = {gear.name: gear for gear in stage.gears}
    rotors = {name: rotor for name, rotor in stage.rotors.items() if set(rotor.bodies) <= set(gears)}
    alone = {"supports": tuple(s for s in flat if s.body in gears), "bodies": gears, "rotors": rotors}
    assert any(s.to for s in alone["supports"])
    held = tuple(s.model_copy(update={"to": None}) for s in alone["supports"])
    assert stage.model_copy(update=alone | {"supports": held}).planar and not stage.model_copy(update=alone).planar


@pytest.mark.parametrize("field", [pytest.param("rotors.intermediate.axis", id="change7-rotors.intermediate.axis-")])
def test_what_is_wrong_is_named_with_a_remedy(field):
    """Of axes too near for the teeth; all other messages: broken.json."""
    assert field in problems({field: ["98 mm", "0 mm"]}, "two_stage")


@pytest.mark.parametrize("name", ["fzg_c", "fzg_c/stage_relief"])
def test_a_pair_expands_into_two_rotors_and_keeps_its_bodies(name):
    stage = load_stage(name)
    pair = stage.written
    assert stage.planar and list(stage.rotors) == list(stage.ports) == ["pinion", "wheel"]
    assert stage.rotors["wheel"].axis == (pair.pair.center_distance, 0.0)
    for gear in pair.gears:
        alone = stage.model_copy(update={"engagements": stage.engagements})  # a general stage, with no file of a pair
        assert alone.written is alone and stage.written is not stage
        assert expected_hash(stage, gear.name) == expected_hash(alone, gear.name)
        assert stage.bodies[gear.name].tip_relief == gear.tip_relief
        assert stage.ports[gear.name].k == pair.ports[gear.name].k


def test_a_gear_that_cannot_be_meshed_is_named_by_its_table(monkeypatch):
    def fail(*_):
        raise MeshError("the rim is too thin")

    monkeypatch.setattr("gearfmu.body.bodies.reduced_gear", fail)
    train = load_stage("two_stage")
    for stage, gear, table in ((train, "wheel1", "bodies.wheel1"), (load_stage("fzg_c"), "pinion", "gears.pinion")):
        with pytest.raises(MeshError, match=f": {table}: the rim"):
            reduce_body(stage, gear)


@pytest.mark.parametrize("kind", ["gear", "ring", "shaft", "carrier", "housing"])
def test_a_problem_is_named_by_its_field_whatever_the_kind_of_body(kind):
    assert field_path({"bodies": {"part": {"kind": kind}}}, ("bodies", "part", kind, "odd")) == "bodies.part.odd"
    assert field_path({"kind": "planetary_set"}, (kind, "teeth")) == f"{kind}.teeth", "a missing table"


# ---- sets ------------------------------------------------------------------------------------------------------------
def test_pin_errors_move_the_axes_of_planets():
    spec = load_stage("planetary54", {"set.pin_errors.1": ["0 mm", "12 um"]})
    assert spec.written.set.pin_errors == {1: (0.0, pytest.approx(12e-6))}
    rotors = spec.rotors
    assert rotors["planet2"].offset == pytest.approx((-12e-6, 0.0)) and rotors["planet1"].offset == (0.0, 0.0)


def test_a_body_of_a_set_depends_on_its_own_numbers_only():
    before = load_stage("planetary54")
    changed = load_stage("planetary54", {"ring.mounts.stiffness": "2e8 N/m", "set.backlash": "0.05 mm"})
    assert all(expected_hash(before, name) == expected_hash(changed, name) for name in before.files)


# ---- housings --------------------------------------------------------------------------------------------------------
def test_a_housing_stands_beside_the_rotors() -> None:
    stage = load_stage(HOUSED)
    assert [h.name for h in stage.housings] == ["housing"] and stage.files[-1] == "housing"
    assert not any("housing" in rotor.bodies for rotor in stage.rotors.values())
    plain = stage.on_rigid_ground()
    assert plain.housings == () and {s.to for s in plain.supports} == {s.to for s in load_stage("two_stage").supports}
    assert plain.supports == load_stage("two_stage").supports


def test_a_free_housing_is_read_but_cannot_carry_a_load(tmp_path: Path) -> None:
    """It can be reduced and put under a finished run; a run of its own has no equilibrium."""
    text = find_stage(HOUSED).read_text(encoding="utf-8")
    feet = text[text.index("\n[[supports]]                # assumed: bolted to a stiff frame") :]
    for name in ("stage.toml", "housing.inp"):
        shutil.copy(find_stage(HOUSED).parent / name, tmp_path / ("base.toml" if name == "stage.toml" else name))
    path = tmp_path / "free.toml"
    path.write_text(text.replace(feet, "\n").replace('base = "stage.toml"', 'base = "base.toml"'), encoding="utf-8")
    stage = load_stage(path)
    assert expected_hash(stage, "housing") == expected_hash(load_stage(HOUSED), "housing")
    with pytest.raises(SpecError, match=r"bodies\.housing.*reaction torque.*\(foot0, foot1, foot2, foot3\), soft ones"):
        stage.require_motion()


def test_what_is_dynamic_does_not_make_a_body_stale() -> None:
    """Nor the name of its springs; modes and node sets do."""
    wanted = expected_hash(load_stage(HOUSED), "housing")
    same = {"bodies.housing.dynamic_to": "3 kHz"}
    assert expected_hash(load_stage(HOUSED, same), "housing") == wanted
    for other in ({"bodies.housing.modes": 150}, {"bodies.housing.import.skin": "FOOT0"}):
        assert expected_hash(load_stage(HOUSED, other), "housing") != wanted


# ---- rolling bearings ------------------------------------------------------------------------------------------------
TRAIN, PAIR = "two_stage/stage_bearings", "helical_demo/stage_bearings"
SUPPORTS = read_layers(find_stage(TRAIN)).tables["supports"]


def test_all_is_said_at_once() -> None:
    wrong = {"input_left": {"bearing": "63O6"}, "output_right": {"tilt": "1e4 N*m/rad"}}
    supports = [support | wrong.get(support["name"], {}) for support in SUPPORTS]
    found = problems({"operating": None, "bearings.6210.clearance": "12", "supports": supports}, TRAIN)
    assert set(found) == {
        "operating.torque", "supports.input_left.bearing", "supports.output_right.tilt", "bearings.6210.clearance",
    }  # fmt: skip


def test_directions_of_rolling_bearings_count() -> None:
    """Balls hold five directions and rollers four; the kernel has room for 256."""
    more = [{"name": f"more{k}", "body": "input_shaft", "at": f"{10 + k} mm", "bearing": "NU206"} for k in range(52)]
    assert "256 directions" in problems({"supports": more + SUPPORTS}, TRAIN)["supports"].remedy


def test_springs_of_a_base_are_left_aside() -> None:
    pinion = load_stage(PAIR).written.gears[0].bearing
    assert (pinion.rolling, pinion.span, pinion.damping_ratio) == ("7305", pytest.approx(0.07), 0.03)


@pytest.mark.parametrize("like", [TRAIN, PAIR])
def test_a_copy_and_a_stored_stage_say_the_same(tmp_path: Path, like: str) -> None:
    """`gearfmu new --like`, and what an FMU holds of its stage."""
    own = load_stage(like)
    assert {field for field, *_ in differences(own, load_stage(new_stage("mine", like, tmp_path)))} == {"name"}
    assert not differences(own, restored(stored(own.written), own.source))
