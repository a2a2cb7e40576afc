"""Tables of evidence as CSV files: rows of texts, and columns of numbers."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

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


def told(rows: Iterable[Mapping[str, object]]) -> list[Mapping[str, object]]:
    """The rows, each printed as soon as it is there."""
    found = []
    for row in rows:
        print("  ".join(f"{name} {shown(value)}" for name, value in row.items()), flush=True)
        found.append(row)
    return found


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
