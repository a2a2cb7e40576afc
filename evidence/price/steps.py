"""Instructions of an internal step by level and step size, counted by callgrind: steps.csv beside it.

    python -m evidence.price.steps

Pair with relief: 302 N·m at 2000 rpm, one mesh period after half a millisecond. Planetary set planetary54: 600 N·m on
the carrier at 85 rad/s, constant torques, 1.4 ms after 2 ms. Five slices; the first row of a level is its default
step. Needs valgrind and cc; a minute for the pair, most of a minute a row of the set, nearly all of it the model's
preparation under valgrind.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import gearfmu
from evidence.price.counted import SET, SET_START, SET_TORQUES, Period, count, make_host, words
from evidence.tables import told, write_rows
from gearfmu.kernel.build import library_path
from gearfmu.stage import Steady
from gearfmu.stage.assembly.levels import LEVELS

DEFAULT, SLICES = 20e-6 / 3, 5.0  # s


@dataclass(frozen=True)
class Bench:
    """A stage, the steps (s) of each level, and what is counted."""

    stage: str
    cases: dict[str, tuple[float, ...]]
    period: Period


BENCHES = (
    Bench(
        "fzg_c/stage_relief",
        {
            "rigid": (DEFAULT,),
            "fast": (DEFAULT, 10e-6, 5e-6, 1.25e-6),
            "standard": (DEFAULT,),
            "full": (DEFAULT, 1.25e-6),
        },
        Period(25, 95, 20e-6),
    ),
    Bench(
        SET,
        {"fast": (DEFAULT, 10e-6, 5e-6), "standard": (DEFAULT,), "full": (DEFAULT,)},
        Period(20, 14, 1e-4),
    ),
)


def rows_of(bench: Bench, folder: Path) -> Iterator[dict[str, str]]:
    """The rows of a stage."""
    model = gearfmu.assemble(bench.stage)
    host, blob = make_host(folder), folder / "blob"
    blob.write_bytes(model.blob)
    of_set = bench.stage == SET
    load, start = (SET_TORQUES, SET_START) if of_set else (Steady(model, 209.44, 302.0), {})
    for level, steps in bench.cases.items():
        for h in steps:
            given = {"level": float(LEVELS.index(level)), "h": h, "slices": SLICES} | start
            found = count(host, library_path(), blob, bench.period, words(model, given, load)).instructions
            yield {"stage": bench.stage, "level": level, "h_s": f"{h:g}", "instructions_per_step": f"{found:.0f}"}


def main() -> None:
    """Measure, print, write the table."""
    with tempfile.TemporaryDirectory() as folder:
        rows = told(row for bench in BENCHES for row in rows_of(bench, Path(folder)))
    write_rows(Path(__file__).with_suffix(".csv"), rows)


if __name__ == "__main__":
    main()
