"""stage.toml of a planetary set: what is right is read, what is wrong is refused with a remedy, all at once."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gearfmu.errors import SpecError
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


def test_schema_knows_the_tables_of_a_set():
    schema = json.loads(json.dumps(set_schema()))
    assert set(read_toml(find_stage("planetary54"))) <= set(schema["properties"])
    assert "name" not in schema["$defs"]["RingSpec"]["required"] + schema["$defs"]["SetGearSpec"]["required"]
    assert schema["$defs"]["RingSpec"]["properties"]["rim_diameter"]["unit"] == "m"
