"""Whatever is wrong with a stage, scene or body file is said in the words that users know (broken.json)."""

from __future__ import annotations

import json

import pytest
from broken import STORED, cases, message

CASES, KNOWN = cases(), json.loads(STORED.read_text(encoding="utf-8"))


def test_every_case_has_its_message():
    assert list(CASES) == list(KNOWN) and len(CASES) >= 100


@pytest.mark.parametrize("name", list(CASES))
def test_a_fault_is_told_in_the_same_words(tmp_path, name):
    said = message(CASES[name], tmp_path)
    assert said, "not refused"
    assert said == KNOWN[name]
