"""What a larger internal step does: default step by its rule, γ lowered with a warning, refusal with the step to
use."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from gearfmu.errors import ModelError
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.study.bench import Point, Run, measure, models_for
from gearfmu.study.norm import Errors, errors

COMMUNICATION = 120e-6  # s: the kernel takes no step beyond a communication step
COUNTS = (240, 120, 80, 60, 48, 40, 32, 24, 20, 16, 12, 10, 8, 6, 5, 4, 3, 2, 1)  # internal steps in one of those
REFERENCE_COUNT = 480
GAMMA_LOWERED = 8  # bit of solver.status


@dataclass(frozen=True)
class LimitRow:
    """One step of one level. kind: below, default, above, or refused; gamma_lowered: μ′ would exceed ½; gamma: where
    the kernel tells it (below 0.7), else 1 or NaN; errors against the same level with a quarter of a microsecond;
    message: the kernel's."""

    scene: str
    level: str
    h_s: float
    kind: str
    gamma_lowered: bool
    gamma: float
    outcome: str
    te_error: float
    force_error: float
    message: str


def limit_rows(
    scene: SceneSpec,
    levels: tuple[str, ...] = LEVELS,
    counts: tuple[int, ...] = COUNTS,
    progress: Callable[..., None] | None = None,
) -> list[LimitRow]:
    """Rows for the levels, from half a microsecond to the first step that is refused."""
    tell, model = progress or (lambda fraction, text="": None), models_for(scene)
    changed = {
        "coupling": scene.coupling.model_copy(update={"step": COMMUNICATION, "micro_step": 0.0}),
        "duration": COMMUNICATION * round(scene.duration / COMMUNICATION),
        "settle": COMMUNICATION * round(scene.settle / COMMUNICATION),
    }
    coarse, rows = scene.model_copy(update=changed), []
    for k, level in enumerate(levels):
        for row in _of_level(coarse, model, level, counts):
            tell(k / len(levels), f"{level}, {1e6 * row.h_s:.3g} µs")
            rows.append(row)
    return rows


def _of_level(scene: SceneSpec, model: StageModel, level: str, counts: tuple[int, ...]) -> Iterator[LimitRow]:
    slices = scene.stage.slices
    reference = measure(scene, model, Point(level, h=COMMUNICATION / REFERENCE_COUNT, slices=slices))
    default = measure(scene, model, Point(level, slices=slices))
    yield _row(scene, default, "default", errors(default.signals, reference.signals))
    for count in counts:
        h = COMMUNICATION / count
        if abs(h - default.h) < 1e-3 * h:
            continue
        try:
            run = measure(scene, model, Point(level, h=h, slices=slices))
        except ModelError as error:
            nan = float("nan")
            yield LimitRow(scene.name, level, h, "refused", True, nan, "refused", nan, nan, str(error))
            return
        yield _row(scene, run, "below" if h < default.h else "above", errors(run.signals, reference.signals))


def _row(scene: SceneSpec, run: Run, kind: str, error: Errors) -> LimitRow:
    lowered = bool(run.status & GAMMA_LOWERED)
    told = re.search(r"gamma lowered to ([\d.]+\d)", run.warning)
    gamma = float(told[1]) if told else float("nan") if lowered else 1.0
    head = (scene.name, run.point.level, run.h, kind, lowered, gamma, run.outcome)
    return LimitRow(*head, error.te, error.force, run.warning)
