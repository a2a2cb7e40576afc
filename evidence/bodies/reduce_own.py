"""What the reduction of a pair of one's own costs (z 31/73, default mesh): table and CSV.

    python -m evidence.bodies.reduce_own [--coarse] [--out reduce_own.csv]

Each gear is reduced in a process of its own with one thread. estimate_gb: memory that the product states before the
work; peak_gb: what the process took. cpu_s is processor time. The reduction of `gearfmu reduce` runs both at once.
"""

from __future__ import annotations

import argparse
import csv
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from evidence.bodies.coarse import PAIR
from evidence.price.sizes import apart, peak_mb
from gearfmu.api.models import load
from gearfmu.body import reduce_body
from gearfmu.body.toothed import gear_work
from gearfmu.files import written_whole
from gearfmu.spec.forms.members import member_of
from gearfmu.spec.proposals.coarse import coarse_stage
from gearfmu.spec.proposals.numbers import new_from_numbers


def reduced(stage: str, index: int) -> dict[str, Any]:
    """One gear, reduced and not stored."""
    spec = load(stage)
    gear = spec.gears[index]
    work = gear_work(member_of(spec, gear.name))
    assert work
    clock, processor = time.monotonic(), time.process_time()
    body = reduce_body(spec, gear.name)
    return {
        "body": gear.name,
        "teeth": body.teeth,
        "unknowns_sector": work.need.unknowns,
        "modes": len(body.frequency),
        "cpu_s": round(time.process_time() - processor, 1),
        "clock_s": round(time.monotonic() - clock, 1),
        "peak_gb": round(peak_mb() / 1e3, 2),
        "estimate_gb": round(work.need.memory / 1e9, 2),
    }


def main() -> None:
    """Table on the terminal and CSV."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--coarse", action="store_true", help="its coarse sister instead")
    parser.add_argument("--out", type=Path, default=Path(__file__).with_suffix(".csv"))
    arguments = parser.parse_args()
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as home:
        stage = new_from_numbers("pair_31_73", PAIR, home)
        if arguments.coarse:
            coarse_stage(stage, Path(home) / "coarse")
            stage = Path(home) / "coarse" / "stage.toml"
        rows = [apart(reduced, str(stage), index) for index in (0, 1)]
    for row in rows:
        print("  ".join(f"{name} {value}" for name, value in row.items()))
    print(f"both: {sum(row['cpu_s'] for row in rows):.0f} s of processor time")
    with written_whole(arguments.out) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
