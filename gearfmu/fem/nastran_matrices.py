"""Matrices of Nastran as text: DMIG cards and ASCII OUTPUT4.

Source: the formats as described in the Quick Reference Guides of Nastran (bulk data entry DMIG; OUTPUT4 module).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from gearfmu.fem.bulk_data import bulk_cards, bulk_number


@dataclass(frozen=True)
class Labelled:
    """A matrix (n, n) with node label and component 0 … 5 of each row, (n, 2)."""

    matrix: sp.csr_array
    unknowns: np.ndarray


def from_triangle(matrix: sp.csr_array) -> sp.csr_array:
    """The symmetric matrix of which one triangle is given."""
    return sp.csr_array(matrix + matrix.T - sp.diags_array(matrix.diagonal()))


def read_dmig(path: Path) -> Labelled:
    """The only DMIG matrix of a file, free, small or large field. Form 6 gives one triangle. ValueError when there is
    none or more than one, or it is complex."""
    cards = [card for card in bulk_cards(path) if card[0].rstrip("*") == "DMIG"]
    heads = [card for card in cards if card[2] in ("0", "") and len(card) > 4]
    if len(heads) != 1:
        raise ValueError(f"expected one DMIG matrix, found {len(heads)}")
    form, kind = int(heads[0][3]), int(heads[0][4])
    if kind not in (1, 2):
        raise ValueError("the matrix is complex")
    entries: dict[tuple[tuple[int, int], tuple[int, int]], float] = {}
    for card in cards:
        if card is heads[0]:
            continue
        column = (int(card[2]), int(card[3] or 1) - 1)
        rest = card[5:]
        for k in range(0, len(rest) - 2, 4):
            if rest[k]:
                entries[(int(rest[k]), int(rest[k + 1] or 1) - 1), column] = bulk_number(rest[k + 2])
    unknowns = sorted({key for pair in entries for key in pair})
    number = {key: k for k, key in enumerate(unknowns)}
    rows, columns = (np.array([number[pair[side]] for pair in entries]) for side in (0, 1))
    matrix = sp.coo_array((list(entries.values()), (rows, columns)), (len(number),) * 2).tocsr()
    if form == 6:
        upper = abs(sp.triu(matrix, 1)).sum() > 0
        lower = abs(sp.tril(matrix, -1)).sum() > 0
        if not (upper and lower and abs(matrix - matrix.T).max() == 0):
            matrix = from_triangle(matrix)
    return Labelled(sp.csr_array(matrix), np.array(unknowns))


def read_op4(path: Path) -> sp.csr_array:
    """The only matrix of an ASCII OUTPUT4 file: dense, sparse, or big-matrix form, real. ValueError otherwise."""
    data = path.read_bytes()
    if b"\x00" in data[:64]:
        raise ValueError("a binary OUTPUT4 file; ask for FORMATTED (ASCII) output")
    lines = data.decode("ascii", "replace").splitlines()
    columns, rows, form, kind = (int(lines[0][k : k + 8]) for k in range(0, 32, 8))
    layout = lines[0][40:].strip().lstrip(",") or "1P,5E16.9"
    width = int(layout.split("E")[1].split(".")[0])
    if kind not in (1, 2):
        raise ValueError("the matrix is complex")
    big = rows < 0 or abs(rows) > 65535
    entries: list[tuple[int, int, float]] = []
    at = 1
    while at < len(lines):
        column, first, words = (int(lines[at][k : k + 8]) for k in range(0, 24, 8))
        at += 1
        if column > columns:
            break
        if first:
            values, at = _op4_values(lines, at, words, width)
            entries += [(first - 1 + k, column - 1, v) for k, v in enumerate(values)]
            continue
        at = _op4_strings(lines, at, (column - 1, words, kind, width, big), entries)
    if not entries:
        raise ValueError("no entries")
    row, col, value = (np.array(part) for part in zip(*entries, strict=True))
    matrix = sp.coo_array((value, (row, col)), (abs(rows), columns)).tocsr()
    if (
        form == 6
        and abs(matrix - matrix.T).max() > 0
        and min(abs(sp.triu(matrix, 1)).sum(), abs(sp.tril(matrix, -1)).sum()) == 0
    ):
        matrix = from_triangle(matrix)
    return sp.csr_array(matrix)


def _op4_strings(lines: list[str], at: int, column: tuple[int, int, int, int, bool], entries: list) -> int:
    """The strings of one sparse column: header lines with length and row, then the numbers."""
    number, words, kind, width, big = column
    while words > 0:
        if big:
            length, row = (int(lines[at][k : k + 8]) for k in (0, 8))
            length, used = length - 1, length + 1
        else:
            packed = int(lines[at][:8])
            length, row = packed // 65536 - 1, packed % 65536
            used = length + 1
        at += 1
        values, at = _op4_values(lines, at, length // kind, width)
        entries += [(row - 1 + k, number, v) for k, v in enumerate(values)]
        words -= used
    return at


def _op4_values(lines: list[str], at: int, count: int, width: int) -> tuple[list[float], int]:
    values: list[float] = []
    while len(values) < count:
        line = lines[at]
        values += [bulk_number(line[k : k + width].strip()) for k in range(0, len(line.rstrip()), width)]
        at += 1
    return values, at
