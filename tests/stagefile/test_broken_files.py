"""Whatever is wrong with a stage, scene or body file is said in the words that users know (broken.json)."""

from __future__ import annotations

import pytest
from broken import message, stored

KNOWN = stored()


@pytest.mark.parametrize("name", list(KNOWN))
def test_a_fault_is_told_in_the_same_words(tmp_path, name):
    said = message(name, tmp_path)
    assert said, "not refused"
    assert said == KNOWN[name]


def test_there_are_cases():
    assert len(KNOWN) > 200
