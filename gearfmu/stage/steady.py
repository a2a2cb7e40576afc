"""The standalone solver at constant speed and load, and settings of the kernel by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from gearfmu.errors import ModelError, Problem, SpecError
from gearfmu.kernel import Variable
from gearfmu.spec.turning import meshings, require_driven
from gearfmu.stage.model import StageModel
from gearfmu.stage.simulate import Steady, simulate
from gearfmu.stage.trace import Trace


@dataclass(frozen=True)
class Drive:
    """Constant speed and load of a run: torque (N·m) and speed (rad/s) of the input, duration (s), time between
    samples (s), time from which on results are taken (s)."""

    torque: float
    speed: float
    duration: float = 0.1
    step: float = 20e-6
    settle: float = 0.02


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
    """Trace of the model at constant drive (`Steady`). settings: kernel parameters, as numbers (`parameters`); progress
    is called with the part done, 0 … 1. SpecError where a port that would have to turn is no spring port without a
    chain."""
    _require_springs(model)
    inputs = Steady(model, drive.speed, drive.torque)
    trace = simulate(model, inputs, drive.duration, drive.step, settings, progress)
    exchanged = abs(trace["energy.work"]).max() + trace["energy.stored"].max()
    trace.meta.update(
        energy_residual=float(trace["energy.residual"][-1] / exchanged),
        H=drive.step,
        settle=drive.settle,
        scene="constant speed and load",
        meshes={mesh: known.plain for mesh, known in meshings(model.stage).items()},
        torque=drive.torque,
        speed=drive.speed,
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
