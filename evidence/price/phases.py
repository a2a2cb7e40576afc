"""Phase profile of the internal step: share and processor cycles of each phase. On the loaded pair at every level (302
N·m, 2000 rpm, 5 slices); at level fast on a train, a planetary set, a helical pair without and with friction.

    python -m evidence.price.phases

Builds the kernel with -DGK_PROFILE into a temporary folder; the product's library has no clock in it. `pass`: what
engagements of an island do to each other. Prints a table and writes evidence/price/phases.csv.
"""

from __future__ import annotations

import math
import statistics
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import gearfmu
from evidence.price.counted import SET_START, SET_TORQUES
from evidence.tables import told, write_rows
from gearfmu.kernel import Kernel
from gearfmu.kernel.build import build_library
from gearfmu.stage import StageModel, Steady
from gearfmu.stage.assembly.levels import LEVELS

STEP, BLOCK, BLOCKS = 1e-4, 10, 50


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


def profile(name: str, library: Path) -> Iterator[dict[str, object]]:
    """One row a level and phase of a scene."""
    scene = SCENES[name]
    model = gearfmu.assemble(scene.stage)
    for level in scene.levels:
        kernel = Kernel(model.blob, {"level": LEVELS.index(level), **scene.parameters}, library)
        cycles = run(kernel, scene, model)
        for phase, value in cycles.items():
            yield {
                "scene": name,
                "level": level,
                "phase": phase,
                "cycles_per_step": round(value),
                "share": round(value / sum(cycles.values()), 4),
                "n_dyn": int(kernel.get("solver.n_dyn")),
                "h_s": kernel.get("solver.h"),
                "iterations": round(kernel.get("solver.iterations") / kernel.get("solver.steps"), 3),
            }


def main() -> None:
    """Measure, print, write the table."""
    with tempfile.TemporaryDirectory() as folder:
        library = build_library(out=Path(folder) / "profiled.so", compiler=("cc", "-DGK_PROFILE"))
        rows = told(row for name in SCENES for row in profile(name, library))
    write_rows(Path(__file__).with_suffix(".csv"), rows, digits=6)


if __name__ == "__main__":
    main()
