"""What a body's file holds is said once, at the fields of the classes that hold it: shape, unit, meaning, and how it is
stored (`gearfmu/body/layout.py`)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any

TABLE_BITS = 23  # of compliances; what this costs a model: docs/decisions/bodies.md
ROW_BITS = 21  # of rows in modes and of the coupling of modes
PICTURE_BITS = 7
_ENTRY = "entry"


@dataclass(frozen=True)
class Entry:
    """One array of a body and dataset of its file.

    shape: in symbols or numbers. kind: in memory, "f8" doubles, "f4" singles (pictures), "i8" integers. bits: 0, the
    file holds the numbers themselves; else whole multiples of a step, which the largest number has fewer than 2^bits
    of, and along the roll points (R) those of its cosine transform. each: a step for every index of the first axis
    instead of one for all. optional: None where it was not made. field: attribute path in `body.Body`.
    """

    shape: tuple[str | int, ...]
    unit: str
    meaning: str
    kind: str = "f8"
    bits: int = 0
    each: bool = False
    optional: bool = False
    field: str = ""

    @property
    def path(self) -> str:
        """Name of the dataset."""
        return self.field.replace(".", "/")


def stored(shape: tuple[str | int, ...], unit: str, meaning: str, kind: str = "f8", **how: Any) -> Any:
    """A field of a dataclass that is an `Entry`; an optional one is None unless it is given."""
    entry = Entry(shape, unit, meaning, kind, **how)
    return field(default=None, metadata={_ENTRY: entry}) if entry.optional else field(metadata={_ENTRY: entry})


def entries(kind: Any, path: str = "") -> Iterator[Entry]:
    """The stored fields of a dataclass, or of an object of it, that stands at `path` ("flank.") in a body."""
    for own in fields(kind):
        if _ENTRY in own.metadata:
            yield replace(own.metadata[_ENTRY], field=f"{path}{own.name}")
