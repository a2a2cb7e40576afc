"""The standalone solver under a constant load, and settings of the kernel by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from gearfmu.errors import ModelError, Problem, SpecError
from gearfmu.kernel import Variable
from gearfmu.spec.turning import require_driven
from gearfmu.stage.limits import beyond_limits, limit_named
from gearfmu.stage.model import StageModel
from gearfmu.stage.simulate import Steady, simulate
from gearfmu.stage.trace import Trace


@dataclass(frozen=True)
class Drive:
    """A run under a constant load: torque (N·m) and speed (rad/s) of the input, duration (s), time between samples (s),
    time from which on results are taken (s); end_speed (rad/s), which the speed grows or falls to; None: it stays."""

    torque: float
    speed: float
    duration: float = 0.1
    step: float = 20e-6
    settle: float = 0.02
    end_speed: float | None = None

    @property
    def rate(self) -> float:
        """Of the speed, rad/s²."""
        return 0.0 if self.end_speed is None else (self.end_speed - self.speed) / self.duration

    @property
    def fastest(self) -> float:
        """The speed of larger magnitude, rad/s."""
        return max(self.speed, self.speed if self.end_speed is None else self.end_speed, key=abs)


def parameters(model: StageModel, settings: Mapping[str, Any]) -> dict[str, float]:
    """Kernel parameters (docs/variables.md) as numbers, from {"level": "fast", "slices": 10, "effect.hertz": False} or
    the same as text. ModelError, naming what there is, for a name or value that the model does not know."""
    known = {v.name: v for v in model.kernel_variables() if v.causality == "parameter"}
    unknown = [name for name in settings if name not in known]
    if unknown:
        raise ModelError(f"'{unknown[0]}' is no parameter; there are {', '.join(known)}")
    return {name: _number(known[name], value) for name, value in settings.items()}


def steady_run(
    model: StageModel,
    drive: Drive,
    settings: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trace:
    """Trace of the model under this drive (`Steady`). settings: kernel parameters, as numbers (`parameters`); progress
    is called with the part done, 0 … 1. SpecError where a port that would have to turn is no spring port without a
    chain."""
    _require_springs(model)
    inputs = Steady(model, drive.speed, drive.torque, drive.rate)
    with limit_named(model, drive.torque):
        trace = simulate(model, inputs, drive.duration, drive.step, settings, progress)
    trace.meta["warnings"] = [*beyond_limits(model, drive.torque, drive.fastest), *trace.meta["warnings"]]
    trace.meta.update(
        settle=drive.settle,
        scene="constant speed and load" if drive.end_speed is None else "run-up under constant torque",
        torque=drive.torque,
        speed=drive.speed,
        end_speed=drive.end_speed,
    )
    return trace


def _require_springs(model: StageModel) -> None:
    two = (model.shafts.input, model.shafts.output)
    require_driven(model.stage, two, "simulate")
    driven = {name: model.stage.ports[name] for name in two}
    soft = [name for name, port in driven.items() if port.kind != "spring" or port.chain is not None]
    if soft:
        remedy = f"'simulate' turns spring ports without a chain; {', '.join(soft)} is another: use 'run' with a scene"
        raise SpecError([Problem(str(model.spec.source), "ports", "", remedy)])


def _number(variable: Variable, value: Any) -> float:
    """Value of an enumeration by its item, of a boolean by true or false, else a number in SI."""
    boolean = variable.type == "Boolean"
    words = {"true": 1.0, "false": 0.0} if boolean else {item: float(i) for i, item in enumerate(variable.items)}
    if value in words:
        return words[value]
    try:
        return float(value)
    except (TypeError, ValueError):
        expected = " | ".join(words) or f"a number in {variable.unit or 'plain form'}"
        raise ModelError(f"{variable.name} = {value}: expected {expected}") from None
