"""A gear stage one can solve exactly: two inertias and a mesh spring, and the same equations once cut in two and once
whole."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearfmu.cosim.network import Clutch, Driven, Inertia, Network, Source, Spring
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.signals import Ramp

SHAFTS = ("pinion", "wheel")

R1, R2 = 0.0338, 0.0507  # m, base radii of 16/24 teeth, m = 4.5 mm
PINION, WHEEL = 0.8e-3, 3.6e-3  # kg·m²
MESH_K, MESH_C = 2.0e8, 2.0e3  # N/m, N·s/m


@dataclass(frozen=True)
class Plant:
    """Engine – [cut] – chain or shaft – pinion = wheel – shaft – [cut] – vehicle. Torques N·m, speeds rad/s of the
    pinion side."""

    chain: bool = False
    capacity: Ramp = Ramp(((0.0, 250.0),))
    engine_torque: float = 100.0
    ripple: float = 0.0
    ripple_frequency: float = 60.0  # Hz
    load_torque: float = 150.0  # positive: resists, on the wheel side
    engine_w: float = 150.0
    w: float = 150.0
    micro_step: float = 20e-6
    engine_inertia: float = 0.2
    vehicle_inertia: float = 0.5

    def torque(self, time: float, phi: float, w: float) -> float:
        import math

        return self.engine_torque + self.ripple * math.sin(2.0 * math.pi * self.ripple_frequency * time)

    def load(self, time: float, phi: float, w: float) -> float:
        return self.load_torque

    def stage_parts(self, engine: str, vehicle: str) -> Network:
        """Everything between the two outer nodes; the nodes themselves come from the caller."""
        wheel_w = -self.w * R1 / R2
        nodes: tuple = (Inertia("gear1", PINION, w=self.w), Inertia("gear2", WHEEL, w=wheel_w))
        springs: tuple = (
            Spring("mesh", {"gear1": R1, "gear2": R2}, MESH_K, MESH_C),
            Spring("output", {"gear2": 1.0, vehicle: -1.0}, 2.0e4, 1.0),
        )
        clutches: tuple = ()
        if self.chain:
            nodes = (Inertia("secondary", 0.06, w=self.engine_w), Inertia("disc", 0.005, w=self.w), *nodes)
            springs += (
                Spring("dmf", {engine: 1.0, "secondary": -1.0}, 800.0, 1.0),
                Spring("input", {"disc": 1.0, "gear1": -1.0}, 1.5e4, 0.5),
            )
            clutches = (Clutch("clutch", "secondary", "disc", self.capacity),)
        else:
            springs += (Spring("input", {engine: 1.0, "gear1": -1.0}, 3.0e3, 1.0),)
        return Network((Inertia(engine, 1.0), Inertia(vehicle, 1.0), *nodes), springs, clutches)

    def monolithic(self) -> Network:
        """The same equations in one network."""
        parts, ends = self.stage_parts("engine", "vehicle"), self.drive()
        return replace(parts, nodes=ends.nodes + parts.nodes[2:], sources=ends.sources)

    def stage(self) -> Network:
        """The stage's side of the cut."""
        parts = self.stage_parts("pinion.outside", "wheel.outside")
        ends = (Driven("pinion.outside", w=self.engine_w), Driven("wheel.outside", w=-self.w * R1 / R2))
        return replace(parts, nodes=ends + parts.nodes[2:])

    def drive(self) -> Network:
        """The drivetrain's side of the cut."""
        nodes = (
            Inertia("engine", self.engine_inertia, w=self.engine_w),
            Inertia("vehicle", self.vehicle_inertia, w=-self.w * R1 / R2),
        )
        sources = (Source("combustion", "engine", self.torque), Source("load", "vehicle", self.load))
        return Network(nodes, sources=sources, torque_ports={"pinion": "engine", "wheel": "vehicle"})


@dataclass(frozen=True)
class Smooth:
    """A continuous function of time."""

    function: Callable[[float], float]

    def ends(self, t0: float, t1: float) -> tuple[float, float]:
        return self.function(t0), self.function(t1)


class Stage:
    """The stage's side of a cut as a unit: outer nodes that move with the speed of a shaft, which is renewed every
    micro-step. A difference between the given angle and the one that a node has reached is blended over the step."""

    def __init__(self, plant: Plant) -> None:
        self.unit, self.work, self.motion = PyUnit(plant.stage()), 0.0, dict[str, float]()
        self.micro_step, self.tau_mean = plant.micro_step, np.zeros(2)
        self.outputs, self.log = self.unit.outputs, self.unit.log

    def initialize(self, time: float) -> None:
        """Start at the motion that was given."""
        self.unit.initialize(time)
        x, n = self.unit.state.x, self.unit.dynamics.n
        for k, shaft in enumerate(SHAFTS):
            x[k], x[n + k] = self.motion[f"{shaft}.phi"], self.motion[f"{shaft}.w"]

    def resolve(self, names: Sequence[str]) -> list[str]:
        """Names are their own handle."""
        return list(names)

    def set(self, names: list[str], values: Sequence[float]) -> None:
        """Motion of the next step."""
        self.motion.update(zip(names, values, strict=True))

    def get(self, names: list[str]) -> np.ndarray:
        """Outputs of the network, torques of the shafts, and `energy.work` of both."""
        now = values(self.unit, [f"{shaft}.outside.tau" for shaft in SHAFTS])
        own = {f"{shaft}.tau": now[k] for k, shaft in enumerate(SHAFTS)}
        own |= {f"{shaft}.tau_mean": self.tau_mean[k] for k, shaft in enumerate(SHAFTS)} | {"energy.work": self.work}
        return np.array([own[name] if name in own else values(self.unit, [name])[0] for name in names])

    def step(self, time: float, h: float) -> None:
        """In micro-steps of constant speeds."""
        count, n, impulse = max(1, round(h / self.micro_step)), self.unit.dynamics.n, np.zeros(2)
        part = h / count
        phi, w, a = (np.array([self.motion[f"{shaft}.{key}"] for shaft in SHAFTS]) for key in ("phi", "w", "a"))
        w = w + (phi - self.unit.state.x[:2]) / h
        for k in range(count):
            speed = w + a * (k + 0.5) * part
            self.unit.state.x = self.unit.state.x.copy()
            self.unit.state.x[n : n + 2] = speed
            self.unit.step(time + k * part, part)
            impulse += self.unit.state.tau_mean * part
            self.work -= float(speed @ self.unit.state.tau_mean) * part
        self.tau_mean, self.unit.state.x[n : n + 2] = impulse / h, w + a * h

    def save(self) -> Any:
        """State of the network and counts."""
        return self.unit.save(), self.work, self.tau_mean, dict(self.motion)

    def restore(self, state: Any) -> None:
        """Back to a saved one."""
        network, self.work, self.tau_mean, motion = state
        self.unit.restore(network)
        self.motion = dict(motion)


def values(unit: PyUnit, names: Sequence[str]) -> np.ndarray:
    """Outputs of a network at present."""
    log = unit.log(names, 1)
    log.take()
    return log.rows()[0]


def energy_of(unit: PyUnit) -> float:
    """J, of the network."""
    return float(values(unit, ["energy.stored"])[0])
