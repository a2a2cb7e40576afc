"""How a scene is applied to a kind of stage: which model it runs on, how a load and a motion reach it, what it carries
and how deep its flanks may lie in each other. One bench a kind: pair.py, train.py, planetary.py."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from evidence.stability.case import COMPLETED, STEPS, Case, Finding
from evidence.stability.checks import ENERGY, deep, judged, near
from evidence.stability.motion import Step, Turn
from evidence.stability.record import Inputs, Record, Stopped, Watched, run_times
from gearfmu.cosim.coupled import OK, Result
from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.scene_run import run_once, stage_model
from gearfmu.kernel import Kernel
from gearfmu.scenefile.scene import load_scene
from gearfmu.stage import StageModel

PROBE = 1e-3  # s


@dataclass(frozen=True)
class Bench:
    """A stage that scenes run on; torques and speeds are those of its input. step: communication step, s; settled:
    duration of a run under a load that stays and when it is judged, s; limit: of the torque carried then; energy: of
    the residual."""

    kind: ClassVar[str]
    watched: ClassVar[Watched]
    step: ClassVar[float]
    nominal: ClassVar[float]
    settled: ClassVar[tuple[float, float]]
    limit: ClassVar[float]
    energy: ClassVar[float] = ENERGY

    @property
    def model(self) -> StageModel:
        """The assembled stage."""
        raise NotImplementedError

    def turning(self, motion: Turn, loads: Sequence[Step]) -> Inputs:
        """The input turns as `motion` says under torques (N·m) that change by `loads`, one step after the other: ends
        of springs turn with it, wound up against each other."""
        ends = {torque: self.wound(torque) for load in loads for torque in (load.before, load.after)}

        def inputs(time: float) -> Mapping[str, float]:
            load, turn, values = at(loads, time), motion(time), dict[str, float]()
            both = zip(self.watched.ports, self.ratios, ends[load.before], ends[load.after], strict=True)
            for port, ratio, before, after in both:
                more = replace(load, before=before, after=after)(time)
                for name, own, of_load in zip(("phi", "w", "a"), turn, more, strict=True):
                    values[f"{port}.{name}"] = ratio * own + of_load
            return values

        return inputs

    @property
    def ratios(self) -> tuple[float, float]:
        """Speeds of both ports over that of the input."""
        raise NotImplementedError

    def wound(self, torque: float) -> tuple[float, float]:
        """Angles (rad) of the outer ends of both ports that carry a torque (N·m) at rest."""
        raise NotImplementedError

    def dragged(self, motion: Turn, drag: float) -> tuple[Bench, Inputs]:
        """The bench with a loose output that `drag` (N·m) weighs on, and the inputs that turn it."""
        raise NotImplementedError

    def start(self, inputs: Inputs) -> dict[str, float]:
        """Start speeds of what no spring drives."""
        return {}

    def carried(self, record: Record, since: float, until: float) -> dict[str, float]:
        """Mean torque (N·m on the input) in a part of the run, by what carries it."""
        raise NotImplementedError

    def impulse(self, record: Record, drag: float, since: float) -> float:
        """Impulse of the meshes on the output over that of its drag."""
        raise NotImplementedError

    def depths(self, record: Record, backlash: float | None) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """By mesh what to call its flanks, how deep they lie in each other and how deep the largest force presses them,
        (n,) m. backlash: m, where it is not the stage's."""
        raise NotImplementedError

    def kernel(self, case: Case, parameters: Mapping[str, float] | None = None) -> Kernel:
        """A fresh instance at the case's level and step."""
        return _instance(self.model.blob, case.level, internal_step(self.model, case, parameters), parameters or {})

    def run(
        self,
        case: Case,
        inputs: Inputs,
        times: float | np.ndarray,
        parameters: Mapping[str, float] | None = None,
        step: float = 0.0,
    ) -> Record:
        """A run from static equilibrium over a duration with steps of the bench or `step` (s), or over communication
        points (s). Stopped where the kernel gives up."""
        step = step or self.step
        points = np.arange(round(times / step) + 1) * step if isinstance(times, float) else times
        try:
            start = self.start(inputs) | dict(parameters or {})
            return run_times(self.kernel(case, start), inputs, points, self.watched)
        except Stopped as stop:
            raise Stopped(stop.record, self) from None

    def loaded(self, case: Case, speed: Turn, torque: float, duration: float = 0.0, **more: Any) -> Record:
        """A run under a torque that stays, over `duration` (s) or as long as `settled` says."""
        return self.run(case, self.turning(speed, steady(torque)), duration or self.settled[0], **more)

    def carries(
        self, record: Record, torque: float, since: float, limit: float = 0.0, until: float = np.inf
    ) -> tuple[list[str], dict[str, float]]:
        """Complaints where the torque from `since` to `until` (s) is not carried, and what is."""
        found, said = self.carried(record, since, until), []
        for name, value in found.items():
            said += near(f"mean torque of {name}", value, torque, limit or self.limit)
        return said, {f"{name}_Nm": value for name, value in found.items()}

    def finding(
        self,
        record: Record,
        said: Iterable[str] = (),
        facts: Mapping[str, float] | None = None,
        energy: float = 0.0,
        backlash: float | None = None,
    ) -> Finding:
        """The finding of a run with the complaints of its scene."""
        deepest, sunk = 0.0, []
        for name, depth, pressed in self.depths(record, backlash):
            sunk += deep(record, depth, pressed, name)
            deepest = max(deepest, float(depth.max()))
        return judged(record, deepest, [*sunk, *said], facts or {}, energy or self.energy)


