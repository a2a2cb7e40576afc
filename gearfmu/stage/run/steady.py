"""The standalone solver at a constant load, in a run-up or along a profile, and settings of the kernel by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from gearfmu.errors import ModelError, Problem, SpecError, near_or_all
from gearfmu.kernel import Variable
from gearfmu.quantities import Range, range_of, range_problems
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.limits import beyond_limits, limit_named
from gearfmu.stage.run.simulate import Inputs, Steady, Wound, simulate
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.turning import require_driven
from gearfmu.stagefile.tables.profile import Profile

BETWEEN = 8  # largest part of the range of torques between two of them whose winding is computed: 1/BETWEEN
BACKLASH = 0.02  # of the largest torque: within it a torque that changes its sign passes the backlash
DURATION = 0.1  # s, of a run whose profile says none
CASE_RANGES = {
    "torque": "torque",
    "speed": "speed",
    "end_speed": "speed",
    "duration": "duration",
    "step": "step",
    "settle": "time",
}
PARAMETER_RANGES = {
    "contact_damping": "contact_damping",
    "backlash": "backlash_parameter",
    "contact_penalty": "penalty",
    "friction_coefficient": "friction_coefficient",
    "oil_viscosity": "oil_viscosity",
    "flank_roughness": "flank_roughness",
    "film_roughness": "film_roughness",
    "w_start": "speed",
    "h": "internal_step",
    "slices": "slices",
}


@dataclass(frozen=True)
class Line:
    """Straight lines through points (n,), constant outside: value, slope and integral at a time."""

    time: np.ndarray
    values: np.ndarray

    @cached_property
    def _areas(self) -> np.ndarray:
        steps = 0.5 * (self.values[1:] + self.values[:-1]) * np.diff(self.time)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def _slopes(self) -> np.ndarray:
        return np.append(np.diff(self.values) / np.diff(self.time), 0.0)

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, slopes and integrals from the first point on at times (n,). The slope at a corner is that behind
        it."""
        k = np.searchsorted(self.time, times, side="right") - 1
        point = np.maximum(k, 0)
        since, first, slope = times - self.time[point], self.values[point], np.where(k < 0, 0.0, self._slopes[point])
        return first + slope * since, slope, self._areas[point] + (first + 0.5 * slope * since) * since


@dataclass(frozen=True)
class Profiled(Wound):
    """Inputs of a stage whose input follows a speed over time (Line, rad/s) while shafts and meshes are wound up by a
    torque over time (Line, N·m, on the input), as `Steady` does for constant ones. For spring ports without a chain.

    parameters: as of `Steady`. What the stage takes up under a torque, its mean over a pitch, is computed at the
    torques of the points and between them at eighths of their range, and follows straight lines over the torque.
    """

    model: StageModel
    torque: Line
    speed: Line
    parameters: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def winding(self) -> Line:
        """Angle of the input (rad) over the torque on it (N·m, in place of the time)."""
        torques = winding_torques(self.torque.values)
        still = Steady(self.model, 0.0, 0.0, parameters=self.parameters)
        carried = torques - 0.5 * self._rubbed * np.abs(torques)
        return Line(torques, np.array([replace(still, torque=float(torque)).winding for torque in carried]))

    @cached_property
    def _rubbed(self) -> float:
        """Part of the torque that friction takes, negative where the speed is: at the largest torque and speed. None is
        counted where the speed changes its sign, for friction would jump there."""
        torque, speed = (float(max(line.values, key=abs)) for line in (self.torque, self.speed))
        if np.ptp(np.sign(self.speed.values[self.speed.values != 0.0])) if speed else True:
            return 0.0
        return Steady(self.model, speed, torque, parameters=self.parameters).rubbed * float(np.sign(speed))

    def over(self, times: np.ndarray) -> dict[str, np.ndarray]:
        shafts, values = self.model.shafts, {}
        torque, growing, _ = self.torque.at(times)
        speed, rate, angle = self.speed.at(times)
        taken, yielding, _ = self.winding.at(torque)
        lost = self._rubbed * np.sign(torque)
        for port, turn in ((shafts.input, 1.0), (shafts.output, 1.0 / shafts.ratio)):
            stiffness = self.model.stage.ports[port].k
            assert stiffness is not None, "the port is a spring"
            driven = port == shafts.input
            wound = (1.0 if driven else -(1.0 - lost)) / turn / stiffness
            values[f"{port}.phi"] = wound * torque + (taken if driven else 0.0) + turn * angle
            values[f"{port}.w"] = wound * growing + (yielding * growing if driven else 0.0) + turn * speed
            values[f"{port}.a"] = turn * rate
        return values


def winding_torques(values: np.ndarray) -> np.ndarray:
    """Torques (m,), ascending, at which to compute what a stage takes up: those given (n,), others between them, and
    both sides of the backlash where the sign changes."""
    low, high = float(values.min()), float(values.max())
    found = set(values.tolist()) if values.size <= 4 * BETWEEN else {low, high}
    found |= set(np.linspace(low, high, BETWEEN + 1).tolist()) if high > low else set()
    most = BACKLASH * max(abs(low), abs(high))
    if low < 0 < high:
        found = {torque for torque in found if abs(torque) > most} | {-most, most}
    return np.array(sorted(found))


