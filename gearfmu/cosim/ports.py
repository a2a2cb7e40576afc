"""Ports: what a master asks of a drivetrain at its shafts – the motion ahead, and a step under given torques.

`Ports` does it with nothing but set, step, get, save and restore. `SmoothPorts` does the same for a PyUnit without
clutch and backlash, where motion and step are products with matrices made once: a tenth of the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.units import Unit

KEYS = ("phi", "w", "a")  # of a shaft, in the order of a motion buffer


class Ports:
    """Torque ports of any drivetrain, named after the stage's shafts.

    tau : torques on the drivetrain held at present, N·m. work, throughput : J given to the drivetrain through the
    ports, signed sum and sum of magnitudes. Motion buffers hold φ, w, a of every shaft, shaft by shaft.
    """

    def __init__(self, unit: Unit, shafts: Sequence[str]) -> None:
        self.unit, self.work, self.throughput, self.tau = unit, 0.0, 0.0, [0.0] * len(shafts)
        self._motion: Any = unit.resolve([f"{shaft}.{key}" for shaft in shafts for key in KEYS])
        self._phi: Any = unit.resolve([f"{shaft}.phi" for shaft in shafts])
        self._tau: Any = unit.resolve([f"{shaft}.tau" for shaft in shafts])

    def begin(self, time: float) -> None:
        """Initialise the drivetrain."""
        self.unit.initialize(time)

    def hold(self, tau: Sequence[float]) -> None:
        """Hold these torques from now on."""
        self.tau = list(tau)
        self.unit.set(self._tau, self.tau)

    def now(self, out: np.ndarray) -> None:
        """φ, w, a of the present, with the held torques."""
        out[:] = self.unit.get(self._motion)

    def ahead(self, time: float, h: float, out: np.ndarray) -> None:
        """φ, w of the present, and the constant acceleration that ends where the held torques lead in h s."""
        self.now(out)
        state = self.unit.save()
        self.unit.step(time, h)
        phi = self.unit.get(self._phi)
        out[2::3] = 2.0 * (phi - out[0::3] - out[1::3] * h) / h**2
        self.unit.restore(state)

    def step(self, tau: Sequence[float], time: float, h: float) -> None:
        """Step the drivetrain under these torques, and count their work."""
        before = self.unit.get(self._phi).tolist()
        self.hold(tau)
        self.unit.step(time, h)
        self._count(before, self.unit.get(self._phi).tolist())

    def _count(self, before: Sequence[float], after: Sequence[float]) -> None:
        for tau, start, end in zip(self.tau, before, after, strict=True):
            work = tau * (end - start)
            self.work += work
            self.throughput += abs(work)


class SmoothPorts(Ports):
    """Torque ports of a PyUnit whose steps are one product with a constant matrix (`PyUnit.is_smooth`).

    `step` directly after `ahead` takes the sources at the end of the step from the foreseen motion: they differ from
    those of the final motion by what the change of the mean torque since the last step moves the nodes, O(h³).
    """

    def __init__(self, unit: PyUnit, shafts: Sequence[str]) -> None:
        super().__init__(unit, shafts)
        self._unit, self._h, d = unit, 0.0, unit.dynamics
        self._nodes = [d.node[unit.network.torque_ports[shaft]] for shaft in shafts]
        self._foreseen: np.ndarray | None = None
        self._rows = np.zeros(0)

    def ahead(self, time: float, h: float, out: np.ndarray) -> None:
        """As `Ports.ahead`."""
        unit = self._unit
        if not unit.in_one_step(h):
            self._foreseen = None
            super().ahead(time, h, out)
            return
        if h != self._h:
            self._prepare(h)
        np.dot(self._rows, unit.foresee(time, h), out=out)
        self._foreseen = unit.state.x

    def step(self, tau: Sequence[float], time: float, h: float) -> None:
        """As `Ports.step`."""
        unit = self._unit
        if self._foreseen is not unit.state.x or h != self._h:
            super().step(tau, time, h)
            return
        self.tau, start = list(tau), unit.state.x
        unit.complete(self.tau, time, h)
        end = unit.state.x
        self._count([start.item(node) for node in self._nodes], [end.item(node) for node in self._nodes])

    def _prepare(self, h: float) -> None:
        """Rows that make φ, w and the acceleration ahead of [x, u at the start, u at the end]."""
        d = self._unit.dynamics
        step, self._h = d.transition(self._unit.state.mode, h), h
        rows: np.ndarray = np.zeros((3 * len(self._nodes), step.shape[1]))
        for k, node in enumerate(self._nodes):
            rows[3 * k, node] = rows[3 * k + 1, d.n + node] = 1.0
            rows[3 * k + 2] = 2.0 * (step[node] - rows[3 * k] - h * rows[3 * k + 1]) / h**2
        self._rows = rows


def ports_of(unit: Unit, shafts: Sequence[str]) -> Ports:
    """The fastest ports that the unit allows."""
    return SmoothPorts(unit, shafts) if isinstance(unit, PyUnit) and unit.is_smooth else Ports(unit, shafts)
