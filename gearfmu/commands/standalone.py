"""The standalone solver behind the verb simulate: settings of the kernel, a run at constant speed and load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.shared import Progress

if TYPE_CHECKING:
    from gearfmu.stage import StageModel
    from gearfmu.stage.trace import Trace


def parameters(model: Any, settings: tuple[str, ...], option: str = "--set") -> dict[str, float]:
    """Kernel parameters by name from "level=fast" or "slices=10", given to `option`; a usage error for a name or value
    the model does not know."""
    known = {v.name: v for v in model.kernel_variables() if v.causality == "parameter"}
    found = {}
    for text in settings:
        name, _, value = text.partition("=")
        if name not in known:
            raise click.BadParameter(f"'{name}' is no parameter; there are {', '.join(known)}", param_hint=option)
        found[name] = _number(known[name], value, option)
    return found


def steady_run(
    model: StageModel, drive: Mapping[str, Any], settings: Mapping[str, float], progress: Progress | None
) -> Trace:
    """Trace of the model under a constant torque: speed rad/s, end_speed rad/s (None: constant speed), torque N·m,
    duration s, step s, settle s."""
    from gearfmu.spec.turning import require_driven
    from gearfmu.stage import Steady, simulate
    from gearfmu.stage.limits import beyond_limits, limit_named

    two = (model.shafts.input, model.shafts.output)
    require_driven(model.stage, two, "simulate")
    driven = {name: model.stage.ports[name] for name in two}
    soft = [name for name, port in driven.items() if port.kind != "spring" or port.chain is not None]
    if soft:
        raise click.UsageError(
            f"'simulate' turns spring ports without a chain; {', '.join(soft)} of {model.spec.source} is another: "
            "use 'run' with a scene"
        )
    start, end = drive["speed"], drive.get("end_speed")
    inputs = Steady(model, start, drive["torque"], 0.0 if end is None else (end - start) / drive["duration"])
    with limit_named(model, drive["torque"]):
        trace = simulate(model, inputs, drive["duration"], drive["step"], settings, progress)
    beyond = beyond_limits(model, drive["torque"], max(start, start if end is None else end, key=abs))
    trace.meta["warnings"] = [*beyond, *trace.meta["warnings"]]
    trace.meta.update(
        settle=drive["settle"],
        scene="constant speed and load" if end is None else "run-up under constant torque",
        torque=drive["torque"],
        speed=start,
        end_speed=end,
    )
    return trace


def _number(variable: Any, text: str, option: str) -> float:
    """Value of an enumeration by its item, of a boolean by true or false, else a number in SI."""
    words = (
        {"true": 1.0, "false": 0.0}
        if variable.type == "Boolean"
        else {item: float(i) for i, item in enumerate(variable.items)}
    )
    if text in words:
        return words[text]
    try:
        return float(text)
    except ValueError:
        expected = " | ".join(words) or f"a number in {variable.unit or 'plain form'}"
        raise click.BadParameter(f"{variable.name}={text}: expected {expected}", param_hint=option) from None
