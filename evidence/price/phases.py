"""Phase profile of the internal step: share and processor cycles of each phase. On the loaded pair at every level (302
N·m, 2000 rpm, 5 slices); at level fast on a train, a planetary set, a helical pair without and with friction.

    python -m evidence.price.phases [SCENE …]

Builds the kernel with -DGK_PROFILE into a temporary folder; the product's library has no clock in it. Beside the
cycles of the pair the arithmetic that the phase cannot do without and the bytes that it reads and writes, counted from
the sizes of the model (`work`). `pass`: what engagements of an island do to each other. Prints a table and writes
evidence/price/phases.csv; with SCENE only the rows of these are made again.
"""

from __future__ import annotations

import csv
import math
import statistics
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from evidence.price.counted import SET_START, SET_TORQUES
from gearfmu.body import load_bodies
from gearfmu.kernel import Kernel
from gearfmu.kernel.build import build_library
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stage.assembly.blob import read_blob
from gearfmu.stagefile.stage import load_stage

STEP, BLOCK, BLOCKS = 1e-4, 10, 50
PAIRS = 2  # tooth pairs within reach, nearly always
LEVELS = ("rigid", "fast", "standard", "full")
TABLE = Path(__file__).with_suffix(".csv")


@dataclass(frozen=True)
class Scene:
    """A stage under a steady load: speed (rad/s) and torque (N·m) of its input, or torques by name."""

    stage: str
    speed: float = 0.0
    torque: float = 0.0
    torques: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    levels: tuple[str, ...] = ("fast",)
    blocks: int = BLOCKS


SCENES = {
    "pair": Scene("fzg_c/stage_relief", 2000 * math.pi / 30, 302.0, levels=LEVELS),
    "train": Scene("two_stage", 150.0, 100.0),
    "set": Scene("planetary54", torques=SET_TORQUES, parameters=SET_START, blocks=10),
    "helical": Scene("helical_demo", 150.0, 150.0, parameters={"effect.friction": 0.0}),
    "helical, friction": Scene("helical_demo", 150.0, 150.0, parameters={"effect.friction": 1.0}),
}


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


def run(kernel: Kernel, scene: Scene, model: StageModel) -> dict[str, float]:
    """Cycles a step of each phase."""
    inputs = None if scene.torques else Steady(model, scene.speed, scene.torque, parameters=scene.parameters)
    for name, value in (inputs(0.0) if inputs else scene.torques).items():
        kernel.set(name, value)
    kernel.initialize()
    blocks = []
    for i in range(BLOCK * scene.blocks):
        if i % BLOCK == 0:
            blocks.append((kernel.get("solver.steps"), kernel.profile()))
        for name, value in (inputs(i * STEP) if inputs else {}).items():
            kernel.set(name, value)
        kernel.step(i * STEP, STEP)
    return quiet(blocks)


def profile(name: str, library: Path) -> list[dict[str, object]]:
    """One row a level and phase of a scene."""
    scene = SCENES[name]
    spec = load_stage(scene.stage)
    model, rows = assemble(spec, load_bodies(spec)), []
    for level in scene.levels:
        kernel = Kernel(model.blob, {"level": LEVELS.index(level), **scene.parameters}, library)
        cycles, counted = run(kernel, scene, model), {}
        if name == "pair":
            cut = {"rigid": 0.0, "fast": spec.levels.fast_cut, "standard": spec.levels.standard_cut}
            strips = (spec.written.contact.slices + 1) // 2
            counted = work(lanes(model, cut.get(level, math.inf)), PAIRS, strips)
        rows += [
            {
                "scene": name,
                "level": level,
                "phase": phase,
                "cycles_per_step": round(value),
                "share": round(value / sum(cycles.values()), 4),
                "n_dyn": int(kernel.get("solver.n_dyn")),
                "h_s": kernel.get("solver.h"),
                "iterations": round(kernel.get("solver.iterations") / kernel.get("solver.steps"), 3),
                "flops": round(counted.get(phase, (0, 0))[0]),
                "bytes": round(counted.get(phase, (0, 0))[1]),
            }
            for phase, value in cycles.items()
        ]
    return rows


def main(scenes: list[str]) -> None:
    """Measure, print, write the table."""
    table: list[dict[str, object]] = []
    with TABLE.open(newline="", encoding="utf-8") as file:
        known = list(csv.DictReader(file))
    with tempfile.TemporaryDirectory() as folder:
        library = build_library(out=Path(folder) / "profiled.so", compiler=("cc", "-DGK_PROFILE"))
        for name in SCENES:
            found = profile(name, library) if name in (scenes or SCENES) else []
            table += found or [row for row in known if row["scene"] == name]
            for row in found:
                print(
                    f"{row['scene']:18s} {row['level']:9s} {row['phase']:9s} {row['cycles_per_step']:8d} cycles a step"
                    f"  {row['share']:6.1%}  {row['flops']:7d} flop {row['bytes']:7d} B   h {1e6 * row['h_s']:.2f} µs, "
                    f"{row['n_dyn']} modes"
                )
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, table[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)


if __name__ == "__main__":
    main(sys.argv[1:])
