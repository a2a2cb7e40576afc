"""Tables of this folder: rows of texts, and columns of numbers."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gearfmu.files import written_whole


def read_rows(path: Path) -> list[dict[str, str]]:
    """The rows of a table, none when there is no file."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def write_rows(path: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """Rows with the same keys; numbers with four digits."""
    with written_whole(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({key: f"{value:.4g}" if isinstance(value, float) else value for key, value in row.items()})


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
