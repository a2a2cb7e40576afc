"""Which points a study measures: the lines of the chart and the steps along them."""

from __future__ import annotations

from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.bench import Point

STEPS = (20e-6, 14.2e-6, 10e-6, 7.5e-6, 6.7e-6, 5e-6, 3.4e-6, 2.5e-6, 1.25e-6)  # s
SLICES = (1, 3, 5, 10)
SLICED = ("fast", "full")
QUICK_STEPS = (10e-6, 5e-6)
QUICK_SETTLE, QUICK_DURATION = 0.01, 0.03  # s
SET_SETTLE, SET_DURATION = 5e-3, 15e-3  # s: a step of a planetary set costs some 200 µs
RK45_OUTER = 1.25e-6  # s: rk45 records the mean force from samples this far apart; it limits no step of its own


def fitting(step: float, wished: float) -> float:
    """The internal step (s) taken for a wish: the communication step over a whole number."""
    return step / max(1, -int(-step // (wished * (1.0 + 1e-9))))


def base_point(scene: SceneSpec) -> Point:
    """What costs are compared with: level fast at its default step, with the scene's slices."""
    return Point("fast", slices=scene.stage.slices)


def points(scene: SceneSpec, quick: bool = False) -> list[Point]:
    """All points of a scene, the scene's slices first. Default steps (h = 0) are among them for every level."""
    own = scene.stage.slices
    wishes = QUICK_STEPS if quick else STEPS
    steps = sorted({fitting(scene.coupling.step, h) for h in wishes}, reverse=True)
    found = [Point(level, h=h, slices=own) for level in LEVELS for h in (0.0, *steps)]
    if scene.chain_in_fmu or of_set(scene):  # rk45 knows no clutch on the stage's port
        found += [Point("paper", slices=own)]
    else:
        found += [Point("paper", h=RK45_OUTER, slices=own), Point("full", "rk45", RK45_OUTER, own)]
    others = [count for count in SLICES if count != own]
    if not quick:
        found += [Point(level, h=h, slices=count) for count in others for level in SLICED for h in (0.0, *steps)]
    return found


def of_set(scene: SceneSpec) -> bool:
    """Whether the scene's stage has a carrier."""
    return bool(load_stage(scene.stage.name).carriers)


def window(scene: SceneSpec, quick: bool = False) -> SceneSpec:
    """The part of the scene that is run: all of it, of a planetary set its first milliseconds; quick: a short window,
    for tests and a first look."""
    settle, duration = (SET_SETTLE, SET_DURATION) if of_set(scene) else (scene.settle, scene.duration)
    if quick:
        settle, duration = (0.2 * settle, 0.2 * duration) if of_set(scene) else (QUICK_SETTLE, QUICK_DURATION)
    update = {"settle": min(scene.settle, settle), "duration": min(scene.duration, duration)}
    return scene.model_copy(update=update)
