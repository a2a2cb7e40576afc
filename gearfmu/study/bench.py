"""One measured point of a study: a coupled run of a scene with its inputs kept, and its price by replay.

The price is the processor time of the stage's communication steps alone. Inputs of the coupled run are played back to
a fresh kernel in chunks, in turn with the same chunk of a second run (interleaved pairs: what slows the machine slows
both), and what the calls from Python cost is taken off by calls that the kernel refuses at its door. What is made
once, at initialisation and in the first step, is no part of the price.
"""

from __future__ import annotations

import ctypes
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from gearfmu.body import Body, load_bodies
from gearfmu.cosim.coupled import OK, Result
from gearfmu.cosim.kernel_unit import KernelHandle, KernelUnit, Source
from gearfmu.cosim.scene_run import in_drivetrain, run_once
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.assembly.model import integrator_of
from gearfmu.stage.assembly.teeth import ROLLS
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.norm import Signals, signals_of

CHUNK = 100  # communication steps that are timed together
MEDIAN_OF = 50  # communication steps whose median time stands for all: what another process takes away does not count
IDLE_CALLS = 20  # timed one by one; the median counts
LOOKED_AT = 0.15  # s of processor time after which passes of a replay have said enough
LONGEST_PASS = 2.0  # s of processor time


@dataclass(frozen=True)
class Point:
    """One choice of fidelity: level, integrator, wished step (s; 0 the default of the model), slices; off: effects that
    are switched off beside those of the scene."""

    level: str
    integrator: str = "dg4"
    h: float = 0.0
    slices: int = 5
    off: tuple[str, ...] = ()


@dataclass(frozen=True)
class Recording:
    """Data to play a stage back: blob, parameters, names and values (steps, k) of the inputs of every
    communication step, the saved state at step `first`; before: communication steps of the scene before the first
    row."""

    blob: bytes
    parameters: Mapping[str, float | bool | str]
    names: tuple[str, ...]
    values: np.ndarray
    step: float
    first: int
    state: bytes
    before: int = 0


@dataclass(frozen=True)
class Run:
    """A finished run: integrator, signals, internal step (s; rk45: mean accepted step), dynamic modes,
    outcome, bits of solver.status, message of the kernel, recording (None where it was left behind)."""

    point: Point
    integrator: str
    signals: Signals
    h: float
    n_dyn: int
    outcome: str
    status: int
    warning: str
    recording: Recording | None = field(repr=False)


@dataclass(frozen=True)
class Price:
    """Processor time per simulated second, and over that of the other run of the pair."""

    realtime_factor: float
    cpu_ratio: float


