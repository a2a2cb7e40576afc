"""A gear stage one can solve exactly: two inertias, mesh spring with backlash, and the same equations once cut in two
and once whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from gearfmu.cosim.network import Clutch, Driven, Inertia, Network, Source, Spring
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.signals import Constant, Signal

R1, R2 = 0.0338, 0.0507  # m, base radii of 16/24 teeth, m = 4.5 mm
PINION, WHEEL = 0.8e-3, 3.6e-3  # kg·m²
MESH_K, MESH_C = 2.0e8, 2.0e3  # N/m, N·s/m


@dataclass(frozen=True)
class Plant:
    """Engine – [cut] – chain or shaft – pinion = wheel – shaft – [cut] – vehicle. Torques N·m, speeds rad/s of the
    pinion side."""

    chain: bool = False
    backlash: float = 0.0
    capacity: Signal = Constant(250.0)
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
            Spring("mesh", {"gear1": R1, "gear2": R2}, MESH_K, MESH_C, self.backlash),
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
        return replace(
            parts, nodes=ends + parts.nodes[2:], motion_ports={"pinion": "pinion.outside", "wheel": "wheel.outside"}
        )

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


def energy_of(unit: PyUnit) -> float:
    """J, of the network."""
    return float(unit.get(unit.resolve(["energy.stored"]))[0])
