"""Rows as a table for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any


def tidy(rows: Sequence[Any], columns: Sequence[str] | None = None) -> str:
    """A table for the terminal: one row a line, numbers with three digits, columns aligned."""
    if not rows:
        return "(no rows)"
    names = list(columns or asdict(rows[0]))
    cells = [names] + [[_shown(getattr(row, name)) for name in names] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return "\n".join("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in cells)


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
