"""Stage files of kind general: what is right is read, what is wrong is refused with a remedy, all at once; pair files
expand into the same terms."""

from __future__ import annotations

from pathlib import Path

import pytest
from refused import refused

from gearfmu.body import reduce_body
from gearfmu.errors import MeshError
from gearfmu.stagefile.reading.base import field_path
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import expected_hash

TEXT = find_stage("two_stage").read_text(encoding="utf-8")


def problems(folder: Path, *changes: tuple[str, str]) -> dict[str, str]:
    """Field → remedy of everything that is wrong."""
    return {problem.field: problem.remedy for problem in refused(folder, TEXT, *changes)}


def test_the_two_stage_train_is_read():
    stage = load_stage("two_stage")
    assert stage.kind == "general" and not stage.planar
    assert [gear.teeth for gear in stage.gears] == [25, 61, 19, 73]
    assert stage.rotor_of("pinion2") == "intermediate" and stage.place("pinion2", None) == pytest.approx(0.09)
    assert isinstance(stage.bodies["wheel2"].tip_relief.start_roll, float)
    assert sum(support.to is None for support in stage.supports) == 6


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


@pytest.mark.parametrize(
    ("change", "field", "says"),
    [
        (
            ('gears = ["pinion1", "wheel1"]', 'gears = ["pinion1", "whel1"]'),
            "engagements.stage1.gears",
            "one of pinion1",
        ),
        (('gears = ["pinion2", "wheel2"]', 'gears = ["pinion2", "wheel1"]'), "engagements.stage2.gears", "one rotor"),
        (
            ('body = "output_shaft"\nat = "170 mm"', 'body = "output_shaft"\nat = "190 mm"'),
            "ports.output.at",
            "to 170 mm",
        ),
        (('body = "output_shaft"\nat = "170 mm"', 'body = "output_shaft"'), "ports.output.at", "say where"),
        (('torsion = "rigid"', ""), "rotors.input.bodies.input_shaft", "with torsion"),
        (('pinion2 = "90 mm", ', ""), "bodies.pinion2", "one [rotors.…]"),
        (('pinion2 = "90 mm", ', 'pinion2 = "80 mm", '), "engagements.stage2.gears", "10 mm apart"),
        (('axis = ["103 mm", "0 mm"]', 'axis = ["98 mm", "0 mm"]'), "rotors.intermediate.axis", ""),
        (('torque_max = "300 N*m"', 'torque_max = "3000 N*m"'), "bodies.pinion1.body.strip_half_width", "1.5 Hertz"),
        (('name = "input_left"', 'name = "input_right"'), "supports.input_right.name", "used twice"),
        (
            ('normal_module = "3.0 mm"', 'normal_module = "2.75 mm"'),
            "bodies.wheel2.normal_module",
            "share the basic rack",
        ),
        (('helix_angle = "-20 deg"', 'helix_angle = "20 deg"'), "bodies.wheel1.helix_angle", "opposite hands"),
        (('to = "input_shaft"', 'to = "output_shaft"'), "supports.pinion1.to", "two rotors"),
        (('kind = "gear"', 'kind = "gera"'), "bodies.pinion1", "gear"),
        (('radial = "2.5e8 N/m"', 'radial = "2.5e8 N*m"'), "supports.input_left.radial", "N/m"),
        (
            ('"30 mm", bore_diameter = "0 mm" }', '"30 mm", bore = "0 mm" }'),
            "bodies.input_shaft.sections[0].bore",
            "bore_diameter",
        ),
        (("modal_damping = 0.005", "modal_dampin = 0.005"), "bodies.input_shaft.modal_dampin", '"modal_damping"'),
        (("teeth = 25", "teeth = 4"), "bodies.pinion1.teeth", "6"),
    ],
)
def test_what_is_wrong_is_named_with_a_remedy(tmp_path, change, field, says):
    found = problems(tmp_path, change)
    near = {key: text for key, text in found.items() if key.startswith(field)}
    assert near and any(says in text for text in near.values()), found


def test_all_problems_come_at_once(tmp_path):
    found = problems(tmp_path, ('"wheel1"]', '"wheel9"]'), ('body = "output_shaft"\nat = "170 mm"', 'body = "shaft"'))
    assert {"engagements.stage1.gears", "ports.output.body"} <= set(found)


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


def test_a_gear_that_is_held_elsewhere_has_no_bearing(tmp_path):
    table = '[bodies.pinion1.bearing]\nstiffness = "1e8 N/m"\n\n[bodies.pinion1.material]'
    found = problems(tmp_path, ("[bodies.pinion1.material]", table))
    assert any("[[supports]]" in text for text in found.values())


def test_no_layer_of_problems_hides_the_next(tmp_path):
    """An engagement of a gear that there is not does not keep the other one, and what cannot be read, from being
    judged."""
    found = problems(
        tmp_path,
        ('"wheel1"]', '"wheel9"]'), ('body = "output_shaft"\nat = "170 mm"', 'body = "output_shaft"\nat = "970 mm"'),
        ("slices = ", "slicess = "),
    )  # fmt: skip
    assert {"engagements.stage1.gears", "ports.output.at"} <= set(found), found


@pytest.mark.parametrize("kind", ["gear", "ring", "shaft", "carrier", "housing"])
def test_a_problem_is_named_by_its_field_whatever_the_kind_of_body(kind):
    assert field_path({"bodies": {"part": {"kind": kind}}}, ("bodies", "part", kind, "odd")) == "bodies.part.odd"
    assert field_path({"kind": "planetary_set"}, (kind, "teeth")) == f"{kind}.teeth", "a missing table"
