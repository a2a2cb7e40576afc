"""dg4 beside its explicit peer: central differences on the same massless residual (the massless-boundary scheme).

    python evidence/central.py [--levels fast standard full] [--starts 5] [--duration 0.03]
        [--out evidence/central.csv]

Of each scheme, level and step: drift of the energy in undamped free rattle with the mesh position frozen (20 ms,
largest of all starts; for central of its own invariant); error of transmission error and mesh force in the loaded
damped pair (302 N·m, 2000 rpm, after settling) against the same scheme converged, h = 0.23 µs; processor time in the
kernel per simulated second, smallest of three interleaved runs. For central the limits of stability (eq. 16a),
predicted by the kernel and measured: without damping (measured: the largest step at which undamped contact, jammed to
about full load, kept its energy), and of the loaded damped pair, where the dashpot, which central takes explicitly,
lowers the limit (measured: the largest step of the table at which the pair runs calmly).
Printed and written as CSV.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import numpy as np
from rattling.free import FreePair, Rattle, energies, free_pair, started

from gearfmu.body import load_bodies
from gearfmu.errors import ModelError, SimulationError
from gearfmu.kernel import Kernel
from gearfmu.spec.stage import load_stage
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stage.run.trace import write_columns

LEVELS = {"rigid": 0, "fast": 1, "standard": 2, "full": 3}
SCHEMES = {"dg4": 0, "central": 4}
STEP, SETTLE, LOAD, SPEED = 60e-6, 0.01, 302.0, 2000 * math.pi / 30
DIVIDED = {"dg4": (8, 12, 16, 24, 32), "central": (20, 24, 32, 48, 64, 96, 144)}  # of STEP
FINE = 256
UNSTABLE = 0.5  # force error of a run that its dashpots have made unstable; stable ones stay below a tenth
COLUMNS = (
    "level",
    "scheme",
    "h_s",
    "drift",
    "te_error",
    "force_error",
    "time_per_second",
    "stable_predicted_s",
    "stable_measured_s",
    "stable_loaded_predicted_s",
    "stable_loaded_s",
)


def predicted_limit(kernel: Kernel) -> float:
    """Limit of stability of central, from its default step; infinite when another rule sets that."""
    kernel.step(0.0, 1e-3)
    h = kernel.get("solver.h")
    return h / 0.9 if h < 7e-6 else math.inf


def predicted_loaded(model: StageModel, level: int) -> float:
    """The same of the loaded pair with all damping."""
    kernel = model.kernel(level=level, integrator=SCHEMES["central"])
    for name, value in Steady(model, SPEED, LOAD)(0.0).items():
        kernel.set(name, value)
    kernel.initialize()
    return predicted_limit(kernel)


def measured_limit(free: FreePair, level: int, predicted: float) -> float:
    """Largest of a ladder of steps at which 5 ms of undamped contact, jammed to about full load, keep their energy
    within 10 %, s."""
    largest = 0.0
    for factor in (0.7, 0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.2, 1.3, 1.4):
        h = factor * predicted
        try:
            kernel = started(
                free, Rattle(play=-60e-6, speed=0.05), {"level": level, "integrator": SCHEMES["central"], "h": h}
            )
            found = energies(kernel, h, 0.005)
        except (ModelError, SimulationError):
            break
        if not found.drift < 0.1:
            break
        largest = h
    return largest


def drift(free: FreePair, level: int, scheme: str, h: float, starts: int) -> float:
    """Largest drift of free rattle over random starts; NaN where a run broke off."""
    worst = 0.0
    for seed in range(starts):
        rng = np.random.default_rng(seed)
        start = Rattle(position=rng.random(), offset=24e-6 * rng.uniform(-1, 1), speed=rng.uniform(0.05, 0.2))
        try:
            kernel = started(free, start, {"level": level, "integrator": SCHEMES[scheme], "h": h})
            worst = max(worst, energies(kernel, h, 0.02).drift)
        except (ModelError, SimulationError):
            return math.nan
    return worst


def loaded(model: StageModel, level: int, scheme: str, divided: int, duration: float) -> tuple[np.ndarray, float]:
    """(samples, 2) transmission error and mesh force after SETTLE, and processor seconds in the kernel per simulated
    second of that time; fewer samples where the run broke off, none where the step is refused."""
    inputs = Steady(model, SPEED, LOAD)
    kernel = model.kernel(level=level, integrator=SCHEMES[scheme], h=STEP / divided)
    given = [dict(inputs(i * STEP)) for i in range(round(duration / STEP))]
    spent, samples = 0.0, []
    for i, values in enumerate(given):
        for name, value in values.items():
            kernel.set(name, value)
        if i == 0:
            try:
                kernel.initialize()
            except ModelError:
                return np.empty((0, 2)), math.nan
        before = time.process_time()
        try:
            kernel.step(i * STEP, STEP)
        except SimulationError:
            break
        spent += (time.process_time() - before) * (i * STEP >= SETTLE)
        samples.append((kernel.get("mesh.te"), kernel.get("mesh.force")))
    return np.array(samples[round(SETTLE / STEP) :]), spent / (duration - SETTLE)


def error(run: np.ndarray, reference: np.ndarray, column: int) -> float:
    """rms of the difference over rms of the alternating part; NaN where the run broke off."""
    if len(run) != len(reference):
        return math.nan
    return float(np.std(run[:, column] - reference[:, column]) / np.std(reference[:, column]))


def stable_loaded(runs: dict[tuple[str, int], tuple[np.ndarray, float]], scheme: str, reference: np.ndarray) -> float:
    """Largest step of the loaded damped runs of a scheme, s, from which on no smaller one is unstable."""
    largest = STEP / FINE
    for n in sorted((n for name, n in runs if name == scheme), reverse=True):
        if not error(runs[scheme, n][0], reference, 1) < UNSTABLE:
            break
        largest = STEP / n
    return largest


def rows(models: tuple[StageModel, FreePair], level: str, starts: int, duration: float) -> list[dict[str, object]]:
    """The lines of one level. models: with its ports, and free."""
    model, free = models
    number = LEVELS[level]
    references = {scheme: loaded(model, number, scheme, FINE, duration)[0] for scheme in SCHEMES}
    apart = [error(*references.values(), column) for column in (0, 1)]
    print(f"{level}: the converged schemes differ by {apart[0]:.2%} in TE and {apart[1]:.2%} in force")
    predicted = predicted_limit(started(free, Rattle(), {"level": number, "integrator": SCHEMES["central"]}))
    limits = {
        "dg4": (math.inf,) * 3,
        "central": (predicted, measured_limit(free, number, predicted), predicted_loaded(model, number)),
    }
    found, times = [], {}
    points = [
        (scheme, n) for scheme, list_of in DIVIDED.items() for n in list_of if STEP / n <= 0.95 * limits[scheme][0]
    ]
    runs = {point: loaded(model, number, *point, duration) for point in points}
    for _ in range(2):
        times = {p: min(times.get(p, math.inf), runs[p][1], loaded(model, number, *p, duration)[1]) for p in points}
    stable = {scheme: stable_loaded(runs, scheme, references[scheme]) for scheme in SCHEMES}
    for scheme, n in points:
        trace = runs[scheme, n][0]
        found.append(
            {
                "level": level,
                "scheme": scheme,
                "h_s": STEP / n,
                "drift": drift(free, number, scheme, STEP / n, starts),
                "te_error": error(trace, references[scheme], 0),
                "force_error": error(trace, references[scheme], 1),
                "time_per_second": times[scheme, n],
                "stable_predicted_s": limits[scheme][0],
                "stable_measured_s": limits[scheme][1],
                "stable_loaded_predicted_s": limits[scheme][2],
                "stable_loaded_s": stable[scheme],
            }
        )
        line = found[-1]
        print(
            f"{level:9} {scheme:8} {1e6 * line['h_s']:6.3f} µs  drift {line['drift']:.1e}  TE {line['te_error']:.2%}  "
            f"force {line['force_error']:.2%}  {line['time_per_second']:.3f} s/s  stable to "
            f"{1e6 * line['stable_predicted_s']:.2f} µs predicted, {1e6 * line['stable_measured_s']:.2f} µs measured, "
            f"loaded {1e6 * line['stable_loaded_predicted_s']:.2f} µs predicted, {1e6 * line['stable_loaded_s']:.2f} "
            "µs the largest here",
            flush=True,
        )
    return found


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--levels", nargs="+", default=["fast", "standard", "full"], choices=LEVELS)
    parser.add_argument("--starts", type=int, default=5)
    parser.add_argument("--duration", type=float, default=0.03)
    parser.add_argument("--out", type=Path, default=Path(__file__).with_suffix(".csv"))
    chosen = parser.parse_args()
    spec = load_stage("fzg_c/stage_relief")
    bodies = load_bodies(spec)
    models = assemble(spec, bodies), free_pair(spec, bodies)
    lines = [line for level in chosen.levels for line in rows(models, level, chosen.starts, chosen.duration)]
    write_columns(chosen.out, {column: np.array([line[column] for line in lines]) for column in COLUMNS})


if __name__ == "__main__":
    sys.exit(main())
