"""Masters: who steps when, with what. One stage (motion in, torque out) and one drivetrain (torque in, motion out).

gs_mean  Gauss–Seidel with mean torques. (1) Predict the drivetrain's motion over the step with the stage's last mean
         torque and take it back. (2) Step the stage along that motion: φ, w at the start, and the constant
         acceleration that ends at the predicted angle. (3) Step the drivetrain with the stage's mean torque of this
         very step. The momentum that crosses the cut is exact; the motion errs by O(H³) in a step: second order, no
         rollback of the stage, stable for ωH < 2, ω of the softest spring of the cut against the inertia behind it.
jacobi   What importers do: all outputs are exchanged at the communication points and held. First order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.cosim.signals import Signal
from gearfmu.cosim.units import Unit
from gearfmu.errors import CouplingError


@dataclass(frozen=True)
class Cut:
    """Where two units meet: the stage's spring ports and the drivetrain's torque ports of the same names, and signals
    that only the stage receives."""

    stage: Unit
    drive: Unit
    shafts: tuple[str, ...]
    signals: tuple[tuple[str, Signal], ...] = ()


class _Exchange:
    """Handles and buffers of a cut, and the work that crosses it on the drivetrain's side."""

    def __init__(self, cut: Cut) -> None:
        self.cut, self.work, self.throughput = cut, 0.0, 0.0
        motion = [f"{shaft}.{key}" for shaft in cut.shafts for key in ("phi", "w", "a")]
        self.stage_motion: Any = cut.stage.resolve(motion)
        self.stage_signals: Any = cut.stage.resolve([name for name, _ in cut.signals])
        self.stage_tau: Any = cut.stage.resolve([f"{shaft}.tau" for shaft in cut.shafts])
        self.stage_mean: Any = cut.stage.resolve([f"{shaft}.tau_mean" for shaft in cut.shafts])
        self.drive_motion: Any = cut.drive.resolve(motion)
        self.drive_phi_w: Any = cut.drive.resolve([f"{shaft}.{key}" for key in ("phi", "w") for shaft in cut.shafts])
        self.drive_phi: Any = cut.drive.resolve([f"{shaft}.phi" for shaft in cut.shafts])
        self.drive_tau: Any = cut.drive.resolve([f"{shaft}.tau" for shaft in cut.shafts])

    def set_signals(self, ends: Callable[[float, float], float], t0: float, t1: float) -> None:
        if self.cut.signals:
            self.cut.stage.set(self.stage_signals, [ends(*signal.ends(t0, t1)) for _, signal in self.cut.signals])

    def begin(self, time: float) -> None:
        """Initialise the drivetrain, then the stage at the drivetrain's motion."""
        cut = self.cut
        cut.drive.initialize(time)
        cut.stage.set(self.stage_motion, cut.drive.get(self.drive_motion))
        self.set_signals(lambda first, _: first, time, time)
        cut.stage.initialize(time)

    def step_drive(self, tau: np.ndarray, phi: np.ndarray, time: float, h: float) -> None:
        """Step the drivetrain from the angles phi under torques that are held, and count their work."""
        drive = self.cut.drive
        drive.set(self.drive_tau, tau)
        drive.step(time, h)
        work = tau * (drive.get(self.drive_phi) - phi)
        self.work += float(work.sum())
        self.throughput += float(np.abs(work).sum())


class GsMean:
    """Master `gs_mean`."""

    order = 2

    def __init__(self, cut: Cut) -> None:
        self.exchange = _Exchange(cut)
        self._tau, self._motion = np.zeros(len(cut.shafts)), np.zeros((3, len(cut.shafts)))

    def begin(self, time: float) -> None:
        """Initialise both units."""
        self.exchange.begin(time)
        self._tau[:] = self.exchange.cut.stage.get(self.exchange.stage_tau)
        self.exchange.cut.drive.set(self.exchange.drive_tau, self._tau)

    def step(self, time: float, h: float) -> None:
        """One communication step of both units."""
        x, stage = self.exchange, self.exchange.cut.stage
        motion = self._predict(time, h)
        stage.set(x.stage_motion, motion.T.ravel())
        x.set_signals(lambda first, last: 0.5 * (first + last), time, time + h)
        stage.step(time, h)
        self._tau[:] = stage.get(x.stage_mean)
        x.step_drive(self._tau, motion[0], time, h)

    def _predict(self, time: float, h: float) -> np.ndarray:
        """(3, shafts) φ, w at the start of the step, and the constant acceleration that leads to the predicted
        angle."""
        x, drive = self.exchange, self.exchange.cut.drive
        motion = self._motion
        motion[:2].flat = drive.get(x.drive_phi_w)
        state = drive.save()
        drive.set(x.drive_tau, self._tau)
        drive.step(time, h)
        motion[2] = 2.0 * (drive.get(x.drive_phi) - motion[0] - motion[1] * h) / h**2
        drive.restore(state)
        return motion


class Jacobi:
    """Master `jacobi`."""

    order = 1

    def __init__(self, cut: Cut) -> None:
        self.exchange = _Exchange(cut)

    def begin(self, time: float) -> None:
        """Initialise both units."""
        x = self.exchange
        x.begin(time)
        x.cut.drive.set(x.drive_tau, x.cut.stage.get(x.stage_tau))

    def step(self, time: float, h: float) -> None:
        """One communication step of both units."""
        x, cut = self.exchange, self.exchange.cut
        tau, motion = cut.stage.get(x.stage_tau).copy(), cut.drive.get(x.drive_motion).copy()
        cut.stage.set(x.stage_motion, motion)
        x.set_signals(lambda first, _: first, time, time + h)
        cut.stage.step(time, h)
        x.step_drive(tau, motion[0::3], time, h)


Master = GsMean | Jacobi
MASTERS: dict[str, type[GsMean] | type[Jacobi]] = {"gs_mean": GsMean, "jacobi": Jacobi}


def master(name: str, cut: Cut) -> Master:
    """The master of that name over `cut`; raises CouplingError with the known names."""
    if name not in MASTERS:
        raise CouplingError(f"no master {name!r}; choose one of {', '.join(MASTERS)}")
    return MASTERS[name](cut)