class Kept(KernelUnit):
    """A kernel unit that keeps its inputs, its state at the first step at or after `settle`, and how long every step
    took."""

    def __init__(self, blob: bytes, parameters: Mapping[str, float | bool | str], settle: float) -> None:
        super().__init__(blob, parameters)
        self.blob, self.parameters, self.settle, self.interval = blob, dict(parameters), settle, 0.0
        self.now: dict[str, float] = {}
        self.rows: list[list[float]] = []
        self.took: list[float] = []  # s
        self.before, self.first, self.state = 0, -1, b""

    def set(self, handle: KernelHandle, values: Sequence[float] | np.ndarray) -> None:
        self.now.update(zip(handle.names, map(float, values), strict=True))
        super().set(handle, values)

    def step(self, time: float, h: float) -> None:
        if not self.rows:
            self.before, self.interval = round(time / h), h
        if self.first < 0 and time >= self.settle * (1.0 - 1e-12):
            self.first, self.state = len(self.rows), self.save()
        self.rows.append(list(self.now.values()))
        started = clock.perf_counter()
        super().step(time, h)
        self.took.append(clock.perf_counter() - started)

    def recording(self) -> Recording:
        """Recording of this unit."""
        known = (self.blob, self.parameters, tuple(self.now), np.array(self.rows), self.interval)
        return Recording(*known, max(self.first, 0), self.state, self.before)

    def realtime(self) -> float:
        """Seconds of the stage per simulated second from the first kept state on: medians of chunks, less the time of
        a call that the kernel refuses at its door."""
        took = np.array(self.took[max(self.first, 0) :])
        medians = [float(np.median(part)) for part in np.array_split(took, max(1, took.size // MEDIAN_OF))]
        idle = []
        for _ in range(IDLE_CALLS):
            started = clock.perf_counter()
            self.kernel.try_step(0.0, float("nan"))
            idle.append(clock.perf_counter() - started)
        return (float(np.mean(medians)) - float(np.median(idle))) / self.interval


@dataclass(frozen=True)
class KeptSource(Source):
    """A source of such units, which it keeps in `made`."""

    settle: float = 0.0
    made: list[Kept] = field(default_factory=list)

    def unit(self, parameters: Mapping[str, float | bool | str]) -> Kept:
        self.made.append(Kept(self.model.blob, parameters, self.settle))
        return self.made[-1]


def models_for(
    scene: SceneSpec, bodies: Sequence[Body] | None = None, rolls: int = ROLLS, **changes: object
) -> StageModel:
    """The scene's stage with the ports of its drivetrain; bodies: others than those of the library; rolls: of the grid
    along a flank; changes: of fields of its file."""
    stage = rewritten(load_stage(scene.stage.name), **changes)
    return assemble(in_drivetrain(scene, stage), bodies or load_bodies(stage), rolls)


def recorded_run(scene: SceneSpec, model: StageModel) -> tuple[Result, Kept]:
    """A coupled run of the scene as it is, by the kernel, and its stage with its inputs; the state that a replay begins
    at is that after the scene's settling time. ModelError when the kernel refuses it, with the kernel's reason."""
    source = KeptSource(model, settle=scene.settle)
    return run_once(scene, source), source.made[-1]


def measure(scene: SceneSpec, model: StageModel, point: Point) -> Run:
    """A coupled run of the scene at `point`. ModelError when the kernel refuses it, with the kernel's reason."""
    effects = scene.stage.effects.model_copy(update=dict.fromkeys(point.off, False))
    fields = {name: getattr(point, name) for name in ("level", "integrator", "h", "slices")}
    changed = scene.with_stage(**fields, effects=effects).model_copy(update={"record": ("*",)})
    result, stage = recorded_run(changed, model)
    facts, end = result.facts, float(result.trace.time[-1])
    clutch = any(name.endswith(".clutch.capacity") for name in stage.kernel.variables)
    integrator = integrator_of(point.level, point.integrator, clutch)
    return Run(
        point,
        integrator,
        signals_of(result.trace, model.stage, scene.settle if end > scene.settle else 0.0),
        end / facts["solver.steps"] if integrator == "rk45" else facts["solver.h"],
        int(facts["solver.n_dyn"]),
        result.outcome,
        int(result.trace["solver.status"][-1]),
        stage.kernel.warning,
        stage.recording(),
    )


def default_step(scene: SceneSpec, model: StageModel, point: Point) -> float:
    """The internal step (s) that the kernel takes at this point, from a run of one communication step."""
    return measure(scene.model_copy(update={"duration": scene.coupling.step, "settle": 0.0}), model, point).h


class Replay:
    """A kernel at the settled state of a recording, stepped in chunks."""

    def __init__(self, recording: Recording) -> None:
        unit = KernelUnit(recording.blob, recording.parameters)
        self.kernel, self.recording = unit.kernel, recording
        known = [self.kernel.variables[name].reference for name in recording.names]
        self.references, self.rows = (ctypes.c_uint32 * len(known))(*known), np.ascontiguousarray(recording.values)
        self.kernel.prepare()
        self.rewind()
        self.chunk(1)  # makes the tables of the step, once a run
        self.rewind()

    def rewind(self) -> None:
        """Back to the settled state."""
        self.kernel.restore(self.recording.state)
        self.at = self.recording.first

    @property
    def left(self) -> int:
        """Communication steps that are left."""
        return len(self.recording.values) - self.at

    def chunk(self, count: int) -> float:
        """Processor seconds of the next `count` communication steps, without the calls'."""
        idle = self._timed(count, float("nan"))
        spent = self._timed(count, self.recording.step) - idle
        self.at += count
        return spent

    def _timed(self, count: int, step: float) -> float:
        set_all, take, references = self.kernel.set_many, self.kernel.try_step, self.references
        h, at = self.recording.step, self.recording.before + self.at
        address, width = self.rows.ctypes.data + self.at * self.rows.strides[0], self.rows.strides[0]
        started = clock.thread_time()
        for k in range(count):
            set_all(references, address + k * width)
            take((at + k) * h, step)
        return clock.thread_time() - started


def paired_price(run: Run, base: Run, looked_at: float = LOOKED_AT) -> Price:
    """Price of `run`, in turn with `base`, over the settled part of the scene, again and again until it has taken
    `looked_at` processor seconds: the least of the passes, the median of their quotients. Both ran the same scene; NaN
    for a run that stopped early."""
    if run.outcome != OK or base.outcome != OK:
        return Price(float("nan"), float("nan"))
    assert run.recording is not None and base.recording is not None
    return replayed_price(Replay(run.recording), Replay(base.recording), looked_at)


def replayed_price(one: Replay, other: Replay, looked_at: float = LOOKED_AT) -> Price:
    """The price of `one` in turn with `other`: `paired_price`."""
    left = looked_at
    passes: list[tuple[float, float]] = []
    while left > 0.0:
        spent, steps = _one_pass(one, other)
        passes.append((spent[0] / (steps * one.recording.step), spent[0] / spent[1]))
        left -= spent[0]
    return Price(float(min(time for time, _ in passes)), float(np.median([ratio for _, ratio in passes])))


def _one_pass(one: Replay, other: Replay) -> tuple[np.ndarray, int]:
    """Processor seconds of both (2,) from the settled state to the end, or until `one` has taken LONGEST_PASS;
    steps."""
    one.rewind()
    other.rewind()
    spent, steps = np.zeros(2), 0
    while one.left and spent[0] < LONGEST_PASS:
        count = min(CHUNK, one.left)
        if other.left < count:  # a shorter recording is played again
            other.rewind()
        spent += one.chunk(count), other.chunk(count)
        steps += count
    return spent, steps
