"""Pages of docs/ that evidence/pages makes from the tables in the code."""

from __future__ import annotations

import re
from pathlib import Path

from evidence.pages import variables
from evidence.pages.effects import effects_page

ROOT = Path(__file__).resolve().parents[1]


def test_pages_are_those_of_the_tables() -> None:
    for name, text in (("variables", variables.variables_page()), ("effects", effects_page())):
        assert (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") == text, "run: make docs"


def test_every_row_of_the_kernels_table_is_read() -> None:
    source = (ROOT / "gearfmu" / "kernel" / "src" / "model" / "gk_variables.inc").read_text(encoding="utf-8")
    found = variables.rows()
    assert len(found) == len(re.findall(r"GK_(?:REAL|INTEGER|BOOLEAN|ENUM), GK_", source))
    assert all(row.description and row.exists in variables.WHEN for row in found)