@dataclass(frozen=True)
class LoadCase:
    """A run of a stage alone: torque (N·m) and speed (rad/s) of the input; duration (s), None for that of the profile
    or 0.1; time between samples (s); time from which on results are taken (s); end_speed (rad/s), which the speed grows
    or falls to, None: it stays; profile: torque, speed or both over time, in their place. SpecError with all that is
    missing or said twice."""

    torque: float | None = None
    speed: float | None = None
    duration: float | None = None
    step: float = 20e-6
    settle: float = 0.02
    end_speed: float | None = None
    profile: Profile | None = None

    def __post_init__(self) -> None:
        if problems := list(_case_problems(self)):
            raise SpecError(problems)

    @property
    def length(self) -> float:
        """Simulated time, s."""
        if self.duration is not None:
            return self.duration
        return DURATION if self.profile is None else self.profile.duration

    def lines(self) -> tuple[Line, Line]:
        """Torque (N·m) and speed (rad/s) over time."""
        profile = self.profile or Profile(np.array([0.0, self.length]))
        ends = (self.torque, self.torque), (self.speed, self.speed if self.end_speed is None else self.end_speed)
        torque, speed = (
            Line(np.array([0.0, self.length]), np.array(given)) if own is None else Line(profile.time, own)
            for own, given in zip((profile.torque, profile.speed), ends, strict=True)
        )
        return torque, speed

    @property
    def scene(self) -> str:
        """Kind of the run, in words."""
        if self.profile is not None:
            return "torque and speed over time"
        return "constant speed and load" if self.end_speed is None else "run-up under constant torque"


def _case_problems(case: LoadCase) -> Iterator[Problem]:
    profile, given = case.profile, {field: getattr(case, field) for field in CASE_RANGES}
    yield from range_problems({field: (value, range_of(CASE_RANGES[field])) for field, value in given.items()})
    for name in ("torque", "speed"):
        in_profile, given = profile is not None and getattr(profile, name) is not None, getattr(case, name)
        if given is None and not in_profile:
            remedy = f"the run needs a {name}: give it" + ("" if profile is None else ", or a column in the profile")
            yield Problem("", name, "", remedy)
        if given is not None and in_profile:
            yield Problem("", name, f"{given:g}", f"the profile has a {name} too: leave one of them away")
    if case.end_speed is not None and profile is not None and profile.speed is not None:
        yield Problem("", "end_speed", f"{case.end_speed:g} rad/s", "the profile has a speed: leave one of them away")


def parameters(model: StageModel, settings: Mapping[str, object]) -> dict[str, float]:
    """Kernel parameters (docs/variables.md) as numbers, from {"level": "fast", "slices": 10, "effect.hertz": False} or
    the same as text. ModelError, naming the choices, for a name or value that the model lacks; SpecError
    with every number that is out of range, in the words in which a stage file with that number is refused."""
    known = {v.name: v for v in model.kernel_variables() if v.causality == "parameter"}
    unknown = [name for name in settings if name not in known]
    if unknown:
        raise ModelError(f"'{unknown[0]}' is no parameter: {near_or_all(unknown[0], known, 'there are', cutoff=0.6)}")
    found = {name: _number(known[name], value) for name, value in settings.items()}
    if problems := range_problems({name: (value, _range(known[name])) for name, value in found.items()}):
        raise SpecError(problems)
    return found


def steady_run(
    model: StageModel,
    case: LoadCase,
    settings: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trace:
    """Trace of the model under this load (`Steady`, with a profile `Profiled`). settings: kernel parameters, as
    numbers (`parameters`); progress is called with the part done, 0 … 1. Torque ports are driven through springs
    (`StageModel.driven_by_springs`); SpecError where that cannot be."""
    require_driven(model.stage, (model.shafts.input, model.shafts.output), "simulate")
    model = model.driven_by_springs()
    torque, speed = case.lines()
    inputs = _inputs(model, case, torque, speed)
    most, fastest = (float(max(line.values, key=abs)) for line in (torque, speed))
    with limit_named(model, most):
        trace = simulate(model, inputs, case.length, case.step, settings, progress)
    trace.meta["warnings"] = [*beyond_limits(model, most, fastest), *trace.meta["warnings"]]
    trace.meta.update(
        settle=case.settle, scene=case.scene, torque=case.torque, speed=case.speed, end_speed=case.end_speed
    )
    return trace


def _inputs(model: StageModel, case: LoadCase, torque: Line, speed: Line) -> Inputs:
    if case.profile is not None:
        return Profiled(model, torque, speed)
    rate = speed.at(np.zeros(1))[1]
    return Steady(model, float(speed.values[0]), float(torque.values[0]), float(rate[0]))


def _range(variable: Variable) -> Range:
    """The range of a parameter, with the remedy of the stage file's field where it is the same number."""
    last = variable.name.rpartition(".")[2]
    if not variable.name.startswith("effect.") and last in PARAMETER_RANGES:
        return range_of(PARAMETER_RANGES[last])
    return Range(variable.unit, variable.minimum, variable.maximum)


def _number(variable: Variable, value: Any) -> float:
    """Value of an enumeration by its item, of a boolean by true or false, else a number in SI."""
    boolean = variable.type == "Boolean"
    words = {"true": 1.0, "false": 0.0} if boolean else {item: float(i) for i, item in enumerate(variable.items)}
    if value in words:
        return words[value]
    try:
        return float(value)
    except (TypeError, ValueError):
        near = difflib.get_close_matches(str(value), words, n=1)
        expected = " | ".join(words) or f"a number in {variable.unit or 'plain form'}"
        hint = f" (did you mean {near[0]}?)" if near else ""
        raise ModelError(f"{variable.name} = {value}: expected {expected}{hint}") from None
