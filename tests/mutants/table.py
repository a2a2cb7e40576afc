"""The table of planted defects: one row each, kept from run to run with the verdicts on survivors."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path

from draw import ROOT, Defect

TABLE = ROOT / "evidence" / "mutants.csv"
CAUGHT, EQUIVALENT, HARMLESS, HOLE = "caught", "equivalent", "harmless", "hole"
OPEN = "open"  # survived, and nobody has read it yet


@dataclass(frozen=True)
class Row:
    """One defect. verdict: of the survivors, given by hand with a reason; "" for a defect that nobody has judged."""

    file: str
    line: str
    kind: str
    before: str
    after: str
    caught_by: str = ""
    verdict: str = ""
    why: str = ""

    @property
    def defect(self) -> Defect:
        return Defect(self.file, int(self.line), self.kind, self.before, self.after)


def row_of(defect: Defect) -> Row:
    return Row(defect.file, str(defect.line), defect.kind, defect.before, defect.after)


def read(path: Path = TABLE) -> list[Row]:
    if not path.exists():
        return []
    with open(path, encoding="utf-8", newline="") as file:
        return [Row(*values) for values in list(csv.reader(file))[1:]]


def write(rows: Iterable[Row], path: Path = TABLE) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(f.name.replace("_", " ") for f in fields(Row))
        out.writerows([getattr(row, f.name) for f in fields(Row)] for row in rows)


@dataclass(frozen=True)
class Count:
    """Defects that were judged, those of them that are shown to change nothing, and those that a test caught."""

    judged: int
    equivalent: int
    caught: int

    @property
    def share(self) -> float:
        return self.caught / max(self.judged - self.equivalent, 1)


def count(rows: Iterable[Row]) -> Count:
    judged = [row for row in rows if row.verdict]
    verdicts = [row.verdict for row in judged]
    return Count(len(judged), verdicts.count(EQUIVALENT), verdicts.count(CAUGHT))
