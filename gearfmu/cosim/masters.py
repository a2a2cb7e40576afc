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
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.cosim.ports import KEYS, Ports, ports_of
from gearfmu.cosim.shaft_loads import Loaded, TorqueMaster
from gearfmu.cosim.signals import Signal
from gearfmu.cosim.units import Unit
from gearfmu.errors import CouplingError

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


class _Exchanging:
    """State that both masters of a cut save: the drivetrain, torques held on it, work done on it."""

    ports: Ports

    def save(self) -> Any:
        """State of drivetrain and ports."""
        return self.ports.unit.save(), list(self.ports.tau), self.ports.work, self.ports.throughput

    def restore(self, state: Any) -> None:
        """Back to a saved one."""
        drive, tau, self.ports.work, self.ports.throughput = state
        self.ports.tau = list(tau)
        self.ports.unit.restore(drive)


class GsMean(_Exchanging):
    """Master `gs_mean`."""

    def __init__(self, cut: Cut) -> None:
        self.order = 2 if _everything(cut.wiring) else 1
        self.exchange = _Exchange(cut)
        self.ports, self.stage = self.exchange.ports, cut.stage
        self._tau, self._mean = self.exchange.torque("tau"), self.exchange.torque("tau_mean")

    def begin(self, time: float) -> None:
        """Initialise both units."""
        self.exchange.begin(time)
        self.ports.hold(self.stage.get(self._tau).tolist())

    def step(self, time: float, h: float) -> None:
        """One communication step of both units."""
        self.ports.ahead(time, h, self.exchange.motion)
        self.exchange.send(time, h)
        self.stage.step(time, h)
        self.ports.step(self.stage.get(self._mean).tolist(), time, h)


class Jacobi(_Exchanging):
    """Master `jacobi`."""

    def __init__(self, cut: Cut) -> None:
        self.exchange = _Exchange(cut)
        self.ports, self.stage = self.exchange.ports, cut.stage
        self._held = self.exchange.torque(cut.wiring.held)
        self.order = 2 if _everything(cut.wiring) and cut.wiring.held == "tau_next" else 1

    def begin(self, time: float) -> None:
        """Initialise both units."""
        self.exchange.begin(time)
        self.ports.hold(self.stage.get(self._held).tolist())

    def step(self, time: float, h: float) -> None:
        """One communication step of both units."""
        tau = self.stage.get(self._held).tolist()
        self.ports.hold(tau)
        self.ports.now(self.exchange.motion)
        self.exchange.send(time, h)
        self.stage.step(time, h)
        self.ports.step(tau, time, h)


def _everything(wiring: Wiring) -> bool:
    """Whether all inputs of the stage are connected."""
    return wiring.motion == KEYS and wiring.rates


Master = GsMean | Jacobi | TorqueMaster
MASTERS: dict[str, type[GsMean] | type[Jacobi]] = {"gs_mean": GsMean, "jacobi": Jacobi}


def master(name: str, cut: Cut | Loaded) -> Master:
    """The master of that name over `cut`; raises CouplingError with the known names."""
    if name not in MASTERS:
        raise CouplingError(f"no master {name!r}; choose one of {', '.join(MASTERS)}")
    return TorqueMaster(cut, name == "gs_mean") if isinstance(cut, Loaded) else MASTERS[name](cut)
