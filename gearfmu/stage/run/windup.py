"""Start values of a stage's inputs with which it carries a torque from the start, for importers."""

from __future__ import annotations

from pathlib import Path

from gearfmu.errors import Problem, SpecError
from gearfmu.files import write_text
from gearfmu.stage.build.assembly import FIXED_K
from gearfmu.stage.build.model import StageModel
from gearfmu.stage.run.simulate import Steady


def wound_starts(model: StageModel, torque: float, speed: float = 0.0) -> dict[str, float]:
    """Values by name, SI, with which input and output carry `torque` (N·m) and turn at `speed` (rad/s), both of the
    input. Spring ports: angles and speeds of their outer ends, φ_in = T/k_in + winding and φ_out = −T i/k_out with the
    ratio i. Torque ports: torques, and parameters w_start. A fixed output gives way by T i/k. SpecError for a fixed
    input and for ports with a clutch, which decides the torque."""
    shafts, ports = model.shafts, model.stage.ports
    source, ends = str(model.stage.source), (ports[shafts.input], ports[shafts.output])
    if ends[0].kind == "fixed" or any(port.chain is not None for port in ends):
        remedy = "a start under torque needs an input that is no fixed port, and ports without a clutch"
        raise SpecError([Problem(source, "ports", ", ".join(ports), remedy)])
    steady, values = Steady(model, speed, torque), dict[str, float]()
    lost = steady.lost if all(port.kind == "spring" for port in ends) else 0.0
    for name, port, given, turn in (
        (shafts.input, ends[0], torque, 1.0),
        (shafts.output, ends[1], lost - torque, 1.0 / shafts.ratio),
    ):
        exerted = given / turn
        if port.kind == "torque":
            values |= {f"{name}.tau": exerted, f"{name}.w_start": turn * speed}
        elif port.kind == "spring":
            assert port.k is not None
            values |= {f"{name}.phi": exerted / port.k, f"{name}.w": turn * speed}
    if ends[0].kind == "spring":
        given_way = torque * shafts.ratio / (ends[1].k or FIXED_K) if ends[1].kind == "fixed" else 0.0
        values[f"{shafts.input}.phi"] += steady.winding + shafts.ratio * given_way
    return values


def write_starts(path: Path, model: StageModel, values: dict[str, float]) -> Path:
    """The values as a table variable, value, unit; returns `path`."""
    known = model.kernel().variables
    rows = (f"{name},{value!r},{known[name].unit}" for name, value in values.items())
    write_text(path, "\n".join(("variable,value,unit", *rows, "")))
    return path
