"""Which points a study measures: the lines of the chart and the steps along them."""

from __future__ import annotations

from gearfmu.spec.scene import SceneSpec
from gearfmu.stage.build.levels import LEVELS
from gearfmu.study.bench import Point

STEPS = (20e-6, 14.2e-6, 10e-6, 7.5e-6, 6.7e-6, 5e-6, 3.4e-6, 2.5e-6, 1.25e-6)  # s
SLICES = (1, 3, 5, 10)
SLICED = ("fast", "full")
QUICK_STEPS = (10e-6, 5e-6)
QUICK_SETTLE, QUICK_DURATION = 0.01, 0.03  # s
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
    if has_clutch(scene):
        found += [Point("paper", slices=own)]
    else:
        found += [Point("paper", h=RK45_OUTER, slices=own), Point("full", "rk45", RK45_OUTER, own)]
    others = [count for count in SLICES if count != own]
    if not quick:
        found += [Point(level, h=h, slices=count) for count in others for level in SLICED for h in (0.0, *steps)]
    return found


def has_clutch(scene: SceneSpec) -> bool:
    """Whether a clutch hangs on the stage's port: rk45 does not know it."""
    return scene.passenger_car is not None and scene.passenger_car.chain_in_fmu


def quick_scene(scene: SceneSpec) -> SceneSpec:
    """A short window of the scene, for tests and a first look."""
    settle = min(scene.settle, QUICK_SETTLE)
    return scene.model_copy(update={"settle": settle, "duration": min(scene.duration, QUICK_DURATION)})
