"""The standalone solver: a stage model driven by given inputs, recorded into a Trace like every other run; start values
of inputs with which a stage carries a torque from the start, for importers."""

from __future__ import annotations

import time as clock
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import Self

from gearfmu.errors import Problem, SimulationError, SpecError
from gearfmu.files import write_text
from gearfmu.kernel import Kernel
from gearfmu.kernel.binding import status_words
from gearfmu.kernel.instance import Recording
from gearfmu.stage.assembly.assemble import FIXED_K
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.forms.turning import meshings, turns

WINDING_POSITIONS, LOSS_STEPS = 16, 100  # over a pitch
SECANT = 0.01  # of the torque
CHUNKS, LEAST_CHUNK = 200, 16  # a run is made in at most so many calls of the kernel, of at least so many steps

Inputs = Callable[[float], Mapping[str, float]]


class Wound(ABC):
    """Inputs under which a stage carries a torque: functions of time that know the run's parameters, for its effects
    decide what it takes up."""

    @abstractmethod
    def over(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """Values (n,) by input name at times (n,), s."""

    def under(self, parameters: Mapping[str, float]) -> Self:
        """The same torque and speed in a run with these parameters of the kernel."""
        return replace(self, parameters=parameters)  # type: ignore[type-var]  # all of them are dataclasses

    def __call__(self, time: float) -> dict[str, float]:
        """Values by input name at a time, s."""
        return {name: float(values[0]) for name, values in self.over(np.array([time])).items()}


@dataclass(frozen=True)
class Steady(Wound):
    """Inputs of a stage under a constant load: the outer ends of its input and output turn at constant speed, or gather
    it at a constant rate, wound up so that shafts and meshes carry the torque on average: τ/k on either port and the
    mean loaded transmission between them. With friction the output carries less, by its loss at the speed of the start.

    speed: of the input at the start, rad/s; torque: on the input, N·m; rate: of the speed, rad/s²; parameters: of the
    kernel in the run, which `simulate` fills in. For spring ports without a chain.
    """

    model: StageModel
    speed: float
    torque: float
    rate: float = 0.0
    parameters: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def winding(self) -> float:
        """Angle of the input (rad) that the stage takes up under the torque, mean over a pitch of its slowest mesh, and
        the plays of its port springs. Its meshes carry the mean of input and output."""
        known = {**self.parameters, "effect.friction": 0.0}
        ratio, angles = float(self.model.shafts.ratio), self._positions(WINDING_POSITIONS)
        taken, slope = mean_winding(self.model.blob, known, self.torque, angles, ratio)
        return taken - 0.5 * slope * self.lost + self._play

    @property
    def _play(self) -> float:
        shafts, ports = self.model.shafts, self.model.stage.ports
        sides = (ports[shafts.input].side, abs(float(shafts.ratio)) * ports[shafts.output].side)
        return float(sum(sides) * np.sign(self.torque))

    @property
    def lost(self) -> float:
        """Torque on the input (N·m) that friction of the flanks takes, mean over a pitch."""
        return self.rubbed * abs(self.torque) * float(np.sign(self.speed))

    @cached_property
    def rubbed(self) -> float:
        """Part of the torque that friction of the flanks takes: of a second pitch, wound up without friction."""
        friction, smooth = "effect.friction", {"effect.friction": 0.0}
        on = self.parameters[friction] if friction in self.parameters else self.model.kernel().get(friction)
        if not (on and self.speed and self.torque):
            return 0.0
        angles, shafts = np.array(self._positions(LOSS_STEPS)), self.model.shafts
        times = np.concatenate([-angles, angles[1] * -LOSS_STEPS - angles]) * abs(float(shafts.ratio) / self.speed)
        inputs = replace(self, rate=0.0, parameters={**self.parameters, **smooth}).over(times)
        return rubbed_away(self.model.blob, self.parameters, inputs, float(times[1]), shafts.input)

    def _positions(self, count: int) -> tuple[float, ...]:
        """Angles of the output (rad) over the longest pitch of the meshes that turn with it."""
        stage, shafts = self.model.stage, self.model.shafts
        speeds = turns(stage, shafts.output)
        rotor = stage.rotor_of(stage.ports[shafts.output].body)
        own = [m for m in meshings(stage).values() if m.rotor in speeds]
        near = [m for mesh, m in zip(stage.engagements, own, strict=True) if rotor in map(stage.rotor_of, mesh.gears)]
        pitch = 2 * np.pi / min(abs(float(m.relative(speeds))) * m.teeth for m in near or own)
        return tuple(-pitch * i / count for i in range(count))

    def over(self, times: np.ndarray) -> dict[str, np.ndarray]:
        shafts, values = self.model.shafts, {}
        for port, turn in ((shafts.input, 1.0), (shafts.output, 1.0 / shafts.ratio)):
            stiffness = self.model.stage.ports[port].k
            assert stiffness is not None, "the port is a spring"
            if port == shafts.input:
                wound = self.torque / turn / stiffness + self.winding
            else:
                wound = -(self.torque - self.lost) / turn / stiffness
            values[f"{port}.phi"] = wound + turn * (self.speed + 0.5 * self.rate * times) * times
            values[f"{port}.w"] = turn * (self.speed + self.rate * times)
            if self.rate:
                values[f"{port}.a"] = np.full(times.size, turn * self.rate)
        return values


def mean_winding(
    blob: bytes, parameters: Mapping[str, float], torque: float, angles: tuple[float, ...], ratio: float
) -> tuple[float, float]:
    """Mean angle of the input (rad) under a torque on it (N·m), less its rotation by the output's angles (rad), and its
    growth with the torque at the first of them, rad/(N·m); with these parameters of the kernel."""
    return _mean_winding(blob, tuple(sorted(at_rest(blob, parameters).items())), torque, angles, ratio)


@lru_cache(maxsize=8)
def _mean_winding(
    blob: bytes, parameters: tuple[tuple[str, float], ...], torque: float, angles: tuple[float, ...], ratio: float
) -> tuple[float, float]:
    kernel = Kernel(blob, dict(parameters))
    kernel.prepare()
    found = [kernel.transmission(at, torque, keep=i > 0).phi - ratio * at for i, at in enumerate(angles)]
    less = kernel.transmission(angles[0], (1.0 - SECANT) * torque).phi - ratio * angles[0]
    return float(np.mean(found)), (found[0] - less) / (SECANT * torque) if torque else 0.0


def at_rest(blob: bytes, parameters: Mapping[str, float]) -> dict[str, float]:
    """Parameters for the statics of a run with these, which do not depend on level, integrator and step: level rigid.
    But level paper and contact by nodes have less compliance and their own statics."""
    kernel = Kernel(blob, parameters)
    level, contact = (kernel.variables[name].items[int(kernel.get(name))] for name in ("level", "contact"))
    own = level == "paper" or contact == "nodal"
    return {**parameters, **({} if own else {"level": 0.0, "integrator": 0.0, "h": 0.0})}


def rubbed_away(
    blob: bytes, parameters: Mapping[str, float], inputs: Mapping[str, np.ndarray], step: float, port: str
) -> float:
    """Part of the work of the port `port` that friction of the flanks takes in the second half of a run from
    equilibrium; 0 where that fails. inputs: by name, (n,) one for every communication step (s)."""
    kernel = Kernel(blob, at_rest(blob, parameters))
    rubbed = [name for name in kernel.variables if name.endswith(".friction_loss")]
    for name, values in inputs.items():
        kernel.set(name, float(values[0]))
    kernel.initialize()
    steps = len(inputs[f"{port}.w"])
    record = Recording(kernel, [*rubbed, f"{port}.tau_mean"], steps, step)
    try:
        record.advance(steps, inputs)
    except SimulationError:  # the run itself reports it
        return 0.0
    half = steps // 2
    work = step * np.sum(record.rows[half + 1 :, -1] * inputs[f"{port}.w"][half:])
    return float(np.sum(record.rows[-1, :-1] - record.rows[half, :-1]) / abs(work))


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

    inputs: time (s) → values by input name, asked for the start of each step, some steps ahead; those of `Wound` are
    told the parameters. progress: called with the part done, 0 … 1. A run that stops early keeps its samples; the
    trace's meta says the outcome and the last good time.
    """
    kernel = Kernel(model.blob, parameters)
    if isinstance(inputs, Wound):
        inputs = inputs.under(parameters or {})
    names = [v.name for v in kernel.variables.values() if v.causality == "output"]
    count = round(duration / step)
    started, outcome = clock.process_time(), "completed"
    for name, value in inputs(0.0).items():
        kernel.set(name, value)
    kernel.initialize(0.0)
    record = Recording(kernel, names, count, step)
    try:
        for first, times in _chunks(count, step):
            record.advance(times.size, _given(inputs, times, kernel))
            if progress:
                progress(first / count)
    except SimulationError as error:
        outcome = error.outcome
    cpu, done = clock.process_time() - started, record.done
    channels = _channels(kernel, names, record.rows[: done + 1])
    price = {"cpu_s": cpu, "realtime_factor": cpu / (done * step) if done else None}
    run = {"outcome": outcome, "simulated_s": done * step, "H": step, "energy_residual": relative_residual(channels)}
    return Trace(np.arange(done + 1) * step, channels, _meta(model, kernel) | run | price)


def _chunks(count: int, step: float) -> Iterator[tuple[int, np.ndarray]]:
    """Number of the first step, and times (s) of steps that are made by one call."""
    size = max(LEAST_CHUNK, -(-count // CHUNKS))
    for first in range(0, count, size):
        yield first, np.arange(first, min(first + size, count)) * step


def _given(inputs: Inputs, times: np.ndarray, kernel: Kernel) -> dict[str, np.ndarray]:
    """Values (n,) by input name at times (n,); an input that is not named keeps its value."""
    if isinstance(inputs, Wound):
        return inputs.over(times)
    asked = [inputs(time) for time in times.tolist()]
    now, rows = {name: kernel.get(name) for values in asked for name in values}, []
    for values in asked:
        now.update(values)
        rows.append(tuple(now.values()))
    return dict(zip(now, np.array(rows, float).T, strict=True))


def relative_residual(channels: Mapping[str, Channel]) -> float | None:
    """energy.residual at the end over the energy that the stage exchanged: the largest work of its ports and the
    largest stored energy. None where nothing was exchanged."""
    work, stored, residual = (channels[f"energy.{name}"].values for name in ("work", "stored", "residual"))
    exchanged = float(np.abs(work).max() + stored.max())
    return float(residual[-1]) / exchanged if exchanged else None


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
        "stage_path": str(model.stage.source),
        "meshes": {mesh: known.plain for mesh, known in meshings(model.stage).items()},
        "coupling_error": None,
        "level": level,
        "n_dyn": int(kernel.get("solver.n_dyn")),
        "slices": int(kernel.get("slices")),
        "h": kernel.get("solver.h"),
        "hashes": {"model": model.hash, "bodies": list(model.body_hashes)},
        "warnings": [*filter(None, [kernel.warning]), *status_words(int(kernel.get("solver.status")))],
    }


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
