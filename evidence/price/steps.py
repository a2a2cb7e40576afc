"""Instructions of an internal step by level and step size, counted by callgrind: steps.csv beside it.

    python -m evidence.price.steps [STAGE …]

Pair with relief: 302 N·m at 2000 rpm, one mesh period after half a millisecond. Planetary set planetary54: 600 N·m on
the carrier at 85 rad/s, constant torques, 1.4 ms after 2 ms. Five slices; the first row of a level is its default
step. With STAGE only its rows are made again. Needs valgrind and cc; a minute for the pair, most of a minute a row of
the set, nearly all of it the model's preparation under valgrind.
"""

from __future__ import annotations

import csv
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gearfmu.body import load_bodies
from gearfmu.kernel.build import library_path
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stagefile.stage import load_stage

ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(__file__).with_suffix(".csv")
COLUMNS = ("stage", "level", "h_s", "instructions_per_step")
LEVELS = {"rigid": 0.0, "fast": 1.0, "standard": 2.0, "full": 3.0}
DEFAULT, SLICES = 20e-6 / 3, 5.0  # s


@dataclass(frozen=True)
class Bench:
    """A stage, the steps (s) of each level; communication step (s), how many before and while it counts."""

    stage: str
    cases: dict[str, tuple[float, ...]]
    step: float
    warm: int
    counted: int


PAIR = Bench(
    "fzg_c/stage_relief",
    {"rigid": (DEFAULT,), "fast": (DEFAULT, 10e-6, 5e-6, 1.25e-6), "standard": (DEFAULT,), "full": (DEFAULT, 1.25e-6)},
    20e-6,
    25,
    95,
)
SET = Bench(
    "planetary54",
    {"fast": (DEFAULT, 10e-6, 5e-6), "standard": (DEFAULT,), "full": (DEFAULT,)},
    1e-4,
    20,
    14,
)
SET_START, SET_TORQUES = {"carrier.w_start": 85.0, "sun.w_start": 340.0}, {"carrier.tau": 600.0, "sun.tau": -150.0}


def words(bench: Bench, model: StageModel, level: str, h: float) -> list[str]:
    """Parameters and inputs as the host program takes them: reference = start + slope."""
    known, given = model.kernel().variables, {"level": LEVELS[level], "h": h, "slices": SLICES}
    if bench is SET:
        given, start, later = given | SET_START, SET_TORQUES, SET_TORQUES
    else:
        steady = Steady(model, 209.44, 302.0)
        start, later = steady(0.0), steady(1.0)
    found = [f"p{known[name].reference}={value!r}+0" for name, value in given.items()]
    return found + [f"i{known[n].reference}={float(v)!r}+{float(later[n] - v)!r}" for n, v in start.items()]


def instructions(bench: Bench, model: StageModel, case: tuple[str, float], folder: Path) -> float:
    """Instructions of an internal step at a level and step (s)."""
    host, blob, program = folder / "host", folder / "blob", Path(__file__).with_name("effects_host.c")
    include = ROOT / "gearfmu" / "kernel" / "src"
    subprocess.run(["cc", "-std=gnu99", "-O2", f"-I{include}", "-o", host, program, "-ldl"], check=True)
    blob.write_bytes(model.blob)
    command = ["valgrind", "--tool=callgrind", "--instr-atstart=no", "--toggle-collect=measured",
               "--callgrind-out-file=/dev/null", host, library_path(), blob, bench.warm, bench.counted, bench.step,
               *words(bench, model, *case)]  # fmt: skip
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True)
    collected = re.search(r"Collected\s*:\s*(\d+)", done.stderr)
    assert collected is not None, "callgrind says what it collected"
    return int(collected[1]) / float(done.stdout.split()[0])


def rows_of(bench: Bench, folder: Path) -> Iterator[list[str]]:
    """The rows of a stage."""
    spec = load_stage(bench.stage)
    model = assemble(spec, load_bodies(spec))
    for level, steps in bench.cases.items():
        for h in steps:
            yield [bench.stage, level, f"{h:g}", f"{instructions(bench, model, (level, h), folder):.0f}"]


def main(stages: list[str]) -> None:
    """Measure, print, write the table."""
    with TABLE.open(newline="", encoding="utf-8") as file:
        rows = [row for row in list(csv.reader(file))[1:] if stages and row[0] not in stages]
    with tempfile.TemporaryDirectory() as folder:
        for bench in (PAIR, SET):
            for row in rows_of(bench, Path(folder)) if bench.stage in (stages or [bench.stage]) else ():
                rows.append(row)
                print(",".join(row), flush=True)
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])


if __name__ == "__main__":
    main(sys.argv[1:])
