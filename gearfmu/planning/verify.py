"""Spot checks of a planned run: the full model takes over a state of the run, settles, and is compared with what the
run did over the same window."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearfmu.cosim.coupled import CoupledRun
from gearfmu.cosim.scene_run import coupled_run
from gearfmu.cosim.source import Source
from gearfmu.errors import SimulationError
from gearfmu.planning.book import Plan, Segment
from gearfmu.planning.choice import space
from gearfmu.planning.judge import FAILED, Signals, error
from gearfmu.planning.request import request_of
from gearfmu.spec.scene import SceneSpec
from gearfmu.stage import StageModel, Trace

CHECKS = 2  # a segment
LATE = 6e-3  # s: a check begins at the end of a leg


@dataclass(frozen=True)
class Check:
    """segment; start, s; error of the plan, budgets; allowed: 1 and the noise of the full model; kept."""

    segment: str
    start: float
    error: float
    allowed: float
    kept: bool


class SpotChecks:
    """CHECKS windows a segment, made while the run goes on and judged when it is over."""

    def __init__(self, plan: Plan, scene: SceneSpec, model: StageModel) -> None:
        self.scene, self.model, self.asked = scene, model, request_of(scene, model, plan.request)
        self.full = space(scene, model).full
        self.due = {segment.name: list(_starts(segment)) for segment in plan.segments}
        self.made: list[tuple[Segment, float, Trace | None]] = []

    def look(self, run: CoupledRun, segment: Segment) -> None:
        """Run the full model over a window that is due now."""
        due = self.due[segment.name]
        if due and run.time >= due[0] - segment.settle - 1e-9:
            due.pop(0)
            start = run.at + round(segment.settle / self.scene.coupling.step)
            self.made.append((segment, start * self.scene.coupling.step, self._full(run, start, segment.window)))

    def _full(self, run: CoupledRun, start: int, window: float) -> Trace | None:
        """The window of the full model from the state of the run; None where it fails."""
        scene = self.scene.model_copy(update={"record": tuple(self.asked.channels)})
        full = coupled_run(self.full.of(scene), Source(self.model))
        last = start + round(window / scene.coupling.step)
        try:
            full.take_over(run)
            full.new_recorder(start - full.at)
            full.advance(start)
            full.new_recorder(last - start)
            full.record()
            full.advance(last)
        except SimulationError:
            return None
        return full.recorder.trace({})

    def checks(self, trace: Trace) -> Iterator[Check]:
        """Every window that the run went through."""
        for segment, start, full in self.made:
            allowed = 1.0 + segment.noise
            far = FAILED if full is None else self._distance(trace, full)
            yield Check(segment.name, start, far, allowed, far <= allowed)

    def _distance(self, trace: Trace, full: Trace) -> float:
        step = self.scene.coupling.step
        part = trace.window(full.time[0] - 0.1 * step, full.time[-1] + 0.1 * step)
        return error(self._signals(part), self._signals(full), self.asked).whole

    def _signals(self, part: Trace) -> Signals:
        values = {o.name: np.sum([f * part[name] for name, f in o.channels], axis=0) for o in self.asked.outputs}
        return Signals(values, self.scene.coupling.step)


def _starts(segment: Segment) -> Iterator[float]:
    """Whole within the segment, behind the planning window; one at its end where there is no room behind."""
    first, last = segment.window_start + segment.window + segment.settle, segment.end - segment.window - LATE
    if first > last > segment.window_start:
        yield last
    for k in range(CHECKS):
        if last >= first:
            yield first + (last - first) * k / max(1, CHECKS - 1)
