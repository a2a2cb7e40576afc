"""Rows of a table drawn by chance, and whether the same rows made again agree: the condition for carrying a table."""

from __future__ import annotations

import random
from pathlib import Path

from evidence.tables import read_rows

COUNT = 3
SAME = 1e-6  # relative difference of numbers that agree: tables hold four digits and more


def drawn(table: Path, seed: str) -> list[dict[str, str]]:
    """COUNT rows of a CSV file, or all where it has fewer, by the seed."""
    rows = read_rows(table)
    return random.Random(seed).sample(rows, min(COUNT, len(rows)))


def agree(rows: list[dict[str, str]], made: Path, but: list[str]) -> list[str]:
    """What is wrong: rows that have no equal in the CSV file `made`, columns `but` left out."""
    again = read_rows(made)
    return [f"not made again: {row}" for row in rows if not any(equal(row, other, but) for other in again)]


def equal(row: dict[str, str], other: dict[str, str], but: list[str]) -> bool:
    """Whether two rows have the same text, or numbers within SAME, in every column but those."""
    return row.keys() == other.keys() and all(same(row[key], other[key]) for key in row.keys() - set(but))


def same(text: str, other: str) -> bool:
    """Whether two cells agree."""
    try:
        a, b = float(text), float(other)
    except ValueError:
        return text == other
    return text == other or abs(a - b) <= SAME * max(abs(a), abs(b))
