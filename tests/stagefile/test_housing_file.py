"""What a stage file says of its housing, and how one that cannot be is refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from gearfmu.errors import SpecError
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import expected_hash

HOUSED = "two_stage/stage_housed"


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
