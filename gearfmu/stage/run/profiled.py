"""Inputs of a stage whose torque and speed follow straight lines over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.simulate import Steady, Wound

BETWEEN = 8  # largest part of the range of torques between two of them whose winding is computed: 1/BETWEEN
BACKLASH = 0.02  # of the largest torque: within it a torque that changes its sign passes the backlash


@dataclass(frozen=True)
class Line:
    """Straight lines through points (n,), constant outside: value, slope and integral at a time."""

    time: np.ndarray
    values: np.ndarray

    @cached_property
    def _areas(self) -> np.ndarray:
        steps = 0.5 * (self.values[1:] + self.values[:-1]) * np.diff(self.time)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def _slopes(self) -> np.ndarray:
        return np.append(np.diff(self.values) / np.diff(self.time), 0.0)

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, slopes and integrals from the first point on at times (n,). The slope at a corner is that behind
        it."""
        k = np.searchsorted(self.time, times, side="right") - 1
        point = np.maximum(k, 0)
        since, first, slope = times - self.time[point], self.values[point], np.where(k < 0, 0.0, self._slopes[point])
        return first + slope * since, slope, self._areas[point] + (first + 0.5 * slope * since) * since


@dataclass(frozen=True)
class Profiled(Wound):
    """Inputs of a stage whose input follows a speed over time (Line, rad/s) while shafts and meshes are wound up by a
    torque over time (Line, N·m, on the input), as `Steady` does for constant ones. For spring ports without a chain.

    parameters: as of `Steady`. What the stage takes up under a torque, its mean over a pitch, is computed at the
    torques of the points and between them at eighths of their range, and follows straight lines over the torque.
    """

    model: StageModel
    torque: Line
    speed: Line
    parameters: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def winding(self) -> Line:
        """Angle of the input (rad) over the torque on it (N·m, in place of the time)."""
        torques = winding_torques(self.torque.values)
        still = Steady(self.model, 0.0, 0.0, parameters=self.parameters)
        carried = torques - 0.5 * self._rubbed * np.abs(torques)
        return Line(torques, np.array([replace(still, torque=float(torque)).winding for torque in carried]))

    @cached_property
    def _rubbed(self) -> float:
        """Part of the torque that friction takes, negative where the speed is: at the largest torque and speed. None is
        counted where the speed changes its sign, for friction would jump there."""
        torque, speed = (float(max(line.values, key=abs)) for line in (self.torque, self.speed))
        if np.ptp(np.sign(self.speed.values[self.speed.values != 0.0])) if speed else True:
            return 0.0
        return Steady(self.model, speed, torque, parameters=self.parameters).rubbed * float(np.sign(speed))

    def under(self, parameters: Mapping[str, float]) -> Profiled:
        return replace(self, parameters=parameters)

    def over(self, times: np.ndarray) -> dict[str, np.ndarray]:
        shafts, values = self.model.shafts, {}
        torque, growing, _ = self.torque.at(times)
        speed, rate, angle = self.speed.at(times)
        taken, yielding, _ = self.winding.at(torque)
        lost = self._rubbed * np.sign(torque)
        for port, turn in ((shafts.input, 1.0), (shafts.output, 1.0 / shafts.ratio)):
            stiffness = self.model.stage.ports[port].k
            assert stiffness is not None, "the port is a spring"
            driven = port == shafts.input
            wound = (1.0 if driven else -(1.0 - lost)) / turn / stiffness
            values[f"{port}.phi"] = wound * torque + (taken if driven else 0.0) + turn * angle
            values[f"{port}.w"] = wound * growing + (yielding * growing if driven else 0.0) + turn * speed
            values[f"{port}.a"] = turn * rate
        return values


def winding_torques(values: np.ndarray) -> np.ndarray:
    """Torques (m,), ascending, at which to compute what a stage takes up: those given (n,), others between them, and
    both sides of the backlash where the sign changes."""
    low, high = float(values.min()), float(values.max())
    found = set(values.tolist()) if values.size <= 4 * BETWEEN else {low, high}
    found |= set(np.linspace(low, high, BETWEEN + 1).tolist()) if high > low else set()
    most = BACKLASH * max(abs(low), abs(high))
    if low < 0 < high:
        found = {torque for torque in found if abs(torque) > most} | {-most, most}
    return np.array(sorted(found))
