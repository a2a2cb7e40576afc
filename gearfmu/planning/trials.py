"""Trial runs: a choice over a window of a scene. Computed by a worker, here or elsewhere; a run that fails is an
infinite error, not an end.

A trial does not begin at the start of the scene. A pilot, level fast with all effects, is run there once in every
process; the trial takes its state over (`CoupledRun.take_over`), settles, and is looked at over the window.
"""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from gearfmu.cosim.coupled import OK, CoupledRun
from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.scene_run import coupled_run, stage_model
from gearfmu.errors import GearfmuError
from gearfmu.planning.choice import Choice
from gearfmu.planning.judge import Signals, signals_of
from gearfmu.planning.request import Request
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel, Trace
from gearfmu.study.bench import Kept, KeptSource, Price, Replay, recorded_run, replayed_price
from gearfmu.study.ladder import fitting
from gearfmu.sweeps.points import program
from gearfmu.sweeps.runners import Lost, Runner

BASE_STEPS = 400  # communication steps of which prices are made
LOOKED_AT = 0.01  # s of processor time of a replay
PILOT_LEVEL, PILOT_STEP = "fast", 5e-6  # s
MESH_CHANNELS = ("open_time", "force_drive", "force_coast", "te")
SOLVER = ("solver.status", "energy.residual")


@dataclass(frozen=True)
class Window:
    """start, length: s of the scene; settle: s before it in which a trial forgets its initial state."""

    start: float
    length: float
    settle: float = 0.01

    @property
    def end(self) -> float:
        return self.start + self.length


@dataclass(frozen=True)
class Task:
    """One trial: scene (as JSON), choice, window, request; priced: whether the price is measured by replay, in
    turn with that of level fast, or read off the run itself; through: a choice that the state passes through for one
    communication step, which makes a twin of a run."""

    scene: str
    choice: Choice
    window: Window
    request: Request
    priced: bool = False
    through: Choice | None = None
    program: str = field(default_factory=program)


@dataclass(frozen=True)
class Trial:
    """Result of a trial. signals: over the window, empty after a failure; lost: s without contact in the window, of the
    worst mesh; coast: whether both flanks of a mesh carried; drive: smallest force on the carrying flanks over its
    mean; force: mean of the first mesh, N; price: processor time of the stage over that of level fast at its default
    step; realtime: processor seconds of the stage per simulated second; cpu: processor seconds of
    the trial; run: of its window and the way there, without the measurement of its price."""

    choice: Choice
    outcome: str
    message: str = ""
    signals: Signals = field(default_factory=lambda: Signals({}, 0.0), repr=False)
    lost: float = 0.0
    coast: bool = False
    drive: float = 1.0
    force: float = 0.0
    price: float = float("nan")
    realtime: float = float("nan")
    cpu: float = 0.0
    run: float = 0.0

    @property
    def loses_contact(self) -> bool:
        """Whether teeth part, or meet on the other side, in the window."""
        return self.lost > 0.0 or self.coast


def run_trial(task: Task) -> Trial:
    """The trial of a task; whatever goes wrong is its outcome."""
    started = clock.process_time()
    try:
        if task.program != program():
            return Trial(task.choice, "other version", f"the worker has gearfmu {program()}, the plan {task.program}")
        found = _run(task)
    except GearfmuError as error:
        found = Trial(task.choice, getattr(error, "outcome", type(error).__name__), str(error))
    except (FloatingPointError, ValueError, np.linalg.LinAlgError) as error:  # a diverged run in a spectrum
        found = Trial(task.choice, "diverged", str(error))
    return replace(found, cpu=clock.process_time() - started)


def run_trials(tasks: Sequence[Task], runner: Runner) -> list[Trial]:
    """Trials of the tasks, in their order."""
    found: dict[int, Trial] = {}
    for number, result in runner(run_trial, tasks):
        lost = isinstance(result, Lost)
        found[number] = Trial(tasks[number].choice, "worker lost", result.message) if lost else result
    return [found[number] for number in range(len(tasks))]


def shortened(scene: SceneSpec, end: float) -> SceneSpec:
    """The scene up to `end` (s), or on to there, rounded up to a communication step."""
    step = scene.coupling.step
    return scene.model_copy(update={"duration": max(1, int(np.ceil(end / step - 1e-6))) * step})


def pilot_choice(scene: SceneSpec) -> Choice:
    """Choice for the states: level fast, all effects of the scene."""
    off = tuple(sorted(scene.stage.effects.off))
    return Choice(PILOT_LEVEL, fitting(scene.coupling.step, PILOT_STEP), scene.stage.slices, off)


