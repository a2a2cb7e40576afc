"""A run that goes astray and returns: saved states against a straight run."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from evidence.stability.record import Inputs, Record, Run, Watched, run_times
from gearfmu.kernel import Kernel

STEP, LONGEST_WANDER = 2e-5, 3  # s; steps


def run_astray(
    fresh: Callable[[], Kernel],
    inputs: Inputs,
    wander: Callable[[np.random.Generator], Mapping[str, float]],
    times: int,
    watched: Watched,
) -> tuple[Record, list[str]]:
    """At every step the state is saved, the run goes on for 1 to 3 steps under inputs of `wander` and returns. The
    record of that run, and what is wrong: it must end bit for bit like the straight run."""
    straight, astray, random = fresh(), fresh(), np.random.default_rng(2)
    calm = run_times(straight, inputs, np.arange(times + 1) * STEP, watched)
    going, started = Run(astray, times, watched), clock.process_time()
    going.set(inputs(0.0))
    astray.initialize(0.0)
    going.take(0.0)
    for i in range(times):
        now = i * STEP
        saved = astray.save()
        for k in range(int(random.integers(1, LONGEST_WANDER + 1))):
            going.set(wander(random))
            astray.step(now + k * STEP, STEP)
        astray.restore(saved)
        going.set(inputs(now))
        astray.step(now, STEP)
        going.take(now + STEP)
    made = replace(going.record(calm.outcome, clock.process_time() - started), throughput=calm.throughput)
    same = astray.save() == straight.save() and all(np.array_equal(made[name], calm[name]) for name in made.values)
    return made, [] if same else [f"the run with {times} rollbacks does not end in the state of the straight run"]
