"""Tables of evidence as CSV files: rows of texts, and columns of numbers."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.files import written_whole


def read_rows(path: Path) -> list[dict[str, str]]:
    """The rows of a table, none when there is no file."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def write_rows(path: Path, rows: Sequence[Mapping[str, object]], digits: int = 4) -> None:
    """Rows with the same keys; numbers with so many digits, nothing for None."""
    with written_whole(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({name: shown(value, digits) for name, value in row.items()})


def shown(value: object, digits: int = 4) -> object:
    """A float with so many digits, all else as it is."""
    return f"{value:.{digits}g}" if isinstance(value, float) else value


def told(row: Mapping[str, object]) -> None:
    """Print a row as soon as it is there."""
    print("  ".join(f"{name} {shown(value)}" for name, value in row.items()), flush=True)


def tidy(rows: Sequence[Any], columns: Sequence[str] | None = None) -> str:
    """A table for the terminal: one row a line, numbers with three digits, columns aligned."""
    if not rows:
        return "(no rows)"
    names = list(columns or asdict(rows[0]))
    cells = [names] + [[_cell(getattr(row, name)) for name in names] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return "\n".join("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in cells)


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def write_columns(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Columns (T,) of numbers with nine digits."""
    with written_whole(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([[f"{value:.9g}" for value in row] for row in np.column_stack(list(columns.values()))])


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """The columns of such a table."""
    with path.open(encoding="utf-8") as file:
        head = next(csv.reader(file))
        return dict(zip(head, np.loadtxt(file, delimiter=",").T, strict=True))
