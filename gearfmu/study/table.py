"""Rows of a study and the CSV files they are kept in."""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterable
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import TypeAdapter

from gearfmu.errors import Problem, SpecError
from gearfmu.files import written_whole

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@dataclass(frozen=True)
class Row:
    """One point of the chart. Errors: study/norm.py. realtime_factor: processor seconds of the stage per simulated
    second; cpu_ratio: that over the cost of level fast at its default step, measured in turn with it."""

    scene: str
    level: str
    integrator: str
    h_s: float
    n_dyn: int
    slices: int
    te_error: float
    te_mean_error: float
    force_error: float
    bearing_error: float
    realtime_factor: float
    cpu_ratio: float


@dataclass(frozen=True)
class ReferenceRow:
    """What the errors of a scene are measured against, by how much it moved when its step was halved last, and
    whether that is less than a fifth of the smallest error of its kind of level full."""

    scene: str
    slices: int
    h_s: float
    n_dyn: int
    te_moved: float
    force_moved: float
    bearing_moved: float
    reached: bool


@dataclass(frozen=True)
class TransientRow:
    """What a transient scene is judged by beside the waveform: time of locking against the reference (s), largest
    difference of the octave bands of the mesh force (dB) before and after it."""

    scene: str
    level: str
    integrator: str
    h_s: float
    slices: int
    lock_time_error_s: float
    bands_before_lock_dB: float
    bands_after_lock_dB: float


AnyRow = TypeVar("AnyRow", bound="DataclassInstance")


def read_rows(path: Path, kind: type[AnyRow]) -> list[AnyRow]:
    """Rows of a file written by `write_rows`; none when there is no file. SpecError for a file of other columns."""
    if not path.is_file():
        return []
    names = [f.name for f in fields(kind)]
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        found = list(reader)
    if list(reader.fieldnames or ()) != names or any(None in line.values() for line in found):
        columns = ",".join(reader.fieldnames or ())
        raise SpecError([Problem(str(path), "header", columns, f"remove it, or give another folder: {names} is read")])
    row = TypeAdapter(kind)
    return [row.validate_python(line) for line in found]


def write_rows(path: Path, kind: type[AnyRow], rows: Iterable[AnyRow]) -> None:
    """All rows under a header of the field names; whole or not at all."""
    with written_whole(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([f.name for f in fields(kind)])
        writer.writerows(map(_plain, (astuple(row) for row in rows)))


class KeptTable:
    """A CSV file of rows, written after every change."""

    def __init__(self, path: Path, kind: type) -> None:
        self.path, self.kind = path, kind
        self.rows: list[Any] = read_rows(path, kind)

    def of(self, scene: str) -> list:
        """The scene's rows."""
        return [row for row in self.rows if row.scene == scene]

    def add(self, row: object) -> None:
        """One more; the file is sorted by its columns but the measured ones."""
        self.rows = sorted([*self.rows, row], key=_order)
        write_rows(self.path, self.kind, self.rows)

    def drop(self, scene: str, slices: Collection[int] | None = None) -> None:
        """Forget the scene's rows, or those with these numbers of slices."""
        kept = [row for row in self.rows if row.scene != scene or (slices is not None and row.slices not in slices)]
        if len(kept) < len(self.rows):
            self.rows = kept
            write_rows(self.path, self.kind, self.rows)


def _plain(values: tuple) -> list[Any]:
    texts = {True: "true", False: "false"}
    return [texts[v] if isinstance(v, bool) else f"{v:.6g}" if isinstance(v, float) else v for v in values]


def _order(row: Row | ReferenceRow | TransientRow) -> tuple:
    return (row.scene, row.slices, getattr(row, "level", ""), getattr(row, "integrator", ""), -row.h_s)
