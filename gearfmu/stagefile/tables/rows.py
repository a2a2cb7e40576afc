"""Rows of CSV files as programs and offices write them: commas, semicolons or tabs between columns, decimal points or
decimal commas, any line end, with or without a byte order mark. What follows a # is remark."""

from __future__ import annotations

import csv
from pathlib import Path


def read_rows(path: Path) -> list[tuple[str, list[str]]]:
    """Of every row its place ("line 3") and its cells, stripped, without empty ones at the end; the head is the first
    row and decides what separates columns. OSError, UnicodeDecodeError: the file cannot be read."""
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
