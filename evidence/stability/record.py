"""A run of the kernel under given inputs, recorded at every communication step, and what all scenes read from it."""

from __future__ import annotations

import ctypes
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evidence.stability.case import COMPLETED
from gearfmu.errors import SimulationError
from gearfmu.kernel import Kernel

MESH = ("pairs", "force_mean", "force_max", "force_drive", "force_coast", "te", "contact", "impacts", "open_time")


@dataclass(frozen=True)
class Watched:
    """What is recorded of a stage: names of its engagements, of its ports, of the single gears whose place in the plane
    is wanted, and of further outputs."""

    meshes: tuple[str, ...]
    ports: tuple[str, ...]
    gears: tuple[str, ...] = ()
    more: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Outputs that the stage has whatever its ports are."""
        return (
            *(f"{mesh}.{name}" for mesh in self.meshes for name in MESH),
            *(f"energy.{name}" for name in ("stored", "work", "dissipated")),
            *(f"solver.{name}" for name in ("steps", "retried_steps", "status", "h")),
            *(f"{gear}.gear.{name}" for gear in self.gears for name in ("phi", "x", "y", "w")),
            *self.more,
        )

    @property
    def optional(self) -> tuple[str, ...]:
        """Outputs that some kinds of ports have."""
        clutch = tuple(f"{port}.clutch.{name}" for port in self.ports for name in ("locked", "slip"))
        return (*(f"{port}.tau_mean" for port in self.ports), *clutch, *(f"{port}.w" for port in self.ports))


Inputs = Callable[[float], Mapping[str, float]]


@dataclass(frozen=True)
class Record:
    """time (n,) s; values name → (n,); outcome: "completed" or the kernel's name of what stopped the run, after the
    last sample; throughput (n,): energy that has passed through the ports, J."""

    time: np.ndarray
    values: Mapping[str, np.ndarray]
    throughput: np.ndarray
    outcome: str
    cpu_s: float

    def __getitem__(self, name: str) -> np.ndarray:
        return self.values[name]

    def after(self, time: float) -> Record:
        """The samples from `time` (s) on."""
        return self.between(time, np.inf)

    def between(self, since: float, until: float) -> Record:
        """The samples from `since` (s) to before `until` (s)."""
        keep = (self.time >= since) & (self.time < until)
        return Record(
            self.time[keep], {k: v[keep] for k, v in self.values.items()}, self.throughput[keep], self.outcome, 0.0
        )

    @property
    def h(self) -> float:
        """Internal step in use, s."""
        return float(self["solver.h"][-1])

    @property
    def energy_residual(self) -> float:
        """Largest change of stored energy − work + dissipation after the first step, over the energy passed through the
        ports plus the largest stored energy. Not the kernel's `energy.residual`, which begins anew when the internal
        step changes."""
        balance = (self["energy.stored"] - self["energy.work"] + self["energy.dissipated"])[1:]
        scale = self.throughput[-1] + self["energy.stored"].max()
        return float(np.abs(balance - balance[0]).max() / scale) if balance.size and scale else 0.0

    @property
    def realtime_factor(self) -> float:
        """CPU seconds per simulated second, reading of the outputs included."""
        return float(self.cpu_s / self.time[-1]) if self.time[-1] else 0.0

    def open_share(self, mesh: str = "mesh") -> float:
        """Part of the time without any contact."""
        return float(np.ptp(self[f"{mesh}.open_time"]) / np.ptp(self.time))

    def impact_rate(self, mesh: str = "mesh") -> float:
        """Impacts per second."""
        return float(np.ptp(self[f"{mesh}.impacts"]) / np.ptp(self.time))


class Stopped(Exception):
    """A run that the kernel gave up; `record` holds what came before, `bench` is what it ran on."""

    def __init__(self, record: Record, bench: Any = None) -> None:
        super().__init__(record.outcome)
        self.record, self.bench = record, bench


class Run:
    """One instance under way: `advance` steps it, `record` ends it. The loop of every scene."""

    def __init__(self, kernel: Kernel, capacity: int, watched: Watched) -> None:
        self.kernel = kernel
        self.names = [*watched.names, *(name for name in watched.optional if name in kernel.variables)]
        self._references, self._memory = kernel.references(self.names), (ctypes.c_double * len(self.names))()
        self._time, self._samples = np.full(capacity + 1, 0.0), np.full((capacity + 1, len(self.names)), 0.0)
        self._count = 0

    def set(self, values: Mapping[str, float]) -> None:
        """Inputs for the next step."""
        for name, value in values.items():
            self.kernel.set(name, value)

    def take(self, time: float) -> None:
        """Record all outputs as of `time`."""
        self.kernel.get_many(self._references, self._memory)
        self._time[self._count], self._samples[self._count] = time, self._memory
        self._count += 1

    def record(self, outcome: str, cpu_s: float, powers: np.ndarray | None = None) -> Record:
        """What was recorded so far. powers (n − 1,): sum of |power| of the ports in each step, W."""
        n = self._count
        time, samples = self._time[:n], self._samples[:n]
        values = dict(zip(self.names, samples.T, strict=True))
        passed = np.zeros(n)
        if powers is not None:
            passed[1:] = np.cumsum(powers[: n - 1] * np.diff(time))
        return Record(time, values, passed, outcome, cpu_s)


def run_times(kernel: Kernel, inputs: Inputs, times: Sequence[float] | np.ndarray, watched: Watched) -> Record:
    """From static equilibrium over communication points `times` (s), the first of which is the start. Stopped, with the
    samples so far, when the kernel gives up."""
    going, outcome, started = Run(kernel, len(times), watched), COMPLETED, clock.process_time()
    speeds = np.full((len(times), len(watched.ports)), 0.0)
    going.set(inputs(times[0]))
    kernel.initialize(times[0])
    going.take(times[0])
    try:
        for i in range(len(times) - 1):
            values = inputs(times[i])
            going.set(values)
            speeds[i] = [values.get(f"{port}.w", 0.0) for port in watched.ports]
            kernel.step(times[i], times[i + 1] - times[i])
            going.take(times[i + 1])
    except SimulationError as error:
        outcome = error.outcome
    cpu = clock.process_time() - started
    made = going.record(outcome, cpu, _powers(going.record(outcome, cpu), speeds, inputs, watched.ports))
    if outcome != COMPLETED:
        raise Stopped(made)
    return made


def _powers(made: Record, speeds: np.ndarray, inputs: Inputs, ports: Sequence[str]) -> np.ndarray:
    """Σ |power| of the ports in every step: of a spring port mean torque × speed of its outer end, of a torque port
    torque × speed of the gear, of a fixed one nothing."""
    n = made.time.size - 1
    total = np.zeros(n)
    for column, shaft in enumerate(ports):
        if f"{shaft}.tau_mean" in made.values:
            total += np.abs(made[f"{shaft}.tau_mean"][1:] * speeds[:n, column])
        else:
            torque = np.array([inputs(t)[f"{shaft}.tau"] for t in made.time[:-1]])
            total += np.abs(torque * made[f"{shaft}.w"][1:])
    return total
