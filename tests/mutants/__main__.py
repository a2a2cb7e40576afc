"""Planted defects: one line of the program is made wrong at a time, and tests that run this line must fail.

    python tests/mutants --map                     which tests run which lines (build/mutants/map), once
    python tests/mutants --draw 120 --seed 43      draws defects from the sources into evidence/mutants.csv
    python tests/mutants [--jobs 2]                judges those without verdict; a row is written as it comes
    python tests/mutants --again PATTERN           judges anew those whose file or text matches
    python tests/mutants --again OPEN              judges anew what survived before, with a larger --seconds

Golden runs and stored tables do not judge: the physics must see a defect. A survivor's verdict (equivalent, harmless,
hole) and its reason are written into the table by hand. Exit code 1 where fewer than 85 % of the defects that change
anything are caught."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from queue import SimpleQueue
from threading import Lock

from copies import Copy
from draw import drawn
from judges import judges, known, make_map
from table import CAUGHT, OPEN, Row, count, read, row_of, write

LEAST = 0.85  # share that must be caught
MOST = 14  # modules that judge one defect
FIRST = 2  # of them run alone before the others are collected
SECONDS = 90.0  # processor time of the tests of one defect


def draw(number: int, seed: int) -> None:
    """Adds `number` of the drawn defects that change the program's code to the table, which also has those that were
    once chosen by hand."""
    rows = read()
    known = {(r.file, r.before, r.after) for r in rows}
    copy, left = Copy("copy0"), number
    copy.build()
    for defect in drawn(seed):
        if not left:
            break
        with copy.planted(defect) as changed:
            if changed:
                left -= 1
                rows += [row_of(defect)] if (defect.file, defect.before, defect.after) not in known else []
                write(rows)
                print(f"{left:3} {defect.file}:{defect.line} {defect.kind}: {defect.after}", flush=True)


def judged(copy: Copy, row: Row, seconds: float) -> Row:
    """The row with the test that failed, or with its old verdict."""
    started, tests = time.monotonic(), judges(row.file, int(row.line))[:MOST]
    if (copy.root / row.caught_by.split("::")[0]).is_file():
        tests.insert(0, row.caught_by.split("::")[0])
    tests, failed = list(dict.fromkeys(tests)), ""
    with copy.planted(row.defect) as changed:
        for some in (tests[:FIRST], tests[FIRST:]):
            if changed and some and not failed and seconds > 0.0:
                run = copy.run(some, seconds)
                failed, seconds = run.failed, seconds - run.seconds
    print(
        f"{time.monotonic() - started:4.0f} s {len(tests):3} modules  {row.file}:{row.line} {row.after}  {failed}",
        flush=True,
    )
    if failed:
        return replace(row, caught_by=failed, verdict=CAUGHT, why="")
    kept = OPEN if row.verdict in ("", CAUGHT) else row.verdict
    return replace(row, caught_by="", verdict=kept)


def judge_all(wanted: Sequence[int], jobs: int, seconds: float) -> None:
    """Judges rows of the table by number, each worker in its own copy of the checkout."""
    rows, lock, free = read(), Lock(), SimpleQueue()
    for k in range(jobs):
        copy = Copy(f"copy{k}")
        copy.build()
        free.put(copy)

    def one(k: int) -> None:
        copy = free.get()
        rows[k] = judged(copy, rows[k], seconds)
        free.put(copy)
        with lock:
            now = {(r.file, r.before, r.after): r for r in read()}  # verdicts may have been written meanwhile
            now[rows[k].file, rows[k].before, rows[k].after] = rows[k]
            write(now.values())

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(one, wanted))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--map", action="store_true")
    parser.add_argument("--draw", type=int, default=0)
    parser.add_argument("--seed", type=int, default=43)
    parser.add_argument("--again", default="")
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    if given.map:
        make_map()
    if given.draw:
        draw(given.draw, given.seed)
    if given.map or given.draw:
        return 0
    rows = read()
    texts = [f"{r.file}:{r.line} {r.before} {r.after} {r.verdict.upper()}" for r in rows]
    wanted = [k for k, r in enumerate(rows) if (re.search(given.again, texts[k]) if given.again else not r.verdict)]
    if wanted and not known():
        parser.error("nobody knows which tests run which lines: --map first")
    judge_all(wanted, given.jobs, given.seconds)
    found = count(read())
    print(f"{found.caught} of {found.judged - found.equivalent} caught, {found.equivalent} equivalent")
    return int(found.share < LEAST)


if __name__ == "__main__":
    sys.exit(main())