_known: dict[str, tuple[SceneSpec, StageModel]] = {}


def prime(text: str, scene: SceneSpec, model: StageModel) -> None:
    """Trials of this scene in this process need not assemble its stage."""
    _known.clear()
    _known[text] = scene, model


def scene_and_model(text: str) -> tuple[SceneSpec, StageModel]:
    """Scene and model of a task; the last is kept in the process."""
    if text not in _known:
        scene = SceneSpec.model_validate_json(text)
        prime(text, scene, stage_model(scene))
    return _known[text]


@lru_cache(maxsize=2)
def _base(text: str) -> Replay:
    """Reference of prices, measured in turn: level fast at its default step."""
    scene, model = scene_and_model(text)
    part = shortened(scene, BASE_STEPS * scene.coupling.step).model_copy(update={"settle": 0.0})
    choice = Choice("fast", 0.0, scene.stage.slices, scene.stage.effects.off)
    return Replay(recorded_run(choice.of(part), model)[1].recording())


@lru_cache(maxsize=2)
def _base_realtime(text: str) -> float:
    """Seconds of the stage per simulated second."""
    replay = _base(text)
    replay.rewind()
    steps = replay.left
    return replay.chunk(steps) / (steps * replay.recording.step)


_pilots: dict[str, CoupledRun] = {}


def _pilot(text: str, at: int) -> CoupledRun:
    """The pilot of a scene after `at` communication steps, at least one."""
    run = _pilots.get(text)
    if run is None or run.at > at:
        scene, model = scene_and_model(text)
        _pilots.clear()
        run = coupled_run(pilot_choice(scene).of(_recording(scene, SOLVER)), Source(model))
        run.begin()
    run.new_recorder(at - run.at)
    run.advance(at)
    _pilots[text] = run
    return run


def _recording(scene: SceneSpec, names: Sequence[str]) -> SceneSpec:
    return scene.model_copy(update={"record": tuple(dict.fromkeys(names))})


def _run(task: Task) -> Trial:
    scene, model = scene_and_model(task.scene)
    step, meshes = scene.coupling.step, [mesh.name for mesh in model.stage.engagements]
    first, last = (round(t / step) for t in (task.window.start, task.window.end))
    at = max(1, round((task.window.start - task.window.settle) / step))
    source = KeptSource(model, settle=task.window.start)
    watched = [f"{mesh}.{key}" for mesh in meshes for key in MESH_CHANNELS]
    scene = _recording(scene, [*task.request.channels, *watched, *SOLVER])
    started = clock.process_time()
    before: CoupledRun = _pilot(task.scene, at)
    if task.through is not None:
        through = coupled_run(task.through.of(scene), Source(model))
        through.take_over(before)
        through.advance(through.at + 1)
        before = through
    run = coupled_run(task.choice.of(scene), source)
    run.take_over(before)
    trace = run.window(first, last)
    spent = clock.process_time() - started
    return replace(_judged(task, trace, meshes, _price(task, source.made[-1])), run=spent)


def _price(task: Task, unit: Kept) -> Price:
    """By replay of the first BASE_STEPS of the window, or as the run itself was timed."""
    if not task.priced:
        realtime = unit.realtime()
        return Price(realtime, realtime / _base_realtime(task.scene))
    recording = unit.recording()
    short = replace(recording, values=recording.values[: recording.first + BASE_STEPS])
    return replayed_price(Replay(short), _base(task.scene), LOOKED_AT)


def _judged(task: Task, part: Trace, meshes: Sequence[str], price: Price) -> Trial:
    """Results from the trace of the window."""
    interval = float(part.time[1] - part.time[0])
    lost = max(float(part[f"{mesh}.open_time"][-1] - part[f"{mesh}.open_time"][0]) for mesh in meshes)
    sides = [(np.abs(part[f"{mesh}.force_drive"]), np.abs(part[f"{mesh}.force_coast"])) for mesh in meshes]
    both = any(a.max() > 0 and b.max() > 0 for a, b in sides)  # one side carries in loaded running
    carrying = [max(pair, key=np.mean) for pair in sides]
    drive = min(float(side.min() / max(side.mean(), 1e-300)) for side in carrying)
    signals, force = signals_of(part, task.request, interval), float(np.mean(carrying[0]))
    return Trial(task.choice, OK, "", signals, lost, both, drive, force, price.cpu_ratio, price.realtime_factor)
