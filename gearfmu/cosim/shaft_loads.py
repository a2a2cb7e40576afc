"""Stages under torques that are known as functions of time and speed: no drivetrain with a state of its own.

The stage's ports are torque ports: torque in, motion out. In every communication step the torque is held at its mean:
of the functions of time exactly, of what follows the speed at the speed in the middle of the step, to which the mean
change of the last four steps is carried on. Second order in the step; `jacobi` holds the torque of the step's
beginning, as importers do: first order.

Why four steps: a torque that follows the speed of an elastic shaft late feeds resonances whose half period is shorter
than the delay. At frequency f it gives them the part D of what an undelayed damper would take, worst at f H of 0.7:
D = −0.22 when the speed of the step's beginning is held, −0.52 when the last step's change is carried on (it doubles
what alternates), −0.25 with that of four.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.cosim.drive import Drive, Loads, frequencies_of
from gearfmu.cosim.kernel_unit import RowLog
from gearfmu.cosim.signals import Ramp
from gearfmu.cosim.units import Variable
from gearfmu.errors import Problem, SpecError
from gearfmu.scenefile.drivetrain import ShaftLoad
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.turning import turns, undriven
from gearfmu.stagefile.tables.connections import PortSpec

CARRIED_ON = 4  # steps whose mean change of speed is carried on


@dataclass(frozen=True)
class Law:
    """Torque on one shaft as a function of time and speed."""

    load: ShaftLoad

    def at(self, time: float, w: float) -> float:
        """Torque (N·m) at `time` (s), right limit where it jumps, at the speed w (rad/s)."""
        alternating = self.load.alternating
        swing = alternating.amplitude * math.sin(2.0 * math.pi * alternating.frequency * time) if alternating else 0.0
        return self._steady(w) + self._ends(time, time)[0] + swing

    def mean(self, time: float, h: float, w: float) -> float:
        """Mean torque (N·m) from `time` over h (s) at the mean speed w (rad/s)."""
        alternating, swing = self.load.alternating, 0.0
        if alternating:
            omega = 2.0 * math.pi * alternating.frequency
            swing = alternating.amplitude * (math.cos(omega * time) - math.cos(omega * (time + h))) / (omega * h)
        return self._steady(w) + 0.5 * sum(self._ends(time, time + h)) + swing

    def _steady(self, w: float) -> float:
        proportional, control = self.load.proportional, self.load.speed_control
        steady = (self.load.constant or 0.0) + (proportional.slope * w if proportional else 0.0)
        return steady - control.damping * w if control else steady

    def _ends(self, start: float, end: float) -> tuple[float, float]:
        """What straight lines over time give at both ends."""
        first, last = Ramp(self.load.over_time).ends(start, end) if self.load.over_time else (0.0, 0.0)
        if control := self.load.speed_control:
            wanted = Ramp(control.over_time).ends(start, end)
            first, last = first + control.damping * wanted[0], last + control.damping * wanted[1]
        return first, last


class ShaftLoads:
    """The torques of a run in place of a drivetrain, and their work.

    start : speed (rad/s) of every loaded shaft at the start. tau (k,) N·m: mean over the last communication step, at
    the start that of the start; work (k,) J: given to the stage since the start; exchanged : energy that the loads got
    from the stage, signed sum and sum of magnitudes, J; speeds : the last ones, (k,) each.
    """

    def __init__(self, loads: Mapping[str, ShaftLoad], start: Mapping[str, float]) -> None:
        self.laws = {name: Law(load) for name, load in loads.items()}
        self.tau, self.work, self.exchanged = np.zeros(len(loads)), np.zeros(len(loads)), (0.0, 0.0)
        self.speeds = deque([np.array([start[name] for name in loads])], maxlen=CARRIED_ON + 1)

    def outputs(self) -> dict[str, Variable]:
        """`<shaft>.tau` and `<shaft>.work`."""
        torques = {f"{name}.tau": Variable("N.m", "mean torque on the stage over the last step") for name in self.laws}
        return torques | {f"{name}.work": Variable("J", "work done on the stage since the start") for name in self.laws}

    def log(self, names: Sequence[str], points: int) -> RowLog:
        """Keeps these outputs at up to `points` times."""
        known = list(self.outputs())
        places = [known.index(name) for name in names]
        return RowLog(lambda: np.concatenate([self.tau, self.work])[places], len(names), points)

    def hold(self, time: float) -> None:
        """The torques of `time` at the last speeds."""
        self.tau = self._each("at", (time,), self.speeds[-1])

    def hold_mean(self, time: float, h: float) -> None:
        """The mean torques from `time` over h s."""
        change = (self.speeds[-1] - self.speeds[0]) / max(1, len(self.speeds) - 1)
        self.tau = self._each("mean", (time, h), self.speeds[-1] + 0.5 * change)

    def count(self, turned: np.ndarray, speeds: np.ndarray) -> None:
        """After a step in which the shafts turned by so much, rad: their speeds, rad/s."""
        given, (work, throughput) = self.tau * turned, self.exchanged
        self.work = self.work + given
        self.exchanged = work - float(given.sum()), throughput + float(np.abs(given).sum())
        self.speeds.append(speeds.copy())

    def _each(self, what: str, when: tuple[float, ...], speeds: np.ndarray) -> np.ndarray:
        laws = zip(self.laws.values(), speeds.tolist(), strict=True)
        return np.array([getattr(law, what)(*when, w) for law, w in laws])

    def save(self) -> Any:
        """Torques, works and the last speeds."""
        return self.tau, self.work, self.exchanged, tuple(self.speeds)

    def restore(self, state: Any) -> None:
        """Back to a saved state."""
        self.tau, self.work, self.exchanged, speeds = state
        self.speeds = deque(speeds, maxlen=CARRIED_ON + 1)


def loads_drive(scene: SceneSpec, loads: Loads, stage: Stage, input_port: str) -> Drive:
    """Torques as functions of time and speed on a stage. SpecError: `torque_ports`."""

    def start() -> dict[str, float]:
        return {f"{name}.w_start": speed for name, speed in start_speeds(scene, stage, input_port, loads).items()}

    return Drive(torque_ports(scene.name, loads, stage), loads, start, frequencies=frequencies_of(loads))


def torque_ports(file: str, loads: Collection[str], stage: Stage) -> dict[str, PortSpec]:
    """The stage's loaded ports as torque ports. SpecError with every load of a port that the stage does not have, and
    every spring port that nothing would drive."""
    remedy = f"the stage has no such port; it has {', '.join(stage.ports)}"
    problems = [Problem(file, f"shaft_loads.{name}", "", remedy) for name in loads if name not in stage.ports]
    problems += undriven(stage, loads, "nothing drives it: write [shaft_loads.{name}]")
    if problems:
        raise SpecError(problems)
    return {name: PortSpec(kind="torque", k=stage.ports[name].k, c=stage.ports[name].c) for name in loads}


def start_speeds(scene: SceneSpec, stage: Stage, input_port: str, loaded: Collection[str] = ()) -> dict[str, float]:
    """Speed (rad/s) of every torque port, those `loaded` among them, at the start: that of the input, and what is
    geared to it by its teeth; others begin at rest."""
    turning = turns(stage, input_port)
    return {
        name: scene.start.pinion_speed * float(turning.get(stage.rotor_of(port.body), 0))
        for name, port in stage.ports.items()
        if port.kind == "torque" or name in loaded
    }
