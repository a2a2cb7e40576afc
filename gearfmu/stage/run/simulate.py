"""The standalone solver: a stage model driven by given inputs, recorded into a Trace like every other run."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gearfmu.errors import SimulationError
from gearfmu.kernel import Kernel
from gearfmu.kernel.binding import status_words
from gearfmu.spec.forms.turning import meshings, turns
from gearfmu.stage.build.model import StageModel
from gearfmu.stage.run.te import statics_of
from gearfmu.stage.run.trace import Channel, Trace

WINDING_POSITIONS = 16

Inputs = Callable[[float], Mapping[str, float]]


@dataclass(frozen=True)
class Steady:
    """Inputs of a stage under a constant load: the outer ends of its input and output turn at constant speed, or gather
    it at a constant rate, wound up so that shafts and meshes carry the torque on average: τ/k on either port and the
    mean loaded transmission between them.

    speed: of the input at the start, rad/s; torque: on the input, N·m; rate: of the speed, rad/s². For spring ports
    without a chain.
    """

    model: StageModel
    speed: float
    torque: float
    rate: float = 0.0

    @cached_property
    def winding(self) -> float:
        """Angle of the input (rad) that the stage takes up under the torque, mean over a pitch of its slowest mesh."""
        kernel, ratio = statics_of(self.model), self.model.shafts.ratio
        angles = [-self._pitch * i / WINDING_POSITIONS for i in range(WINDING_POSITIONS)]
        return float(np.mean([kernel.transmission(at, self.torque).phi - ratio * at for at in angles]))

    @property
    def _pitch(self) -> float:
        """Angle of the output (rad) over the longest pitch of the meshes that turn with it."""
        stage, shafts = self.model.stage, self.model.shafts
        speeds = turns(stage, shafts.output)
        rotor = stage.rotor_of(stage.ports[shafts.output].body)
        own = [m for m in meshings(stage).values() if m.rotor in speeds]
        near = [m for mesh, m in zip(stage.engagements, own, strict=True) if rotor in map(stage.rotor_of, mesh.gears)]
        return 2 * np.pi / min(abs(float(m.relative(speeds))) * m.teeth for m in near or own)

    def __call__(self, time: float) -> Mapping[str, float]:
        shafts, values = self.model.shafts, {}
        for port, turn in ((shafts.input, 1.0), (shafts.output, 1.0 / shafts.ratio)):
            stiffness = self.model.stage.ports[port].k
            assert stiffness is not None, "the port is a spring"
            sense = 1.0 if port == shafts.input else -1.0
            wound = sense * self.torque / turn / stiffness + (self.winding if port == shafts.input else 0.0)
            values[f"{port}.phi"] = wound + turn * (self.speed + 0.5 * self.rate * time) * time
            values[f"{port}.w"] = turn * (self.speed + self.rate * time)
            if self.rate:
                values[f"{port}.a"] = turn * self.rate
        return values


def simulate(
    model: StageModel,
    inputs: Inputs,
    duration: float,
    step: float,
    parameters: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trace:
    """Run from static equilibrium at t = 0 for `duration` (s) with communication steps `step` (s); every output is
    recorded at every step.

    inputs: time (s) → values by input name, asked at the start of each step. progress: called with the part done, 0 …
    1. A run that stops early keeps its samples; the trace's meta says the outcome and the last good time.
    """
    kernel = Kernel(model.blob, parameters)
    names = [v.name for v in kernel.variables.values() if v.causality == "output"]
    count = round(duration / step)
    samples = np.empty((count + 1, len(names)))
    started, outcome, done = clock.process_time(), "completed", 0
    _set(kernel, inputs(0.0))
    kernel.initialize(0.0)
    samples[0] = [kernel.get(name) for name in names]
    try:
        for i in range(count):
            _set(kernel, inputs(i * step))
            kernel.step(i * step, step)
            samples[i + 1] = [kernel.get(name) for name in names]
            done = i + 1
            if progress and i % max(1, count // 200) == 0:
                progress(i / count)
    except SimulationError as error:
        outcome = error.outcome
    cpu = clock.process_time() - started
    channels = _channels(kernel, names, samples[: done + 1])
    price = {"cpu_s": cpu, "realtime_factor": cpu / (done * step) if done else None}
    run = {"outcome": outcome, "simulated_s": done * step, "H": step, "energy_residual": relative_residual(channels)}
    return Trace(np.arange(done + 1) * step, channels, _meta(model, kernel) | run | price)


def relative_residual(channels: Mapping[str, Channel]) -> float | None:
    """energy.residual at the end over the energy that the stage exchanged: the largest work of its ports and the
    largest stored energy. None where nothing was exchanged."""
    work, stored, residual = (channels[f"energy.{name}"].values for name in ("work", "stored", "residual"))
    exchanged = float(np.abs(work).max() + stored.max())
    return float(residual[-1]) / exchanged if exchanged else None


def _set(kernel: Kernel, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        kernel.set(name, value)


def _channels(kernel: Kernel, names: Sequence[str], samples: np.ndarray) -> dict[str, Channel]:
    found = {}
    for name, values in zip(names, samples.T, strict=True):
        variable = kernel.variables[name]
        whole = {"Integer": np.int64, "Boolean": np.bool_}.get(variable.type)
        found[name] = Channel(values.astype(whole) if whole else values.copy(), variable.unit, variable.description)
    return found


def _meta(model: StageModel, kernel: Kernel) -> dict[str, Any]:
    level = kernel.variables["level"].items[int(kernel.get("level"))]
    return {
        "stage": model.name,
        "stage_path": str(model.spec.source),
        "meshes": {mesh: known.plain for mesh, known in meshings(model.stage).items()},
        "coupling_error": None,
        "level": level,
        "n_dyn": int(kernel.get("solver.n_dyn")),
        "slices": int(kernel.get("slices")),
        "h": kernel.get("solver.h"),
        "hashes": {"model": model.hash, "bodies": list(model.body_hashes)},
        "warnings": [*filter(None, [kernel.warning]), *status_words(int(kernel.get("solver.status")))],
    }
