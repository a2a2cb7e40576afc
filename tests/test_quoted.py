"""Numbers that README.md quotes are those of the tables: a phrase with # for every number, and the cells where they
stand.

A cell is `column` of the one row of a table that holds the given values; `column%` is in per cent, `column^` in
thousands. A number agrees when the table rounds to it; a tolerance, where one is given, is a share of the number.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NUMBER = r"(\d[\d.]*(?:e[+-]?\d+)?)"
STUDY, SETS, STEPS = "evidence/study/study.csv", "evidence/study/sets.csv", "evidence/price/steps.csv"
PAIR = {"scene": "pair_loaded", "level": "fast", "h_s": "6.66667e-06", "slices": "5", "integrator": "dg4"}
PAIR_STEP = {"stage": "fzg_c/stage_relief", "level": "fast", "h_s": "6.66667e-06"}
PLANETS = {"planets": "4", "level": "fast", "h_s": "1e-05", "speed": "85", "slices": "5", "off": ""}
Cell = tuple[str, dict[str, str], str]
QUOTES: dict[str, tuple[tuple[Cell, ...], float]] = {
    "At its default step a second of the loaded pair takes # s, # thousand instructions a step, at # % error in "
    "transmission error and # % in mesh force": (
        (
            (STUDY, PAIR, "realtime_factor"),
            (STEPS, PAIR_STEP, "instructions_per_step^"),
            (STUDY, PAIR, "te_error%"),
            (STUDY, PAIR, "force_error%"),
        ),
        0.0,
    ),
    "for # s (pair) to some # s (planetary set) of processor time a second": (
        ((STUDY, PAIR, "realtime_factor"), (SETS, PLANETS | {"against": "full, 0.4 µs"}, "realtime_factor")),
        0.15,
    ),
}


def number(cell: Cell) -> float:
    """What a table says."""
    table, wanted, column = cell
    with (ROOT / table).open(newline="", encoding="utf-8") as file:
        (row,) = [row for row in csv.DictReader(file) if wanted.items() <= row.items()]
    return {"%": 100.0, "^": 1e-3}.get(column[-1], 1.0) * float(row[column.rstrip("%^")])


def agrees(shown: str, value: float, tolerance: float) -> bool:
    """Whether a number rounds, or comes as near as the tolerance, to what is shown."""
    mantissa, _, exponent = shown.partition("e")
    last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(f"{mantissa}e{exponent or 0}") - value) <= max(0.5001 * last, tolerance * abs(value))


@pytest.mark.parametrize("phrase", QUOTES)
def test_the_readme_says_what_its_tables_say(phrase: str) -> None:
    cells, tolerance = QUOTES[phrase]
    pattern = re.escape(phrase).replace(r"\#", NUMBER).replace(r"\ ", r"\s+")
    place = re.search(pattern, (ROOT / "README.md").read_text(encoding="utf-8"))
    assert place, phrase
    for shown, cell in zip(place.groups(), cells, strict=True):
        assert agrees(shown, number(cell), tolerance), (cell, shown, number(cell))