def steady(torque: float) -> tuple[Step, ...]:
    """A torque (N·m) that stays."""
    return (Step(0.0, 1.0, torque, torque),)


def at(loads: Sequence[Step], time: float) -> Step:
    """The step that is under way."""
    return next((step for step in loads if time < step.end), loads[-1])


def internal_step(stage: StageModel, case: Case, parameters: Mapping[str, float] | None = None) -> float:
    """The internal step to ask the kernel for, s; 0 where its default is wanted."""
    if case.h or case.step == "default":
        return case.h
    return _default_step(stage.blob, case.level, tuple(sorted((parameters or {}).items()))) / STEPS[case.step]


@lru_cache(maxsize=32)
def _default_step(blob: bytes, level: str, parameters: tuple[tuple[str, float], ...]) -> float:
    """The step that the kernel takes by itself, s: of 1 ms at rest, a whole number of steps, so up to 1 % below it."""
    probe = _instance(blob, level, 0.0, {name: value for name, value in parameters if not name.endswith("w_start")})
    probe.initialize(0.0)
    probe.step(0.0, PROBE)
    return probe.get("solver.h")


def _instance(blob: bytes, level: str, h: float, parameters: Mapping[str, float]) -> Kernel:
    made = Kernel(blob, dict(parameters))
    made.set("level", made.variables["level"].items.index(level))
    made.set("h", h)
    return made


@lru_cache(maxsize=1)
def shipped_model(scene: str) -> StageModel:
    """The stage of a shipped scene with the ports of its drivetrain."""
    return stage_model(load_scene(scene))


def run_shipped(bench: Bench, name: str, case: Case, **changes: object) -> tuple[Record, Result]:
    """A shipped scene through the coupling, with `changes` of its fields; Stopped where it does not reach its end."""
    scene = load_scene(name)
    as_shipped = (case.level, case.step, case.h) == (scene.stage.level, "default", 0.0)
    h = scene.stage.h if as_shipped else internal_step(shipped_model(name), case)
    stage = scene.stage.model_copy(update={"level": case.level, "h": h})
    changed = scene.model_copy(update={"stage": stage, "record": ("*",), **changes})
    result = run_once(changed, Source(shipped_model(name)))
    trace, ports = result.trace, bench.watched.ports
    names = (*bench.watched.names, *(name for name in bench.watched.optional if name in trace))
    values = {name: np.asarray(trace[name], float) for name in names}
    power = np.zeros(trace.time.size)
    for port in ports:
        sprung = f"{port}.tau_mean" in trace
        power += np.abs(
            trace[f"{port}.tau_mean"] * trace[f"drive.{port}.w"]
            if sprung
            else trace[f"drive.{port}.tau"] * trace[f"{port}.w"]
        )
    passed = np.concatenate([[0.0], np.cumsum(power[1:] * np.diff(trace.time))])
    outcome = COMPLETED if result.outcome == OK else str(result.outcome)
    made = Record(trace.time, values, passed, outcome, result.cpu_s)
    if outcome != COMPLETED:
        raise Stopped(made, bench)
    return made, result
