"""New stage files and the JSON schema."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from gearfmu.errors import SpecError
from gearfmu.stagefile.proposals.new import new_stage
from gearfmu.stagefile.reading.base import read_toml
from gearfmu.stagefile.reading.files import find_stage, shipped_stages
from gearfmu.stagefile.schema import general_schema, set_schema, stage_schema
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import differences


@pytest.mark.parametrize("like", shipped_stages())
def test_a_new_stage_is_the_old_one_under_its_name(tmp_path: Path, like: str) -> None:
    """Its bodies' files too, which it finds from its own folder."""
    path = new_stage("mine", like, tmp_path)
    assert path == tmp_path / "mine" / "stage.toml"
    made, old = load_stage(path), load_stage(like)
    assert made.name == "mine"
    assert made.description != old.description, "that of the other stage would be wrong"
    assert {field for field, *_ in differences(old, made)} == {"name"} and made.ports == old.ports
    assert [entry.name for entry in path.parent.iterdir()] == ["stage.toml"]


def test_every_field_has_a_comment_and_every_default_is_shown(tmp_path: Path) -> None:
    text = new_stage("mine", "fzg_c", tmp_path).read_text(encoding="utf-8")
    fields = [line for line in text.splitlines() if " = " in line and not line.startswith("# A line")]
    assert all(re.search(r"= .*  # \S", line) for line in fields)
    assert any(line.startswith("backlash = ") and line.endswith("[m]") for line in fields)
    assert any(line.startswith('# law = "line"') for line in fields)
    assert any(line.startswith("# helix_angle = ") for line in fields)


def test_shown_defaults_are_the_defaults(tmp_path: Path) -> None:
    path = new_stage("mine", "fzg_c/stage_relief", tmp_path)
    before = load_stage(path)
    text = re.sub(r"^# (\w+ = [^…]*?)$", r"\1", path.read_text(encoding="utf-8"), flags=re.M)
    assert "\nhelix_angle = " in text and "\nlaw = " in text
    path.write_text(text, encoding="utf-8")
    assert load_stage(path) == before


@pytest.mark.parametrize(("like", "gear"), [("fzg_c", "gears.pinion"), ("planetary54", "ring")])
def test_an_optional_table_within_another_has_its_heading(tmp_path: Path, like: str, gear: str) -> None:
    """What a reader takes the comment signs from is the stage with that table."""
    path = new_stage("mine", like, tmp_path)
    text = path.read_text(encoding="utf-8")
    for comment, table in (("# ", "lead"), ("# # ", "lead.end_relief")):
        start = text.index(f"\n{comment}[{gear}.{table}]")
        end = text.index("\n\n", start)
        part = re.sub(f"^{comment}", "", text[start:end], flags=re.M).replace("# crowning", "crowning")
        part = part.replace('# amount = "… m"', 'amount = "9 um"').replace('# length = "… m"', 'length = "1 mm"')
        text = text[:start] + part + text[end:]
    path.write_text(text, encoding="utf-8")
    found = load_stage(path)
    lead = found.written.ring.lead if like == "planetary54" else found.gears[0].lead
    assert lead.end_relief.amount == pytest.approx(9e-6) and lead.end_relief.length == 1e-3


def test_an_existing_file_is_never_touched(tmp_path: Path) -> None:
    path = new_stage("mine", "fzg_c", tmp_path)
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(SpecError, match="exists already"):
        new_stage("mine", "fzg_c", tmp_path)
    assert path.read_text(encoding="utf-8") == "mine"
    assert os.listdir(path.parent) == ["stage.toml"]


@pytest.mark.parametrize("name", ["", "A", "../x", "a/b", "1a", "a" * 41])
def test_a_bad_name_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(SpecError, match="small letters"):
        new_stage(name, "fzg_c", tmp_path)
    assert not list(tmp_path.iterdir())


RAW = {name: read_toml(find_stage(name)) for name in ("fzg_c", "two_stage", "planetary54")}
BODIES, SUPPORT = RAW["two_stage"]["bodies"], RAW["two_stage"]["supports"][0]
SLIPS: dict[str, list[dict[str, Any]]] = {  # of `supports` are the stiffnesses: they are no fields of a body
    "fzg_c": [{"torque_max": 600}, {"torque_max": "600"}, {"torqe": "1 N*m"}, {"levels": {"fast_cut": 5}}],
    "two_stage": [
        {"bodies": BODIES | {"pinion1": BODIES["pinion1"] | slip}}
        for slip in (
            {"kind": "shaft"}, {"helix_angle": 20}, {"bearing": {"stiffness": "3e8 N/m"}}, {"name": "pinion1"},
            {"lenght": "1 m"},
        )
    ] + [
        {"bodies": BODIES | {"Pinion": BODIES["pinion1"]}}, {"engagements": []}, {"slices": 21},
        {"supports": [SUPPORT | {"radial": "stiff"}]}, {"rotors": {"input": {"axis": ["0 mm"]}}},
    ],
    "planetary54": [{"ring": RAW["planetary54"]["ring"] | {"name": "ring"}}],
}  # fmt: skip


@pytest.mark.parametrize(("name", "schema"), [*zip(RAW, (stage_schema, general_schema, set_schema), strict=True)])
def test_a_schema_accepts_the_shipped_file_and_refuses_slips(name: str, schema: Callable[[], dict[str, Any]]) -> None:
    Draft202012Validator.check_schema(schema())
    judge, raw = Draft202012Validator(json.loads(json.dumps(schema()))), RAW[name]
    assert judge.is_valid(raw) and "source" not in schema()["properties"]
    assert not [slip for slip in SLIPS[name] if judge.is_valid(raw | slip)]
    assert not judge.is_valid({key: value for key, value in raw.items() if key not in ("pair", "bodies", "ring")})


def test_schema_shows_units_meanings_and_defaults_as_in_a_file() -> None:
    schema = stage_schema()
    assert set_schema()["$defs"]["RingSpec"]["properties"]["rim_diameter"]["unit"] == "m"
    gear = schema["$defs"]["GearSpec"]
    assert gear["properties"]["tip_edge_radius"]["default"] == "0.0002 m"
    assert gear["properties"]["face_width"]["unit"] == "m"
    assert "name" not in gear["properties"]
    assert '"null"' not in json.dumps(schema)
    missing = [
        f"{kind}.{name}"
        for kind, part in schema["$defs"].items()
        for name, field in part["properties"].items()
        if not field.get("description")
    ]
    assert not missing
