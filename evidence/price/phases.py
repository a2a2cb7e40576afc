"""Phase profile of the internal step: share and processor cycles of each phase, for every level, on the loaded pair
(302 N·m, 2000 rpm, 5 slices).

    python -m evidence.price.phases

Builds the kernel with -DGK_PROFILE into a temporary folder; the product's library has no clock in it. Beside the
cycles the arithmetic that the phase cannot do without and the bytes that it reads and writes, counted from the sizes
of the model (`work`). Prints a table and writes evidence/price/phases.csv.
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
from gearfmu.spec.reading.library import model_folder
from gearfmu.spec.stage import load_stage
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stage.build.blob import read_blob

STEP, BLOCK, DURATION, TORQUE, SPEED = 1e-4, 10, 0.05, 302.0, 2000 * math.pi / 30
PAIRS = 2  # tooth pairs within reach, nearly always


def quiet(blocks: list[tuple[float, dict[str, int]]]) -> dict[str, float]:
    """Cycles a step of each phase: median over the blocks, of (steps, cycles) counted from the start, but for the
    first, in which the tables of the step are made; so neither that nor what else ran on the machine counts."""
    found = [
        {phase: (after[phase] - before[phase]) / (n - m) for phase in after}
        for (m, before), (n, after) in pairwise(blocks[1:])
    ]
    return {phase: statistics.median(block[phase] for block in found) for phase in found[0]}


def lanes(model: StageModel, cut: float) -> int:
    """Lanes of modal state of both gear groups: a pair is one lane of each half, halves are padded to LANES / 2."""
    total, sections = 0, read_blob(model.blob)
    for gear in (0, 1):
        part = sections[f"member{gear}"][sections[f"omega{gear}"] < 2 * math.pi * cut]
        total += 2 * math.ceil(int((part != 2).sum()) / 8) * 8
    return total


def work(n: int, pairs: int, strips: int) -> dict[str, tuple[float, float]]:
    """(floating-point operations, bytes) a step of the phases that do arithmetic: n lanes of single precision on both
    gears, `pairs` tooth pairs of `strips` contact rows, a row for each port. The ground group is left out.

    predict: eight coefficients, three states. rows: two nodes of both tables. system: what the rows read, D and A by
    block rows from two tables of either gear, two motions of either gear and the spins into both. solve: tangent, its
    factors, two solutions and four products. correct: scatter of two forces, new state, damping."""
    rows = pairs * strips
    m, cells = rows + 2, rows * (rows + 4) / 2
    return {
        "predict": (12 * n, 4 * n * (8 + 3 + 2)),
        "rows": (3 * rows * n, 4 * n * 3 * rows),
        "system": (
            2 * rows * n + cells * (2 * 2 * 6 + 4 * 2 * 4 + 2 * 2 * 2),
            4 * n * rows + cells * (4 * 2 * 2 * 3 + 8 * 2),
        ),
        "solve": (
            2 * m * m * (1 + 3 * strips) + 2 / 3 * m**3 + 2 * 2 * m * m + 4 * 2 * m * m,
            8 * m * m * (3 + 2 + 2 + 4),
        ),
        "correct": (4 * rows * n + 16 * n, 4 * n * (rows + 12)),
    }


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
        cut = {"rigid": 0.0, "fast": spec.levels.fast_cut, "standard": spec.levels.standard_cut, "full": math.inf}[name]
        counted = work(lanes(model, cut), PAIRS, (spec.written.contact.slices + 1) // 2)
        rows += [
            {
                "level": name,
                "phase": phase,
                "cycles_per_step": round(value),
                "share": round(value / sum(cycles.values()), 4),
                "n_dyn": int(kernel.get("solver.n_dyn")),
                "h_s": kernel.get("solver.h"),
                "iterations": round(kernel.get("solver.iterations") / steps, 3),
                "flops": round(counted.get(phase, (0, 0))[0]),
                "bytes": round(counted.get(phase, (0, 0))[1]),
            }
            for phase, value in cycles.items()
        ]
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        table = profile(build_library(out=Path(folder) / "profiled.so", compiler=("cc", "-DGK_PROFILE")))
    with open(Path(__file__).with_suffix(".csv"), "w", newline="") as file:
        writer = csv.DictWriter(file, table[0])
        writer.writeheader()
        writer.writerows(table)
    for row in table:
        print(
            f"{row['level']:9s} {row['phase']:9s} {row['cycles_per_step']:7d} cycles a step  {row['share']:6.1%}  "
            f"{row['flops']:7d} flop {row['bytes']:7d} B   h {1e6 * row['h_s']:.2f} µs, {row['n_dyn']} modes"
        )
