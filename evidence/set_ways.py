"""Ways to integrate the planetary set planetary54 on the same bodies: price and error, into evidence/set_ways.csv.

    python evidence/set_ways.py

The first millisecond of the scene planetary_paper from rest under load at 85 rad/s, five slices. rk45 at level full
integrates as the paper does: all 2555 oscillators, up to 400 modes a gear, tolerance 1e-6. Level paper adds its contact
at flank nodes and leaves out the residual. Errors are against level full at 0.4 µs (docs/theory.md, 6): rk45 takes the
closing speed of the contact's dampers from other quantities than dg4, which is its error here. A row a way: level,
integrator, internal step (rk45: mean), oscillators, processor seconds per simulated second, that over rk45's at level
full, errors of transmission error and mesh forces. Five minutes.
"""

from __future__ import annotations

import csv
from pathlib import Path

from gearfmu.body import load_bodies
from gearfmu.spec.scene import load_scene
from gearfmu.spec.stage import load_stage
from gearfmu.stage import assemble
from gearfmu.study.bench import Point, Replay, measure, replayed_price
from gearfmu.study.norm import errors

TABLE = Path(__file__).parent / "set_ways.csv"
SETTLE, DURATION = 1e-4, 1e-3  # s
REFERENCE, OF_PAPER = Point("full", h=4e-7), Point("full", "rk45")
WAYS = (
    Point("fast", h=1e-5),
    Point("fast", h=5e-6),
    Point("standard", h=5e-6),
    Point("full", h=5e-6),
    Point("full", h=1.25e-6),
    OF_PAPER,
    Point("paper", "rk45"),
)
HEAD = "level,integrator,h_s,n_dyn,realtime_factor,cpu_ratio,te_error,force_error"


def main() -> None:
    """Measure, print, write the table."""
    scene = load_scene("planetary_paper").model_copy(update={"settle": SETTLE, "duration": DURATION})
    spec = load_stage("planetary54")
    model = assemble(spec, load_bodies(spec))
    wanted, dear = measure(scene, model, REFERENCE).signals, measure(scene, model, OF_PAPER)
    assert dear.recording is not None
    rows = [HEAD.split(",")]
    print(HEAD)
    for way in WAYS:
        run = dear if way is OF_PAPER else measure(scene, model, way)
        assert run.recording is not None
        found = errors(run.signals, wanted)
        price = replayed_price(Replay(run.recording), Replay(dear.recording), looked_at=1.0)
        numbers = (run.h, run.n_dyn, price.realtime_factor, price.cpu_ratio, found.te, found.force)
        rows.append([way.level, run.integrator, *(f"{number:.4g}" for number in numbers)])
        print(",".join(rows[-1]), flush=True)
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main()
