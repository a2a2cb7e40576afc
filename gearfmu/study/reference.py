"""The run that others are measured against: all stored modes, the step halved until the halving moves it less than a
fifth of the error of the finest point of the study."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel, Trace
from gearfmu.stage.run.refinement import twice
from gearfmu.stage.run.trace import TraceError
from gearfmu.study.bench import Point, Run, measure
from gearfmu.study.ladder import QUICK_STEPS, STEPS, fitting
from gearfmu.study.norm import Errors, Signals, errors, kept_signals

SHARE = 0.2
FINEST = 0.2e-6  # s: the smallest step of a reference; every shipped scene has one at 0.208 µs
FIRST = 3  # first reference: the finest step of the study over this


@dataclass(frozen=True)
class Reference:
    """Signals at step h (s); moved: distance to the run with twice the step; finest: error of the finest point of
    level full; reached: whether that moved by less than a fifth of it."""

    signals: Signals
    h: float
    n_dyn: int
    moved: Errors
    finest: Errors

    @property
    def reached(self) -> bool:
        return self.moved.below(SHARE, self.finest)


def make_reference(scene: SceneSpec, model: StageModel, slices: int, quick: bool = False) -> Reference:
    """Run the scene with ever smaller steps until `reached`, or at most to FINEST; a helical stage with twice the
    slices."""
    slices = twice(model.stage, slices)

    def run(h: float) -> Run:
        return measure(scene, model, Point("full", h=h, slices=slices))

    h = fitting(scene.coupling.step, min(QUICK_STEPS if quick else STEPS))
    finest, h = run(h).signals, h / FIRST
    coarse = run(h).signals
    while True:
        h /= 2
        made = run(h)
        found = Reference(made.signals, h, made.n_dyn, errors(coarse, made.signals), errors(finest, made.signals))
        if found.reached or h / 2 < FINEST:
            return found
        coarse = made.signals


def kept_reference(path: Path, identity: str) -> Reference | None:
    """The reference in a file, when it is there and of this identity."""
    try:
        trace = Trace.load(path)
    except TraceError:
        return None
    meta = trace.meta
    if meta.get("identity") != identity:
        return None
    parts = {name: Errors(**meta[name]) for name in ("moved", "finest")}
    return Reference(kept_signals(trace), meta["h"], meta["n_dyn"], **parts)


def keep_reference(reference: Reference, path: Path, identity: str) -> None:
    """Write it, for a study that goes on later."""
    parts = {name: vars(getattr(reference, name)) for name in ("moved", "finest")}
    reference.signals.trace({"identity": identity, "h": reference.h, "n_dyn": reference.n_dyn, **parts}).save(path)
