"""A scene run as its plan says: segment by segment, with tripwires and spot checks.

The run goes in legs. At the end of each the tripwires are read; where one has tripped the leg is forgotten, the run
goes back to where the leg began and on with what was missing. Where a spot check is missed the run goes back to where
the check began, and on with a richer set that keeps the budget from that state. Between segments the state is taken
over by the next choice (`CoupledRun.take_over`; planning/road.py).
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.cosim.coupled import OK, CoupledRun, Saved
from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.scene_run import Staged, origin, stage_model, stage_source, subject
from gearfmu.errors import Problem, SimulationError, SpecError
from gearfmu.planning.book import Plan, Segment
from gearfmu.planning.choice import Choice
from gearfmu.planning.road import Road
from gearfmu.planning.tripwires import Trip, Wires, answer
from gearfmu.planning.verify import Check, Mark, Spot, SpotChecks
from gearfmu.report.results import strict
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stage import Trace
from gearfmu.stage.run.trace import Channel

LEG = 5e-3  # s
OF_SCENE = ("scene", "description", "stage", "H", "settle", "unit", "meshes")  # of a run's `subject`
UNITS = ("kernel", "fmu")
MOST_TRIPS = 8  # in one leg
MOST_REPLANS = 3  # in one segment

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Leg:
    """What a finished leg recorded, and with what."""

    trace: Trace
    choice: Choice


@dataclass
class PlannedRun:
    """The legs of a run, what tripped, what was checked, and the processor time."""

    legs: list[Leg] = field(default_factory=list)
    trips: list[Trip] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
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
    return load_scene(plan.scene).with_coupling(step=plan.step)


def planned_stage(plan: Plan, fmu: Path | None = None) -> Staged:
    """The stage of a plan in its scene; with an FMU, the FMU's. SpecError for an FMU of another model than the plan was
    made for: its effects and errors were measured with that."""
    scene = planned_scene(plan)
    if fmu is None:
        return Staged.of(scene)
    staged = Staged.of_fmu(scene, fmu)
    if staged.model.hash != (plan.model or stage_model(scene).hash):
        remedy = f"the plan of {plan.scene} was made for another model: take `gearfmu export --scene {plan.scene}`"
        raise SpecError([Problem(str(fmu), f"stage {staged.model.name}", staged.model.hash[:12], remedy)])
    return staged


def run_planned(
    plan: Plan,
    out: Path | None = None,
    progress: Progress | None = None,
    verify: bool = True,
    unit: str | Path = "kernel",
) -> Trace:
    """Run the scene of the plan; the trace's meta "plan" says what was predicted and what happened.

    verify : two spot checks a segment: the full model from states of the run against the plan from the same states.
    unit : "kernel", "fmu" (exported into `out`) or the path of an FMU exported earlier.
    """
    staged = planned_stage(plan, None if unit in UNITS else Path(unit))
    with stage_source(staged, "fmu" if staged.fmu is not None else str(unit), out) as source:
        road = Road(staged.scene, staged.model, source.fmu_path)
        done = _Runner(road, plan.segments, SpotChecks(plan, road, verify), progress).go()
        trace = done.trace(_meta(road, done) | origin(staged))
    events = {name: [asdict(item) for item in getattr(done, name)] for name in ("trips", "checks")}
    trace.meta["plan"] = strict(asdict(plan) | events)
    if out is not None:
        trace.save(out / "trace.h5")
    return trace


def _meta(road: Road, done: PlannedRun) -> dict[str, Any]:
    of_scene, last = subject(road.scene, Source(road.model, road.fmu)), done.legs[-1]
    end = float(last.trace.time[-1])
    return {name: of_scene[name] for name in OF_SCENE} | {
        "level": last.choice.level,
        "slices": last.choice.slices,
        "effects_off": list(last.choice.off),
        "h": last.choice.h,
        "outcome": done.outcome,
        "message": done.message,
        "simulated_s": end,
        "cpu_s": done.cpu,
        "realtime_factor": done.cpu / end if end else None,
        "hashes": {"scene": road.scene.hash, "model": road.model.hash},
    }


class _Runner:
    """A planned run on its way. before: where it stood one communication step before the end of the last leg."""

    def __init__(self, road: Road, segments: Sequence[Segment], spots: SpotChecks, progress: Progress | None) -> None:
        self.road, self.segments, self.spots = road, segments, spots
        self.tell = progress or (lambda part: None)
        self.done, self.wires = PlannedRun(), Wires(road.model)
        self.step, self.steps = road.scene.coupling.step, road.scene.steps
        self.leg = max(1, round(LEG / self.step))
        self._choice = segments[0].choice
        self._before: Saved | None = None

    def go(self) -> PlannedRun:
        """Segment by segment to the end, or to where nothing helps any more."""
        run = self.road.begin(self._choice)
        try:
            for number, segment in enumerate(self.segments):
                if self._choice != segment.choice:
                    run = self._change(run, segment.choice)
                last = number == len(self.segments) - 1
                run = self._segment(run, segment, self.steps if last else round(segment.end / self.step))
                if self.done.outcome != OK:
                    break
            self._rest()
        finally:
            run.cut.stage.close()
        return self.done

    def _change(self, run: CoupledRun, choice: Choice) -> CoupledRun:
        """On with another choice from the end of the last leg, which the run may have left."""
        run.cut.stage.close()
        if self._before is None:
            run = self.road.begin(choice)
        else:
            run = self.road.change(choice, self.road.again(self._choice, self._before))
        self._choice = choice
        return run

    def _segment(self, run: CoupledRun, segment: Segment, end: int) -> CoupledRun:
        replans = 0
        while run.at < end:
            run = self._one_leg(run, segment, min(run.at + self.leg, end))
            if self.done.outcome != OK:
                return run
            self.tell(run.at / self.steps)
            for spot, check in self._checked(run, segment):
                better = None if check.kept or replans == MOST_REPLANS else self.spots.better(spot, self._choice)
                self.done.checks.append(check if better is None else replace(check, answer=better.words))
                if better is not None:
                    replans += 1
                    run, segment = self._back_to(run, spot, better), replace(segment, choice=better)
        return run

    def _one_leg(self, run: CoupledRun, segment: Segment, to: int) -> CoupledRun:
        """The leg up to step `to`, begun anew with what was missing as long as a wire trips."""
        for _ in range(MOST_TRIPS):
            trip = self._leg(run, segment, to)
            if trip is None:
                return run
            better = answer(self._choice, trip, segment)
            if better is None:
                self.done.outcome, self.done.message = trip.wire, trip.message
                return run
            self.done.trips.append(replace(trip, answer=better.words))
            run = self._change(run, better)
        self.done.outcome, self.done.message = "tripwires", f"{MOST_TRIPS} tripwires in one leg"
        return run

    def _leg(self, run: CoupledRun, segment: Segment, to: int) -> Trip | None:
        """The leg, kept when no wire trips."""
        run.new_recorder(to - run.at)
        run.record()
        started = clock.process_time()
        try:
            run.advance(to - 1)
            before = self.road.keep(run)
            run.advance(to)
        except SimulationError as error:
            return Trip(segment.name, run.time, error.outcome, str(error))
        finally:
            self.done.cpu += clock.process_time() - started
        trace = run.recorder.trace({})
        trip = self.wires.look(trace, segment, self._choice)
        if trip is None:
            self.done.legs.append(Leg(trace, self._choice))
            self._before = before
        return trip

    # -- spot checks ---------------------------------------------------------------------------------------------------
    def _checked(self, run: CoupledRun, segment: Segment) -> Iterator[tuple[Spot, Check]]:
        """Checks begin that are due; one whose window is over is judged."""
        assert self._before is not None, "a leg was kept"
        self.spots.look(run.at, segment, Mark(self._choice, self._before, len(self.done.legs)))
        spot = self.spots.over(run.at)
        if spot is not None:
            check = self.spots.judged(spot, self.done.trace({}))
            self.spots.done(spot)
            yield spot, check

    def _back_to(self, run: CoupledRun, spot: Spot, better: Choice) -> CoupledRun:
        """Back to where a check began, on with a richer set; the same window is checked again."""
        self.spots.back_to(spot)
        self.spots.begun.insert(0, spot)
        del self.done.legs[spot.mark.legs :]
        self._choice, self._before = spot.mark.choice, spot.mark.before
        return self._change(run, better)

    def _rest(self) -> None:
        """Checks of a run that came to its end and were not looked at yet: told, and no more."""
        while self.done.outcome == OK and (spot := self.spots.over(self.steps)) is not None:
            self.done.checks.append(self.spots.judged(spot, self.done.trace({})))
            self.spots.done(spot)
