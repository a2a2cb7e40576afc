"""The committed table: whole, without failures, and what docs/stability.md shows."""

from __future__ import annotations

from pathlib import Path

from evidence.pages_made import MARK
from evidence.stability.case import LEVELS, STEPS
from evidence.stability.page import page
from evidence.stability.scenes import SCENES
from evidence.stability.suite import Task, read, table, tasks, usual

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "evidence" / "stability" / "stability.csv"
REMEDY = "run `make stability`"


def test_every_scene_ran_through_at_level_fast() -> None:
    rows = read(TABLE)
    seen = {row.scene for row in rows if (row.case.level, row.case.step) == ("fast", "default")}
    assert seen == set(SCENES), REMEDY


def test_no_case_fails() -> None:
    assert not [(row.scene, row.case) for row in read(TABLE) if row.failed]


def test_the_table_is_whole() -> None:
    seen = [Task(row.scene, row.case) for row in read(TABLE)]
    assert set(filter(usual, tasks(tuple(SCENES), LEVELS, tuple(STEPS)))) == set(seen), REMEDY


def test_validation_counts_the_cases() -> None:
    of_sets = [name for name in SCENES if name.startswith(("set_", "planetary_"))]
    said = f"| {len(SCENES)} hard cases, {len(of_sets)} of them on planetary sets,"
    assert said in (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")


def test_table_facts_and_page_are_of_one_run() -> None:
    rows = read(TABLE)
    assert TABLE.read_text(encoding="utf-8") == table(rows), REMEDY
    shown = MARK.sub(r"\1\4", (ROOT / "docs" / "stability.md").read_text(encoding="utf-8"))
    assert shown == page(rows), REMEDY
