"""Masters: a stage (motion in, torque out) and a drivetrain (torque in, motion out) stepped in turn.

gs_mean  Gauss–Seidel with mean torques. (1) Predict the drivetrain's motion over the step with the stage's last mean
         torque and take it back. (2) Step the stage along that motion: φ, w at the start, and the constant
         acceleration that ends at the predicted angle. (3) Step the drivetrain with the stage's mean torque of this
         very step. The momentum that crosses the cut is exact; the motion errs by O(H³) in a step: second order, no
         rollback of the stage, stable for ωH < 2, ω of the softest spring of the cut against the inertia behind it.
jacobi   The usual way of importers: all outputs are exchanged at the communication points and held. First order; second
         with `tau_next` held instead of `tau`.

A stage under known torques (`ShaftLoads`) has no drivetrain to exchange with: `TorqueMaster`.

Signals, which are known beforehand, reach the stage as value at the start and rate over the step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.shaft_loads import ShaftLoads
from gearfmu.cosim.signals import Ramp
from gearfmu.cosim.units import Unit
from gearfmu.errors import CouplingError

KEYS = ("phi", "w", "a")  # of a shaft, in the order of a motion buffer
RATE = "_rate"  # a signal's rate is the input of its name with this ending


@dataclass(frozen=True)
class Cut:
    """Where two units meet: the stage's spring ports and the drivetrain's torque ports of the same names, or torque
    ports under loads; and signals that only the stage receives."""

    stage: Unit
    drive: PyUnit | ShaftLoads
    signals: tuple[tuple[str, Ramp], ...] = ()


class _CutMaster:
    """Both masters of a drivetrain: how they begin, and what they send. order: of the scheme; motion: φ, w, a shaft by
    shaft, as the stage gets them next."""

    order: int

    def __init__(self, cut: Cut) -> None:
        assert isinstance(cut.drive, PyUnit), "loads have a master of their own"
        self.stage, self.drive = cut.stage, cut.drive
        self.signals = [signal for _, signal in cut.signals]
        names = [f"{shaft}.{key}" for shaft in self.drive.ports for key in KEYS]
        self._values = np.zeros(len(names) + 2 * len(cut.signals))
        self.motion, self._known = np.split(self._values, [len(names)])
        names += [name + ending for ending in ("", RATE) for name, _ in cut.signals]
        self._inputs: Any = cut.stage.resolve(names)
        self._tau, self._mean = self._torque("tau"), self._torque("tau_mean")

    def _torque(self, key: str) -> Any:
        """Handle of one torque output of every shaft."""
        return self.stage.resolve([f"{shaft}.{key}" for shaft in self.drive.ports])

    def begin(self, time: float) -> None:
        """Initialise the drivetrain, then the stage at the drivetrain's motion."""
        self.drive.initialize(time)
        self.drive.now(self.motion)
        self.send(time, 0.0)
        self.stage.initialize(time)
        self.drive.hold(self.stage.get(self._tau).tolist())

    def send(self, time: float, h: float) -> None:
        """`motion` and the signals of the step to the stage."""
        for k, signal in enumerate(self.signals):
            first, last = signal.ends(time, time + h)
            self._known[k] = first
            self._known[len(self.signals) + k] = (last - first) / h if h else 0.0
        self.stage.set(self._inputs, self._values)


class GsMean(_CutMaster):
    """Master `gs_mean`."""

    order = 2

    def step(self, time: float, h: float) -> None:
        """One communication step of both units."""
        self.drive.ahead(time, h, self.motion)
        self.send(time, h)
        self.stage.step(time, h)
        self.drive.drive(self.stage.get(self._mean).tolist(), time, h)


class Jacobi(_CutMaster):
    """Master `jacobi`."""

    order = 1

    def step(self, time: float, h: float) -> None:
        """One communication step of both units."""
        tau = self.stage.get(self._tau).tolist()
        self.drive.hold(tau)
        self.drive.now(self.motion)
        self.send(time, h)
        self.stage.step(time, h)
        self.drive.drive(tau, time, h)


class TorqueMaster:
    """Steps a stage under loads. foreseen: whether the torque is the mean of the step or that of its beginning."""

    def __init__(self, stage: Unit, loads: ShaftLoads, foreseen: bool) -> None:
        self.stage, self.loads, self.foreseen, self.order = stage, loads, foreseen, 2 if foreseen else 1
        self._tau, self._phi, self._w = (
            stage.resolve([f"{name}.{key}" for name in loads.laws]) for key in ("tau", "phi", "w")
        )

    def begin(self, time: float) -> None:
        """Initialise the stage at rest under the torques of the start."""
        self.loads.hold(time)
        self.stage.set(self._tau, self.loads.tau)
        self.stage.initialize(time)

    def step(self, time: float, h: float) -> None:
        """One communication step."""
        if self.foreseen:
            self.loads.hold_mean(time, h)
        else:
            self.loads.hold(time)
        self.stage.set(self._tau, self.loads.tau)
        start = self.stage.get(self._phi).copy()
        self.stage.step(time, h)
        self.loads.count(self.stage.get(self._phi) - start, self.stage.get(self._w))


Master = GsMean | Jacobi | TorqueMaster
MASTERS: dict[str, type[GsMean] | type[Jacobi]] = {"gs_mean": GsMean, "jacobi": Jacobi}


def master(name: str, cut: Cut) -> Master:
    """The master of that name over `cut`; raises CouplingError with the known names."""
    if name not in MASTERS:
        raise CouplingError(f"no master {name!r}; choose one of {', '.join(MASTERS)}")
    if isinstance(cut.drive, ShaftLoads):
        return TorqueMaster(cut.stage, cut.drive, name == "gs_mean")
    return MASTERS[name](cut)
