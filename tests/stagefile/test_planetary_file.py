"""stage.toml of a planetary set: what is right is read, what is wrong is refused with a remedy, all at once."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gearfmu.errors import SpecError
from gearfmu.stagefile.forms.expand import motion_problems, rewritten
from gearfmu.stagefile.proposals.new import new_stage
from gearfmu.stagefile.reading.base import read_toml
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.schema import set_schema
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import expected_hash

TEXT = find_stage("planetary54").read_text(encoding="utf-8")


def written(folder: Path, *changes: tuple[str, str]) -> Path:
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "stage.toml"
    path.write_text(text, encoding="utf-8")
    return path


def problems(folder: Path, *changes: tuple[str, str]) -> dict[str, str]:
    """Field → remedy of everything that is wrong."""
    with pytest.raises(SpecError) as error:
        load_stage(written(folder, *changes))
    return {problem.field: problem.remedy for problem in error.value.problems}


def test_the_shipped_set_is_read():
    spec = load_stage("planetary54")
    assert spec.written.kind == "planetary_set" and [gear.name for gear in spec.written.gears] == [
        "sun",
        "planet",
        "ring",
    ]
    assert [gear.teeth for gear in spec.written.gears] == [18, 18, 54] and spec.written.set.planets == 4
    assert spec.written.ring.mounts.points == 6 and spec.written.carrier.coupling_of("bolt3") == "rigid"


@pytest.mark.parametrize(
    ("change", "field", "says"),
    [
        (('"131 mm"', '"130 mm"'), "ring.tip_diameter", "at least 130.73 mm (tip radius 65.365 mm)"),
        (('"131 mm"', '"124 mm"'), "ring.tip_diameter", "inside the base circle"),
        (('"131 mm"', '"138 mm"'), "ring.tip_diameter", "contact ratio"),
        (('"160 mm"', '"143 mm"'), "ring.rim_diameter", "at least 146.4 mm"),
        (("fillet_radius = 0.3 ", "fillet_radius = 0.5 "), "ring.fillet_radius", "overlap"),
        (("dedendum = 1.25               #", "dedendum = 1.02              #"), "planet.tip_diameter", "root fillet"),
        (("planets = 4", "planets = 5"), "set.planets", "= 72/5 is no integer; possible are 2, 3, 4"),
        (("planets = 4", "planets = 5"), "set.planets", "write positions = [0, 14, 29, 43, 58]"),
        (("planets = 4", "planets = 4\npositions = [0, 18, 36]"), "set.positions", "one for each of the 4 planets"),
        (("planets = 4", "planets = 4\npositions = [0, 18, 54, 36]"), "set.positions", "ascending from 0 and below"),
        (("planets = 4", "planets = 4\npositions = [0, 18, 36, 72]"), "set.positions", "z_sun + z_ring = 72"),
        (("planets = 4", "planets = 4\npositions = [0, 10, 36, 54]"), "set.planets", "neighbouring planets touch"),
        (("planets = 4", 'planets = 4\nhelix_angle = "36 deg"'), "set.helix_angle", "from -35 deg to 35 deg"),
        (("planets = 4", "planets = 6"), "set.planets", "fewer or smaller planets"),
        (('center_distance = "45 mm"', 'center_distance = "42 mm"'), "set.center_distance", "base radii"),
        (('center_distance = "45 mm"', 'center_distance = "44.6 mm"'), "ring.profile_shift", "j_wt"),
        (("points = 6 ", "points = 55 "), "ring.mounts.points", "at most one a tooth space: up to 54"),
        (('bolt_diameter = "16 mm"', 'bolt_diameter = "22 mm"'), "carrier.bolt_diameter", "less than 22 mm"),
        (('bore_diameter = "40 mm"', 'bore_diameter = "80 mm"'), "carrier.bore_diameter", "less than 74 mm"),
        (('outer_diameter = "120 mm"', 'outer_diameter = "100 mm"'), "carrier.outer_diameter", "more than 106 mm"),
        (('bolt3 = "rigid"', 'bolt4 = "rigid"'), "carrier.coupling.bolt4", "bolt0, bolt1, bolt2, bolt3"),
        (('bolt3 = "rigid"', ""), "carrier.coupling", "bolt3 would be rigid unsaid"),
        (('bolt3 = "rigid"', 'bolt3 = "stiff"'), "carrier.coupling.bolt3", "'rigid' or 'averaging'"),
        (('strip_half_width = "0.45 mm"', 'strip_half_width = "0.2 mm"'), "ring.body.strip_half_width", "0.273 mm"),
        (('kind = "planetary_set"', 'kind = "epicyclic"'), "kind", "external_pair"),
        (('torque_max = "600 N*m"', 'torque_max = "60000 N*m"'), "sun.body.strip_half_width", "1.5 Hertz"),
        (('bore_diameter = "18 mm"', 'bore_diameter = "38 mm"'), "sun.bore_diameter", "rim thinner"),
        (("planets = 4", "planet = 4"), "set.planet", 'did you mean "planets"?'),
    ],
)
def test_each_fault_is_named_with_its_remedy(tmp_path, change, field, says):
    found = problems(tmp_path, change)
    assert field in found, found
    assert says in found[field]


def test_all_problems_come_at_once(tmp_path):
    found = problems(
        tmp_path,
        ('"131 mm"', '"130 mm"'), ("planets = 4", "planets = 5"), ("points = 6 ", "points = 60 "),
        ('bolt_diameter = "16 mm"', 'bolt_diameter = "24 mm"'), ('tip_diameter = "50 mm"', 'tip_diameter = "60 mm"'),
    )  # fmt: skip
    wanted = {"ring.tip_diameter", "set.planets", "ring.mounts.points", "carrier.bolt_diameter", "sun.tip_diameter"}
    assert wanted <= set(found)


def test_what_a_set_needs_to_move_is_told_all_at_once(tmp_path):
    spec = load_stage("planetary54")
    bare = rewritten(
        spec,
        speed_max=None,
        contact=None,
        ports={"carrier": spec.ports["carrier"]},
        sun=spec.written.sun.model_copy(update={"bearing": None}),
        planet=spec.written.planet.model_copy(
            update={"bearing": spec.written.planet.bearing.model_copy(update={"tilt": None})}
        ),
        ring=spec.written.ring.model_copy(update={"mounts": None}),
    )
    with pytest.raises(SpecError) as error:
        bare.require_motion()
    found = {problem.field: problem.remedy for problem in error.value.problems}
    assert set(found) == {"speed_max", "contact", "ports", "sun.bearing", "planet.bearing.tilt", "ring.mounts"}
    assert 'write speed_max = "300 rad/s"' in found["speed_max"] and "[ports.sun]" in found["ports"]
    assert motion_problems(spec.written) == []


def test_pin_errors_move_the_axes_of_planets(tmp_path):
    old = "# pin_errors = { 0 ="
    spec = load_stage(written(tmp_path, (old, "pin_errors = { 1 =")))
    assert spec.written.set.pin_errors == {1: (0.0, pytest.approx(12e-6))}
    rotors = spec.rotors
    assert rotors["planet2"].offset == pytest.approx((-12e-6, 0.0)) and rotors["planet1"].offset == (0.0, 0.0)
    assert "the 4 are 0 to 3" in problems(tmp_path, (old, "pin_errors = { 4 ="))["set.pin_errors.4"]


def test_a_body_depends_on_its_own_numbers_only(tmp_path):
    before = load_stage("planetary54")
    changed = load_stage(written(tmp_path, ('stiffness = "1e8 N/m"', 'stiffness = "2e8 N/m"'), ("0.06 mm", "0.05 mm")))
    same = {name: expected_hash(before, name) == expected_hash(changed, name) for name in before.files}
    assert same == {"sun": True, "planet": True, "ring": True, "carrier": True}


def test_a_new_set_is_the_old_one_under_its_name(tmp_path):
    path = new_stage("mine", "planetary54", tmp_path)
    made, old = load_stage(path), load_stage("planetary54")
    same = ("name", "source", "description")
    assert made.model_copy(update={field: getattr(old, field) for field in same}) == old


def test_schema_knows_the_tables_of_a_set():
    schema = json.loads(json.dumps(set_schema()))
    assert set(read_toml(find_stage("planetary54"))) <= set(schema["properties"])
    assert "name" not in schema["$defs"]["RingSpec"]["required"] + schema["$defs"]["SetGearSpec"]["required"]
    assert schema["$defs"]["RingSpec"]["properties"]["rim_diameter"]["unit"] == "m"


def test_no_layer_of_problems_hides_the_next(tmp_path):
    found = problems(
        tmp_path,
        ("planets = 4", "planets = 5"), ('bolt_diameter = "16 mm"', 'bolt_diameter = "24 mm"'),
        ('"131 mm"', '"130 mm"'), ("torque_max", "torque_maximum"), ('tip_diameter = "50 mm"', "tip_diameter = 0.06"),
    )  # fmt: skip
    assert {"torque_maximum", "torque_max", "set.planets", "carrier.bolt_diameter", "sun.tip_diameter"} <= set(found)
    assert {"ring.tip_diameter"} <= set(found)
