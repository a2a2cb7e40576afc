"""One coupled run: a master steps a stage and a drivetrain to the end of a scene, or to the last good time.

Chosen outputs of both sides are recorded at every communication point, in the units' own logs."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any, cast

import numpy as np

from gearfmu.cosim.frames import FramePlan, FrameRecorder
from gearfmu.cosim.kernel_unit import KernelUnit
from gearfmu.cosim.masters import Cut, Master, master
from gearfmu.cosim.units import Log, Recorded, Unit, Variable
from gearfmu.errors import CouplingError, FmuError, ModelError, SimulationError
from gearfmu.stage.run.trace import Channel, Trace

OK = "ok"
STOPPED = "stopped"  # a call was refused: the message says which
Progress = Callable[[float], None]


@dataclass(frozen=True)
class Plan:
    """How a cut is stepped: master, communication step H in s, number of steps, what to record and what of it to leave
    out; progress is told the done fraction; frames: of moving gears, None: none."""

    master: str
    step: float
    steps: int
    record: tuple[str, ...] = ("*",)
    progress: Progress | None = None
    omit: tuple[str, ...] = ()
    frames: FramePlan | None = None


@dataclass(frozen=True)
class Result:
    """Trace up to the last good time, how the run ended, and its cost: CPU time of the whole loop and its share in the
    stage's steps.

    work, throughput : J at the cut, on the drivetrain: signed sum and sum of magnitudes. frames : None where none were
    planned.
    """

    trace: Trace
    outcome: str
    message: str
    cpu_s: float
    stage_cpu_s: float
    work: float
    throughput: float
    order: int
    facts: dict[str, float] = field(default_factory=dict)
    frames: FrameRecorder | None = None

    @property
    def energy_residual(self) -> float | None:
        """Work that one side of the cut gave and the other did not get, over the exchanged work; None when the stage
        does not tell its work."""
        work = self.facts.get("energy.work")
        return None if work is None or not self.throughput else (self.work + work) / self.throughput


def run_coupled(cut: Cut, plan: Plan) -> Result:
    """Run to the end, or until a unit fails: then the outcome has a name and the trace ends at the last good
    communication point. A failure before the first point is raised as it is."""
    timed = _Timed(cut.stage)
    coupled = CoupledRun(replace(cut, stage=cast(Unit, timed)), plan)
    outcome, message, started, wall = OK, "", clock.process_time(), clock.perf_counter()
    try:
        coupled.go()
    except (SimulationError, FmuError, ModelError, CouplingError) as error:
        if not coupled.recorder.count:
            raise
        outcome, message = getattr(error, "outcome", STOPPED), str(error)
    facts, trace, order = coupled.facts(), coupled.recorder.trace({}), coupled.master.order
    cpu, share = clock.process_time() - started, timed.seconds / (clock.perf_counter() - wall)
    return Result(trace, outcome, message, cpu, cpu * share, *cut.drive.exchanged, order, facts, coupled.frames)


SOLVER_FACTS = ("n_dyn", "h", "retried_steps", "steps", "status")
FACTS = ("energy.work", "energy.residual", *(f"solver.{name}" for name in SOLVER_FACTS))


class _Timed:
    """A unit whose steps are timed, by the wall clock: asking for CPU time costs as much as a short step."""

    def __init__(self, unit: Unit) -> None:
        self.unit, self.seconds = unit, 0.0
        for name in ("outputs", "initialize", "resolve", "set", "get", "log", "save", "restore"):
            setattr(self, name, getattr(unit, name))

    def step(self, time: float, h: float) -> None:
        started = clock.perf_counter()
        self.unit.step(time, h)
        self.seconds += clock.perf_counter() - started


@dataclass(frozen=True)
class Saved:
    """Where a coupled run stands: step number, state of the stage, of the drivetrain."""

    at: int
    stage: Any
    drive: Any


class CoupledRun:
    """A run that is stepped piece by piece: begun or taken over from another, saved and restored at communication
    points. `at`: number of the step that comes next."""

    def __init__(self, cut: Cut, plan: Plan) -> None:
        self.cut, self.plan, self.at = cut, plan, 0
        self.master: Master = master(plan.master, cut)
        self.new_recorder(plan.steps)
        self.frames = None if plan.frames is None else FrameRecorder(cut.stage, plan.frames)
        known = cut.stage.outputs()
        self._fact_names = [name for name in FACTS if name in known]
        self._facts: Any = cut.stage.resolve(self._fact_names)

    def new_recorder(self, steps: int) -> None:
        """Record anew from here, at most `steps` steps and the point they begin at."""
        frames, plan = self.plan.frames, self.plan
        omit = plan.omit if frames is None else (*plan.omit, *frames.patterns)
        self.recorder = Recorder(self.cut.stage, self.cut.drive, plan.record, steps + 1, omit)

    @property
    def time(self) -> float:
        """s, n·H."""
        return self.at * self.plan.step

    def go(self) -> None:
        """From the start to the end."""
        self.begin()
        self.advance(self.plan.steps)

    def begin(self) -> None:
        """Initialise both sides and record the start."""
        self.master.begin(0.0)
        self.record()

    def advance(self, to: int) -> None:
        """Every communication step up to number `to`."""
        h, tell = self.plan.step, max(1, self.plan.steps // 200)
        while self.at < to:
            self.master.step(self.at * h, h)
            self.at += 1
            self.record()
            if self.plan.progress and self.at % tell == 0:
                self.plan.progress(self.at / self.plan.steps)

    def window(self, first: int, last: int) -> Trace:
        """On to step `last`; the trace from step `first` on, from here where the run is beyond it."""
        self.new_recorder(last - self.at)
        self.advance(max(first, self.at))
        self.new_recorder(last - self.at)
        self.record()
        self.advance(last)
        return self.recorder.trace({})

    def record(self) -> None:
        """Record this point."""
        self.recorder.take(self.time)
        if self.frames is not None:
            self.frames.take(self.at, self.time)

    def save(self) -> Saved:
        """Everything but what is recorded."""
        return Saved(self.at, self.cut.stage.save(), self.cut.drive.save())

    def restore(self, saved: Saved) -> None:
        """Back to a point; what is recorded stays."""
        self.at = saved.at
        self.cut.stage.restore(saved.stage)
        self.cut.drive.restore(saved.drive)

    def take_over(self, other: CoupledRun) -> None:
        """Go on where another run of the same scene stands that has just made a step, its stage with other settings.
        ModelError where the kernel cannot. Units of the kernel only."""
        stage, old = self.cut.stage, other.cut.stage
        assert isinstance(stage, KernelUnit) and isinstance(old, KernelUnit), "FMUs take states of their own kind only"
        self.at = other.at
        stage.adopt(old)
        self.cut.drive.restore(other.cut.drive.save())

    def facts(self) -> dict[str, float]:
        """Numbers about the run itself. After a failure those of the last good time: a failed step leaves the stage
        there."""
        return dict(zip(self._fact_names, map(float, self.cut.stage.get(self._facts)), strict=True))


DRIVE = "drive."  # drivetrain variables are recorded under this prefix


class Recorder:
    """Rows of one run: `take` at every communication point, `trace` at the end.

    patterns : names of stage outputs, and of drivetrain outputs with the prefix "drive."; "*" and "?" as in file names.
    omit : patterns of names that are left out nevertheless. Raises CouplingError for a pattern that fits nothing.
    """

    def __init__(
        self, stage: Recorded, drive: Recorded, patterns: Sequence[str], points: int, omit: Sequence[str] = ()
    ) -> None:
        sides = (("", stage), (DRIVE, drive))
        everything = [prefix + name for prefix, unit in sides for name in unit.outputs()]
        unfit = [pattern for pattern in patterns if not any(fnmatchcase(name, pattern) for name in everything)]
        if unfit:
            raise CouplingError(f"nothing to record for {', '.join(unfit)}; there are {', '.join(everything)}")
        self._logs: list[tuple[str, dict[str, Variable], Log]] = []
        for prefix, unit in sides:
            asked = {name: v for name, v in unit.outputs().items() if _fits(prefix + name, patterns)}
            names = {name: v for name, v in asked.items() if not _fits(prefix + name, omit)}
            if names:
                self._logs.append((prefix, names, unit.log(list(names), points)))
        self._take = [log.take for _, _, log in self._logs]
        self._time: list[float] = []

    @property
    def count(self) -> int:
        """Number of recorded times."""
        return len(self._time)

    def take(self, time: float) -> None:
        """Record the present outputs as those of `time`, s."""
        for take in self._take:
            take()
        self._time.append(time)

    def trace(self, meta: dict[str, Any]) -> Trace:
        """Everything recorded so far."""
        channels = {}
        for prefix, names, log in self._logs:
            for column, (name, about) in zip(log.rows()[: self.count].T, names.items(), strict=True):
                values = np.round(column).astype(np.int64) if about.whole else np.ascontiguousarray(column)
                channels[prefix + name] = Channel(values, about.unit, about.description)
        return Trace(np.array(self._time), channels, meta)


def _fits(name: str, patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)
