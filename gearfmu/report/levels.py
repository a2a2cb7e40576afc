"""The price list of a stage's fidelity levels, as evidence/study/levels.py measured it: levels.csv beside the stage
file."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.reading.files import model_folder

COLUMNS: dict[str, Callable[[str], Any]] = {  # and what their text is read as
    "scene": str,
    "level": str,
    "n_dyn": int,
    "slices": int,
    "h_us": float,
    "te_error": float,
    "force_error": float,
    "bearing_error": float,
    "te_mean_error_um": float,
    "time_per_second": float,
    "bodies": str,
}
HEADER = (
    "scene, level",
    "dynamic modes",
    "slices",
    "step, µs",
    "TE",
    "mesh force",
    "bearing force",
    "mean TE, µm",
    "CPU time per second",
)


def levels_path(stage: Stage) -> Path:
    """Where the price list of a stage lies."""
    return model_folder(stage) / f"levels_{stage.name}.csv"


def read_levels(path: Path) -> list[dict[str, Any]]:
    """Rows of the list, numbers as numbers; empty when there is none or it is of another version."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        if tuple(reader.fieldnames or ()) != tuple(COLUMNS):
            return []
        return [{key: COLUMNS[key](text) for key, text in row.items()} for row in reader]


def fingerprint(hashes: Iterable[str]) -> str:
    """Which bodies a row was measured with, from their input hashes, pinion first."""
    return "+".join(text[:12] for text in hashes)


def shown_rows(rows: list[dict[str, Any]], level: str) -> list[tuple[str, ...]]:
    """Rows as text for a page; the level in use is marked."""
    return [
        (
            f"{row['scene']}, {row['level']}{' ←' if row['level'] == level else ''}",
            str(row["n_dyn"]),
            str(row["slices"]),
            f"{row['h_us']:.3g}",
            *(f"{100 * row[f'{name}_error']:.2g} %" for name in ("te", "force", "bearing")),
            f"{row['te_mean_error_um']:.2g}",
            f"{row['time_per_second']:.3g}",
        )
        for row in rows
    ]
