"""Rows of CSV files as programs and offices write them: commas, semicolons or tabs between columns, decimal points or
decimal commas, any line end, with or without a byte order mark. What follows a # is remark."""

from __future__ import annotations

import csv
from pathlib import Path

from gearfmu.errors import Problem

_MOST_SHOWN = 20
Row = tuple[str, list[str]]  # its place ("line 3") and its cells


class RowReader:
    """One file of rows, and what is wrong with it."""

    def __init__(self, file: str):
        self.file = file
        self.problems: list[Problem] = []

    def refuse(self, where: str, value: str, remedy: str) -> None:
        """Adds a problem."""
        self.problems.append(Problem(self.file, where, value, remedy))

    @property
    def shown(self) -> list[Problem]:
        """The problems, of many the first."""
        left = len(self.problems) - _MOST_SHOWN
        rest = [Problem(self.file, "", "", f"and {left} more problems: correct these first")] if left > 0 else []
        return self.problems[:_MOST_SHOWN] + rest

    def rows(self, path: Path, remedy: str) -> list[Row] | None:
        """The rows, of which the first is the head; None, and a problem, where the file cannot be read. remedy : with
        {why}, what hinders it."""
        try:
            return _rows(path)
        except (OSError, UnicodeDecodeError) as error:
            self.refuse("", "", remedy.replace("{why}", getattr(error, "strerror", None) or "it is not UTF-8 text"))
            return None


def _rows(path: Path) -> list[Row]:
    """Rows with stripped cells, without empty ones at the end; the head decides what separates columns."""
    lines = [line.split("#")[0].strip() for line in path.read_text(encoding="utf-8-sig").splitlines()]
    head = next((line for line in lines if line), "")
    separator = next((sign for sign in ";\t" if sign in head), ",")
    rows = []
    for number, line in enumerate(lines, 1):
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator))] if line else []
        while cells and not cells[-1]:
            cells.pop()
        if cells:
            rows.append((f"line {number}", cells))
    return rows


def number(cell: str) -> float:
    """The number in a cell; ValueError where it is none."""
    return float(cell.replace(",", "."))


def uneven(found: int, wanted: int) -> str:
    """The remedy for a row that has `found` values where the head has `wanted`."""
    if found < wanted:
        return f"{found} values, the head has {wanted}: complete the row"
    return f"{found} values, the head has {wanted}: with decimal commas, separate the columns by semicolons"
