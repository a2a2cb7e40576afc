"""The hard cases as a program: python -m evidence.stability [--scene NAME]... [--out TABLE]"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from evidence.stability import suite
from evidence.stability.case import CASES, LEVELS, STEPS, Case
from evidence.stability.scenes import SCENES, what
from gearfmu.commands.shared import progress_bar
from gearfmu.quantities import to_si


def main(given: Sequence[str] | None = None) -> int:
    """The command line; returns the number of failures, at most 99."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", action="append", default=[], help="may repeat; all when not given")
    parser.add_argument("--level", action="append", choices=LEVELS, help="may repeat; with or without --h instead of: "
                        "fast at three steps, the others at the default step")  # fmt: skip
    parser.add_argument("--h", action="append", help=f"internal step: {', '.join(STEPS)}, or '5 us'; may repeat")
    parser.add_argument("--out", type=Path, help="table (CSV), with the statistics beside it (JSON)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--list", action="store_true", help="describe the scenes and run nothing")
    chosen = parser.parse_args(given)
    if chosen.list:
        print("\n".join(f"{name}: {what(name)}" for name in chosen.scene or SCENES))
        return 0
    cases: Sequence[Case] = CASES
    if chosen.level or chosen.h:
        steps = [(h, 0.0) if h in STEPS else (suite.GIVEN, to_si(h, "s")) for h in chosen.h or ["default"]]
        cases = [Case(level, *step) for level in chosen.level or LEVELS for step in steps]
    with progress_bar("stability") as progress:
        rows = suite.run_suite(suite.tasks(chosen.scene, cases), chosen.out, chosen.jobs, progress)
    print(suite.table(rows), end="")
    failures = [row for row in rows if row.failed]
    for row in failures:
        said = "; ".join(row.finding.complaints) or "must run through at the default step"
        print(
            f"{row.scene}, {row.case.level}, h = {row.finding.h:.4g} s, {row.finding.outcome}: {said}", file=sys.stderr
        )
    print(f"{len(rows)} cases, {len(failures)} failed", file=sys.stderr)
    return min(len(failures), 99)


if __name__ == "__main__":
    sys.exit(main())
