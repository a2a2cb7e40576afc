"""Processor time of a planetary set's internal step: seconds a step, real time factor, tangents, initialisation.

    python evidence/planetary_step.py [--levels rigid fast standard] [--h 5e-6] [--time 3e-3]

The shipped set planetary54 under 600 N·m at 85 rad/s of the carrier, from its static equilibrium. Processor time of
this process, least over chunks of 0.1 ms after the first half millisecond, which other load on the machine disturbs
least. Prints a row a level: dynamic oscillators, size of the model, seconds to prepare (tables, step limit) and to
initialise (statics), microseconds a step, real time factor, tangents an engagement a step.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from functools import partial

from gearfmu.body import load_bodies
from gearfmu.spec.stage import load_stage
from gearfmu.stage import assemble
from gearfmu.stage.build.model import StageModel

LEVELS = {"rigid": 0.0, "fast": 1.0, "standard": 2.0}
START = {"carrier.tau": 600.0, "sun.tau": -150.0, "carrier.w_start": 85.0, "sun.w_start": 340.0}
CHUNK, WARM = 1e-4, 5  # s; chunks before time counts
COLUMNS = "level,n_dyn,blob_MB,prepare_s,initialise_s,step_us,real_time,tangents"


def timed(work: Callable[[], object]) -> float:
    """Processor time (s) of a call."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def measure(model: StageModel, level: float, h: float, end: float) -> list[float]:
    """The row of a level: n_dyn, MB, s, s, µs, –, –."""
    kernel = model.kernel(level=level, h=h)
    for name, value in START.items():
        kernel.set(name, value)
    prepare = timed(kernel.prepare)
    initialise = timed(lambda: kernel.initialize(0.0)) - prepare
    best = math.inf
    for chunk in range(WARM + round(end / CHUNK)):
        before = kernel.get("solver.steps")
        spent = timed(partial(kernel.step, chunk * CHUNK, CHUNK))
        if chunk >= WARM:
            best = min(best, spent / (kernel.get("solver.steps") - before))
    tangents = kernel.get("solver.iterations") / kernel.get("solver.steps") / len(model.stage.engagements)
    return [kernel.get("solver.n_dyn"), len(model.blob) / 1e6, prepare, initialise, best * 1e6, best / h, tangents]


def main() -> None:
    """Measure the levels asked for, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--levels", nargs="+", default=list(LEVELS), choices=LEVELS)
    parser.add_argument("--h", type=float, default=5e-6)
    parser.add_argument("--time", type=float, default=3e-3)
    chosen = parser.parse_args()
    spec = load_stage("planetary54")
    model = assemble(spec, load_bodies(spec))
    print(COLUMNS)
    for name in chosen.levels:
        row = measure(model, LEVELS[name], chosen.h, chosen.time)
        print(",".join([name, *(f"{x:.4g}" for x in row)]), flush=True)


if __name__ == "__main__":
    main()
