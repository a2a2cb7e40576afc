"""Scene files: the shipped ones are what the field expects of them; bad ones are told everything at once."""

from __future__ import annotations

import pytest

from gearfmu.errors import SpecError
from gearfmu.scenefile.scene import SHIPPED, load_scene, shipped_scenes


@pytest.mark.parametrize("stage", ["fzg_c", "reduced_models/planetary54", "reduced_models/fzg_c/stage_relief.toml"])
def test_a_stage_is_no_scene_and_says_so(stage):
    with pytest.raises(SpecError, match=r"this is a stage: name it in a scene under \[stage\]"):
        load_scene(stage)


def test_a_misspelt_scene_is_asked_about():
    with pytest.raises(SpecError, match='did you mean "pair_loaded"'):
        load_scene("pair_loded")


def test_hash_follows_values_not_text(tmp_path):
    text = (SHIPPED / "pair_light.toml").read_text(encoding="utf-8")
    (tmp_path / "a.toml").write_text(
        text.replace('"80 N*m"', '"0.08 kN*m"').replace("# Light", "# Very light"), encoding="utf-8"
    )
    (tmp_path / "b.toml").write_text(text.replace('"80 N*m"', '"81 N*m"'), encoding="utf-8")
    assert load_scene(tmp_path / "a.toml").hash == load_scene("pair_light").hash != load_scene(tmp_path / "b.toml").hash


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
