"""A Stage and the file that it was expanded from: whatever changes one changes the other, or parts them."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearfmu.stagefile.forms.expand import expand, rewritten, with_ports
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
