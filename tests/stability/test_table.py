"""The committed table: whole, without failures, and what docs/stability.md shows."""

from __future__ import annotations

from pathlib import Path

from evidence.pages_made import MARK
from evidence.stability.page import page
from evidence.stability.scenes import SCENES
from evidence.stability.suite import Task, read, table, tasks

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "evidence" / "stability" / "stability.csv"
REMEDY = "run `make stability`"


def test_the_table_is_whole_and_no_case_fails() -> None:
    rows = read(TABLE)
    assert {Task(row.scene, row.case) for row in rows} == set(tasks()), REMEDY
    assert not [(row.scene, row.case) for row in rows if row.failed]


def test_validation_counts_the_cases() -> None:
    of_sets = [name for name in SCENES if name.startswith("set_")]
    said = f"| {len(SCENES)} hard cases, {len(of_sets)} of them on planetary sets,"
    assert said in (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")


def test_table_facts_and_page_are_of_one_run() -> None:
    rows = read(TABLE)
    assert TABLE.read_text(encoding="utf-8") == table(rows), REMEDY
    shown = MARK.sub(r"\1\4", (ROOT / "docs" / "stability.md").read_text(encoding="utf-8"))
    assert shown == page(rows), REMEDY
