"""Phase profile of the internal step: share and processor cycles of each phase, for every level, on the loaded pair (302 N·m, 2000 rpm, 5 slices).

    python benchmarks/phases.py

Builds the kernel with -DGK_PROFILE into a temporary folder; the product's library has no clock in it. Prints a table and writes benchmarks/phases.csv.
"""
from __future__ import annotations

import csv
import math
import statistics
import tempfile
from itertools import pairwise
from pathlib import Path

from gearfmu.body import load_body
from gearfmu.kernel import Kernel
from gearfmu.kernel.build import build_library
from gearfmu.spec.library import model_folder
from gearfmu.spec.stage import load_stage
from gearfmu.stage import Steady, assemble

STEP, BLOCK, DURATION, TORQUE, SPEED = 1e-4, 10, 0.05, 302.0, 2000 * math.pi / 30


def quiet(blocks: list[tuple[float, dict[str, int]]]) -> dict[str, float]:
    """Cycles a step of each phase: median over the blocks, of (steps, cycles) counted from the start, but for the first,
    in which the tables of the step are made; so neither that nor what else ran on the machine counts."""
    found = [{phase: (after[phase] - before[phase]) / (n - m) for phase in after} for (m, before), (n, after) in pairwise(blocks[1:])]
    return {phase: statistics.median(block[phase] for block in found) for phase in found[0]}


def profile(library: Path) -> list[dict[str, object]]:
    """One row a level and phase."""
    spec = load_stage("fzg_c/stage_relief")
    model = assemble(spec, [load_body(model_folder(spec) / f"{gear.name}.h5") for gear in spec.gears])
    inputs = Steady(model, SPEED, TORQUE)
    rows = []
    for level, name in enumerate(("rigid", "fast", "standard", "full")):
        kernel = Kernel(model.blob, {"level": level}, library)
        for variable, value in inputs(0.0).items():
            kernel.set(variable, value)
        kernel.initialize()
        blocks = []
        for i in range(round(DURATION / STEP)):
            if i % BLOCK == 0:
                blocks.append((kernel.get("solver.steps"), kernel.profile()))
            for variable, value in inputs(i * STEP).items():
                kernel.set(variable, value)
            kernel.step(i * STEP, STEP)
        cycles, steps = quiet(blocks), kernel.get("solver.steps")
        rows += [{"level": name, "phase": phase, "cycles_per_step": round(value), "share": round(value / sum(cycles.values()), 4),
                  "n_dyn": int(kernel.get("solver.n_dyn")), "h_s": kernel.get("solver.h"), "rounds": round(kernel.get("solver.rounds") / steps, 3)}
                 for phase, value in cycles.items()]
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        table = profile(build_library(out=Path(folder) / "profiled.so", compiler=("cc", "-DGK_PROFILE")))
    with open(Path(__file__).with_suffix(".csv"), "w", newline="") as file:
        writer = csv.DictWriter(file, table[0])
        writer.writeheader()
        writer.writerows(table)
    for row in table:
        print(f"{row['level']:9s} {row['phase']:9s} {row['cycles_per_step']:7d} cycles a step  {row['share']:6.1%}   h {1e6 * row['h_s']:.2f} µs, {row['n_dyn']} modes")
