"""Whatever is wrong with a stage, scene or body file is said in the words that users know (broken.json); whatever
number a stage file has in place of another one, it is loaded, or each problem is told."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
from broken import message, stored

from gearfmu.errors import SpecError
from gearfmu.stagefile.reading.files import find_stage, read_layers
from gearfmu.stagefile.stage import load_stage

KNOWN = stored()


@pytest.mark.parametrize("name", list(KNOWN))
def test_a_fault_is_told_in_the_same_words(tmp_path, name):
    said = message(name, tmp_path)
    assert said, "not refused"
    assert said == KNOWN[name]


def test_there_are_cases():
    assert len(KNOWN) > 200


# ---- any number ------------------------------------------------------------------------------------------------------
STAGES = ("fzg_c/stage_relief", "helical_demo/stage_bearings", "planetary54", "helical_set")
TRAINS = ("two_stage/stage_housed", "two_stage/stage_bearings")
NUMBER = re.compile(r"[-+]?[\d.]+(?:e[-+]?\d+)?")


def numbers(tables: dict[str, Any], place: str = "") -> Iterator[tuple[str, str]]:
    """Place and text of every number with a unit."""
    for key, value in tables.items():
        if isinstance(value, dict):
            yield from numbers(value, f"{place}{key}.")
        elif isinstance(value, str) and NUMBER.match(value):
            yield f"{place}{key}", value


@pytest.mark.parametrize("name", STAGES + TRAINS)
def test_every_number_may_be_negative_zero_or_far_away(name: str) -> None:
    found = list(numbers(read_layers(find_stage(name)).tables))
    for place, text in found:
        for other in (f"-{text}", *(NUMBER.sub(value, text, count=1) for value in ("0", "1e12", "1e-12"))):
            with suppress(SpecError):
                load_stage(name, {place: other})
    assert len(found) > 30
