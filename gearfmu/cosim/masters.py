"""Masters: a stage (motion in, torque out) and a drivetrain (torque in, motion out) stepped in turn.

gs_mean  Gauss–Seidel with mean torques. (1) Predict the drivetrain's motion over the step with the stage's last mean
         torque and take it back. (2) Step the stage along that motion: φ, w at the start, and the constant
         acceleration that ends at the predicted angle. (3) Step the drivetrain with the stage's mean torque of this
         very step. The momentum that crosses the cut is exact; the motion errs by O(H³) in a step: second order, no
         rollback of the stage, stable for ωH < 2, ω of the softest spring of the cut against the inertia behind it.
jacobi   The usual way of importers: all outputs are exchanged at the communication points and held. First order; second
         with `tau_next` held instead of `tau` (Wiring).

A stage under known torques (`Loaded`) has no drivetrain to exchange with: `TorqueMaster`.

Signals, which are known beforehand, reach the stage as value at the start and rate over the step.

A drivetrain meets its master at `Ports`: the motion ahead, and a step under given torques, by set, step, get, save and
restore alone. `SmoothPorts` are those of a PyUnit without clutch and backlash, where motion and step are products with
matrices made once: a tenth of the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.shaft_loads import Loaded, TorqueMaster
from gearfmu.cosim.signals import Signal
from gearfmu.cosim.units import Unit
from gearfmu.errors import CouplingError

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


RATE = "_rate"  # a signal's rate is the input of its name with this ending


@dataclass(frozen=True)
class Wiring:
    """Connections of an importer: motion inputs of the stage, rates of its signals, and the torque output that jacobi
    holds over a step ("tau" or "tau_next"). Start values of φ and w are given in any case; after them an input that is
    not connected stays as it is."""

    motion: tuple[str, ...] = KEYS
    rates: bool = True
    held: str = "tau"


@dataclass(frozen=True)
class Cut:
    """Where two units meet: the stage's spring ports and the drivetrain's torque ports of the same names, and signals
    that only the stage receives."""

    stage: Unit
    drive: Unit
    shafts: tuple[str, ...]
    signals: tuple[tuple[str, Signal], ...] = ()
    wiring: Wiring = Wiring()


class _Exchange:
    """Handles and buffers of a cut: `motion` is written by the ports, φ, w, a shaft by shaft."""

    def __init__(self, cut: Cut) -> None:
        self.cut, self.stage, wiring = cut, cut.stage, cut.wiring
        self.ports = ports_of(cut.drive, cut.shafts)
        self.signals = [signal for _, signal in cut.signals]
        self.rates = len(self.signals) if wiring.rates else 0
        known = [name for name, _ in cut.signals] + [name + RATE for name, _ in cut.signals][: self.rates]
        self._values = np.zeros(3 * len(cut.shafts) + len(known))
        self.motion, self._known = self._values[: 3 * len(cut.shafts)], self._values[3 * len(cut.shafts) :]
        self._start = self._some(tuple(dict.fromkeys(("phi", "w", *wiring.motion))), known)
        self._inputs = self._some(wiring.motion, known)

    def _some(self, keys: tuple[str, ...], known: list[str]) -> tuple[Any, np.ndarray | slice]:
        """Handle of these motions of every shaft and all known inputs, and their places among the values."""
        shafts = self.cut.shafts
        names = [f"{shaft}.{key}" for shaft in shafts for key in keys]
        places = [3 * k + KEYS.index(key) for k in range(len(shafts)) for key in keys]
        places += range(3 * len(shafts), len(self._values))
        whole = places == list(range(len(self._values)))
        return self.stage.resolve(names + known), slice(None) if whole else np.array(places)

    def begin(self, time: float) -> None:
        """Initialise the drivetrain, then the stage at the drivetrain's motion."""
        self.ports.begin(time)
        self.ports.now(self.motion)
        self._know(time, 0.0)
        self._send(self._start)
        self.stage.initialize(time)

    def send(self, time: float, h: float) -> None:
        """`motion` and the signals of the step to the stage."""
        if self.signals:
            self._know(time, h)
        self._send(self._inputs)

    def _know(self, time: float, h: float) -> None:
        for k, signal in enumerate(self.signals):
            first, last = signal.ends(time, time + h)
            self._known[k] = first
            if self.rates:
                self._known[len(self.signals) + k] = (last - first) / h if h else 0.0

    def _send(self, inputs: tuple[object, np.ndarray | slice]) -> None:
        handle, places = inputs
        self.stage.set(handle, self._values[places])

    def torque(self, key: str) -> Any:
        """Handle of one torque output of every shaft."""
        return self.stage.resolve([f"{shaft}.{key}" for shaft in self.cut.shafts])


class _CutMaster:
    """What both masters of a cut share: the start, and a state of drivetrain, torques held on it, work done on it.
    first: the torque output that is held from the start; second_order: whether the scheme is, with all inputs of the
    stage connected."""

    def __init__(self, cut: Cut, first: str, second_order: bool) -> None:
        everything = cut.wiring.motion == KEYS and cut.wiring.rates
        self.order = 2 if everything and second_order else 1
        self.exchange = _Exchange(cut)
        self.ports, self.stage = self.exchange.ports, cut.stage
        self._first = self.exchange.torque(first)

    def begin(self, time: float) -> None:
        """Initialise both units."""
        self.exchange.begin(time)
        self.ports.hold(self.stage.get(self._first).tolist())

    def save(self) -> Any:
        """State of drivetrain and ports."""
        return self.ports.unit.save(), list(self.ports.tau), self.ports.work, self.ports.throughput

    def restore(self, state: Any) -> None:
        """Back to a saved one."""
        drive, tau, self.ports.work, self.ports.throughput = state
        self.ports.tau = list(tau)
        self.ports.unit.restore(drive)


class GsMean(_CutMaster):
    """Master `gs_mean`."""

    def __init__(self, cut: Cut) -> None:
        super().__init__(cut, "tau", second_order=True)
        self._mean = self.exchange.torque("tau_mean")

    def step(self, time: float, h: float) -> None:
        """One communication step of both units."""
        self.ports.ahead(time, h, self.exchange.motion)
        self.exchange.send(time, h)
        self.stage.step(time, h)
        self.ports.step(self.stage.get(self._mean).tolist(), time, h)


class Jacobi(_CutMaster):
    """Master `jacobi`."""

    def __init__(self, cut: Cut) -> None:
        super().__init__(cut, cut.wiring.held, second_order=cut.wiring.held == "tau_next")

    def step(self, time: float, h: float) -> None:
        """One communication step of both units."""
        tau = self.stage.get(self._first).tolist()
        self.ports.hold(tau)
        self.ports.now(self.exchange.motion)
        self.exchange.send(time, h)
        self.stage.step(time, h)
        self.ports.step(tau, time, h)


Master = GsMean | Jacobi | TorqueMaster
MASTERS: dict[str, type[GsMean] | type[Jacobi]] = {"gs_mean": GsMean, "jacobi": Jacobi}


def master(name: str, cut: Cut | Loaded) -> Master:
    """The master of that name over `cut`; raises CouplingError with the known names."""
    if name not in MASTERS:
        raise CouplingError(f"no master {name!r}; choose one of {', '.join(MASTERS)}")
    return TorqueMaster(cut, name == "gs_mean") if isinstance(cut, Loaded) else MASTERS[name](cut)
