"""A scene run as its plan says: segment by segment, with tripwires.

The run goes in legs. At the end of each the tripwires are read; where one has tripped the leg is forgotten, the run
goes back to where the leg began, takes one communication step as before and goes on with what was missing. Between
segments the state is taken over by the next choice (`CoupledRun.take_over`).
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.cosim.coupled import OK, CoupledRun, Saved
from gearfmu.cosim.scene_run import coupled_run, stage_model
from gearfmu.cosim.source import Source
from gearfmu.errors import SimulationError
from gearfmu.planning.book import Plan, Segment
from gearfmu.planning.choice import Choice
from gearfmu.planning.tripwires import Trip, Wires, answer
from gearfmu.planning.verify import SpotChecks
from gearfmu.report.results import strict
from gearfmu.spec.scene import SceneSpec, load_scene
from gearfmu.spec.turning import meshings
from gearfmu.stage import StageModel, Trace
from gearfmu.stage.trace import Channel

LEG = 5e-3  # s
MOST_TRIPS = 8  # in one leg

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Leg:
    """What a finished leg recorded, and with what."""

    trace: Trace
    choice: Choice


@dataclass
class PlannedRun:
    """The legs of a run, what tripped, and the processor time."""

    legs: list[Leg] = field(default_factory=list)
    trips: list[Trip] = field(default_factory=list)
    outcome: str = OK
    message: str = ""
    cpu: float = 0.0

    def trace(self, meta: dict[str, Any]) -> Trace:
        """All legs as one trace: the first sample of a leg is the last of the one before."""
        parts = [leg.trace for leg in self.legs]
        first = parts[0]
        cut = [slice(None), *[slice(1, None)] * (len(parts) - 1)]
        time = np.concatenate([p.time[c] for p, c in zip(parts, cut, strict=True)])
        channels = {
            name: Channel(
                np.concatenate([p[name][c] for p, c in zip(parts, cut, strict=True)]), about.unit, about.description
            )
            for name, about in first.channels.items()
        }
        return Trace(time, channels, meta)


def planned_scene(plan: Plan) -> SceneSpec:
    """The scene of a plan, with the communication step that was planned for."""
    scene = load_scene(plan.scene)
    coupling = scene.coupling.model_copy(update={"step": plan.step})
    return scene.model_copy(update={"coupling": coupling})


def run_planned(plan: Plan, out: Path | None = None, progress: Progress | None = None, verify: bool = True) -> Trace:
    """Run the scene of the plan by the kernel; the trace's meta "plan" says what was predicted and what happened.

    verify : two spot checks a segment: the full model from states of the run against the plan from the same states.
    """
    scene = planned_scene(plan)
    model = stage_model(scene)
    spots = SpotChecks(plan, scene, model) if verify else None
    done = _Runner(scene, model, plan.segments, spots, progress).go()
    trace = done.trace(_meta(scene, model, done))
    checks = [] if spots is None or done.outcome != OK else [asdict(check) for check in spots.checks(trace)]
    trace.meta["plan"] = strict(asdict(plan) | {"trips": [asdict(trip) for trip in done.trips], "checks": checks})
    if out is not None:
        trace.save(out / "trace.h5")
    return trace


def _meta(scene: SceneSpec, model: StageModel, done: PlannedRun) -> dict[str, Any]:
    end = float(done.legs[-1].trace.time[-1])
    return {
        "scene": scene.name,
        "description": scene.description,
        "stage": scene.stage.name,
        "level": done.legs[-1].choice.level,
        "slices": done.legs[-1].choice.slices,
        "effects_off": list(done.legs[-1].choice.off),
        "H": scene.coupling.step,
        "h": done.legs[-1].choice.h,
        "settle": scene.settle,
        "unit": "kernel",
        "outcome": done.outcome,
        "message": done.message,
        "simulated_s": end,
        "cpu_s": done.cpu,
        "realtime_factor": done.cpu / end if end else None,
        "meshes": {mesh: known.plain for mesh, known in meshings(model.stage).items()},
        "hashes": {"scene": scene.hash, "model": model.hash},
    }


class _Runner:
    """A planned run on its way."""

    def __init__(
        self,
        scene: SceneSpec,
        model: StageModel,
        segments: Sequence[Segment],
        spots: SpotChecks | None,
        progress: Progress | None,
    ) -> None:
        self.scene, self.model, self.segments, self.spots = scene, model, segments, spots
        self.tell = progress or (lambda part: None)
        self.done, self.wires = PlannedRun(), Wires(model)
        self._choice = segments[0].choice
        self.leg = max(1, round(LEG / scene.coupling.step))

    def go(self) -> PlannedRun:
        """Segment by segment to the end, or to where nothing helps any more."""
        run: CoupledRun | None = None
        for number, segment in enumerate(self.segments):
            run = self._start(segment.choice, run)
            last = number == len(self.segments) - 1
            end = self.scene.steps if last else round(segment.end / self.scene.coupling.step)
            run = self._segment(run, segment, end)
            if self.done.outcome != OK:
                break
        return self.done

    def _start(self, choice: Choice, before: CoupledRun | None) -> CoupledRun:
        """A run with this choice: begun, or on from where another stands."""
        if before is not None and self._choice == choice:
            return before
        run = coupled_run(choice.of(self.scene), Source(self.model))
        self._choice = choice
        if before is None:
            run.begin()
        else:
            run.take_over(before)
        return run

    def _segment(self, run: CoupledRun, segment: Segment, end: int) -> CoupledRun:
        for to in self._ends(run.at, end):
            for _ in range(MOST_TRIPS):
                saved, choice = run.save(), self._choice
                trip = self._leg(run, segment, to)
                if trip is None:
                    break
                better = answer(choice, trip, segment)
                if better is None:
                    self.done.outcome, self.done.message = trip.wire, trip.message
                    return run
                self.done.trips.append(replace(trip, answer=better.words))
                run = self._back(run, saved, better)
            else:
                self.done.outcome, self.done.message = "tripwires", f"{MOST_TRIPS} tripwires in one leg"
                return run
            self.tell(run.at / self.scene.steps)
            if self.spots is not None:
                self.spots.look(run, segment)
        return run

    def _ends(self, at: int, end: int) -> Iterator[int]:
        while at < end:
            at = min(at + self.leg, end)
            yield at

    def _leg(self, run: CoupledRun, segment: Segment, to: int) -> Trip | None:
        """The leg, kept when no wire trips."""
        run.new_recorder(to - run.at)
        run.record()
        started = clock.process_time()
        try:
            run.advance(to)
        except SimulationError as error:
            return Trip(segment.name, run.time, error.outcome, str(error))
        finally:
            self.done.cpu += clock.process_time() - started
        trace = run.recorder.trace({})
        trip = self.wires.look(trace, segment, self._choice)
        if trip is None:
            self.done.legs.append(Leg(trace, self._choice))
        return trip

    def _back(self, run: CoupledRun, saved: Saved, choice: Choice) -> CoupledRun:
        """Back to the start of the leg; what was recorded of its first step is kept, then the choice changes."""
        run.restore(saved)
        run.new_recorder(1)
        run.record()
        run.advance(run.at + 1)
        self.done.legs.append(Leg(run.recorder.trace({}), self._choice))
        return self._start(choice, run)
