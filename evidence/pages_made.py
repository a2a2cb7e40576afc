"""What pages say of the tables that they show, between two marks: date and commit from the ledger, and short tables.

<!-- made: plans -->2026-11-28, commit a401c1e1d2b3<!-- -->         of one target
<!-- tier: 2 -->                                                    a table of all targets of a tier
<!-- -->
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evidence.study.page_tables import TABLES
from gearfmu.files import write_text

MARK = re.compile(r"(<!-- (made|tier|table): (\S+) -->).*?(<!-- -->)", re.DOTALL)


def write_pages(root: Path, entries: Mapping[str, Mapping[str, Any]]) -> int:
    """Bring all marks in README.md and docs up to date; 0."""
    for page in (root / "README.md", *sorted((root / "docs").glob("*.md"))):
        before = page.read_text(encoding="utf-8") if page.is_file() else ""
        after = filled(before, entries, root / "evidence")
        if after != before:
            write_text(page, after)
    return 0


def filled(text: str, entries: Mapping[str, Mapping[str, Any]], folder: Path) -> str:
    """A page with what ledger and tables say between its marks. KeyError for a name that is not there."""

    def between(mark: re.Match[str]) -> str:
        if mark[2] == "made":
            return f"{mark[1]}{made(entries[mark[3]])}{mark[4]}"
        lines = TABLES[mark[3]](folder) if mark[2] == "table" else of_tier(entries, int(mark[3]))
        return f"{mark[1]}\n{lines}\n{mark[4]}"

    return MARK.sub(between, text)


def made(entry: Mapping[str, Any]) -> str:
    """When a target was made, and of which commit; "not made" before that."""
    if not entry["made"]:
        return "not made"
    return f"{entry['made']}, commit {entry['commit']}" if entry.get("commit") else str(entry["made"])


def of_tier(entries: Mapping[str, Mapping[str, Any]], tier: int) -> str:
    """A line a target of a tier."""
    chosen = {name: entry for name, entry in entries.items() if entry["tier"] == tier}
    lines = [f"| {name} | {made(entry)} | {entry['minutes']} |" for name, entry in chosen.items()]
    return "\n".join(["| target | made | minutes |", "|---|---|---|", *lines])
