"""What each thing that moves in a turning mesh costs in energy: the balance of a loaded run with one piece held still.

    python evidence/energy_pieces.py [--duration 0.05] [--out evidence/energy_pieces.csv]

Loaded pair, 302 N·m, 2000 rpm, level fast, everything damped as shipped. Left: what energy.residual gained after 10 ms,
over the energy that passed through the pinion's shaft and over what dampers took. Held still, by kernels that
differ in one place: rows and residual (taken at one roll all along the flank), curvature in the local law, both; and,
by parameters, tip corners, load-dependent law, bearings. Changes of h: frozen undamped rattle in which the
communication step alternates, every step between 5 and 7.5 µs, and between 50 and 60 µs (h = 7.14 and 7.5 µs).
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from kernel_variants import double_states, variant  # noqa: E402
from rattling.free import FreePair, Rattle, free_pair, started  # noqa: E402

from gearfmu.body import load_bodies  # noqa: E402
from gearfmu.kernel import Kernel  # noqa: E402
from gearfmu.spec.stage import load_stage  # noqa: E402
from gearfmu.stage import StageModel, Steady, assemble  # noqa: E402
from gearfmu.stage.run.trace import write_columns  # noqa: E402

STEP, SETTLE, LOAD, SPEED, FAST = 60e-6, 0.01, 302.0, 2000 * math.pi / 30, 1
ROWS_STILL = {r"p->roll = corner_roll\(n, p\);": "p->roll = 0.5 * (n->gear->s_form + n->gear->s_tip);"}
CURVATURE_STILL = {r"s->curvature\[n\] = point->curvature;": "s->curvature[n] = 1.0 / 0.007 + 1.0 / 0.009;"}
COLUMNS = (
    "stage",
    "piece",
    "h_s",
    "through_J",
    "work_J",
    "dissipated_J",
    "left_J",
    "left_of_through",
    "left_of_dissipated",
)


def balance(
    model: StageModel, library: Path | None, parameters: Mapping[str, float], duration: float
) -> dict[str, float]:
    """Energies between SETTLE and `duration` (s), J."""
    inputs, kernel = Steady(model, SPEED, LOAD), Kernel(model.blob, {"level": FAST, **parameters}, library)
    for name, value in inputs(0.0).items():
        kernel.set(name, value)
    kernel.initialize()
    names, through, first = ("energy.work", "energy.dissipated", "energy.residual"), 0.0, np.zeros(3)
    for i in range(round(duration / STEP)):
        for name, value in inputs(i * STEP).items():
            kernel.set(name, value)
        kernel.step(i * STEP, STEP)
        if (i + 1) * STEP <= SETTLE:
            first, through = np.array([kernel.get(name) for name in names]), 0.0
        through += abs(kernel.get("pinion.tau_mean")) * SPEED * STEP
    work, lost, left = np.array([kernel.get(name) for name in names]) - first
    return {
        "h_s": kernel.get("solver.h"),
        "through_J": through,
        "work_J": work,
        "dissipated_J": lost,
        "left_J": left,
        "left_of_through": left / through,
        "left_of_dissipated": left / lost,
    }


def changes_of_h(free: FreePair, library: Path | None, steps: tuple[float, float]) -> float:
    """Largest relative change of stored energy over 50 ms of undamped frozen rattle whose communication step alternates
    between two lengths (s); sampled after the first of them."""
    kernel = started(free, Rattle(position=0.3), {"level": FAST, "h": 7.5e-6}, library)
    time, samples = 0.0, []
    while time < 0.05:
        for number, step in enumerate(steps):
            kernel.step(time, step)
            time += step
            if number == 0:
                samples.append(kernel.get("energy.stored"))
    return float(np.ptp(samples) / samples[0])


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--duration", type=float, default=0.05)
    parser.add_argument("--out", type=Path, default=Path(__file__).with_suffix(".csv"))
    chosen = parser.parse_args()
    spec, plain = load_stage("fzg_c/stage_relief"), load_stage("fzg_c")
    bodies = load_bodies(spec)
    relieved, bare = assemble(spec, bodies), assemble(plain, bodies)
    lines = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        double = double_states(folder)
        rows, curvature = (variant(folder, *v) for v in (("rows", ROWS_STILL), ("curvature", CURVATURE_STILL)))
        both = variant(folder, "both", {**ROWS_STILL, **CURVATURE_STILL})
        cases = [(relieved, "all as it is", double, {"h": STEP / n}) for n in (8, 16, 32)]
        cases += [
            (relieved, "rows and residual still", rows, {}),
            (relieved, "curvature still", curvature, {}),
            (relieved, "rows, residual, curvature still", both, {}),
            (relieved, "law linear", double, {"effect.hertz": 0.0}),
            (relieved, "bearings off", double, {"effect.bearings": 0.0}),
            (relieved, "all still, bearings off", both, {"effect.bearings": 0.0}),
            (bare, "tip corners", double, {}),
            (bare, "tip corners, all still", both, {}),
            (bare, "tip corners off", double, {"effect.tip_contact": 0.0}),
        ]
        for model, piece, library, parameters in cases:
            line = {"stage": model.name, "piece": piece, **balance(model, library, parameters, chosen.duration)}
            lines.append(line)
            print(
                f"{line['stage']:13} {piece:32} h {1e6 * line['h_s']:.2f} µs  through {line['through_J']:.0f} J  work "
                f"{line['work_J']:.4f} J  "
                f"dissipated {line['dissipated_J']:.4f} J  left {line['left_J']:+.1e} J = "
                f"{line['left_of_through']:+.1e} of through, "
                f"{line['left_of_dissipated']:+.1%} of the losses",
                flush=True,
            )
        free = free_pair(spec, bodies)
        for steps in ((5e-6, 5e-6), (5e-6, 7.5e-6), (50e-6, 60e-6)):
            changed = changes_of_h(free, double, steps)
            print(
                f"communication steps {1e6 * steps[0]:.0f} and {1e6 * steps[1]:.1f} µs in turn: energy within "
                f"{changed:.1e}"
            )
    write_columns(chosen.out, {column: np.array([line[column] for line in lines]) for column in COLUMNS})


if __name__ == "__main__":
    main()
