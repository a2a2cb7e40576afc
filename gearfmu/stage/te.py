"""Quasi-static loaded transmission error over one pitch: wheel held, torque on the pinion, by the contact routine of
the step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel, TeState
from gearfmu.stage.model import StageModel

TANGENT = 1e-4
LEAST = 1e-5  # of torque_max: below it te goes on along its tangent to the unloaded pair
SHARES = 4


@dataclass(frozen=True)
class TeResult:
    """torque (T,) N·m · position (P,) in pitches · te (T, P) m, positive under load · stiffness (T, P) N/m, tangent
    dF/dte with F along the line of action
    · shares (T, P, K): part of the mesh force that each tooth pair carries, pairs in the order in which they come
    into mesh: a pair keeps its column through the pitch, sorted by tooth number.
    """

    torque: np.ndarray
    position: np.ndarray
    te: np.ndarray
    stiffness: np.ndarray
    shares: np.ndarray


def loaded_te(
    model: StageModel, torques: Sequence[float], positions: int = 41, rigid_bearings: bool = False, **parameters: float
) -> TeResult:
    """te = r_b1 φ_1 + r_b2 φ_2 of the bore nodes at positions i/N of one pitch (no end point), wheel held at
    −position · 2π/z_2.

    torques: N·m on the pinion; positive drives, 0 is the limit of a vanishing driving torque: the unloaded (kinematic)
    transmission error. rigid_bearings: the bore nodes are held on their axes. parameters: of the kernel, e.g.
    slices=10. SimulationError(no_equilibrium) where there is none.
    """
    held = {"effect.bearings": 0.0} if rigid_bearings else {}
    kernel = statics_of(model, **held, **parameters)
    pitch = 2 * math.pi / model.pair.gears[1].teeth
    base_radius = PairGeometry.of(model.pair).gears[0].r_b
    position = np.arange(positions) / positions
    te, stiffness, shares = (
        np.empty((len(torques), positions)),
        np.empty((len(torques), positions)),
        np.zeros((len(torques), positions, SHARES)),
    )
    least = LEAST * model.pair.torque_max
    for i, torque in enumerate(torques):
        carried = torque if abs(torque) >= least else math.copysign(least, torque)
        for j, part in enumerate(position):
            state = kernel.transmission(-part * pitch, carried)
            tangent = _tangent(kernel, -part * pitch, carried)
            te[i, j] = state.te + (torque - carried) / tangent
            stiffness[i, j] = tangent / base_radius
            shares[i, j] = _shares(state)
    return TeResult(np.asarray(torques, float), position, te, stiffness, shares)


def statics_of(model: StageModel, **parameters: float) -> Kernel:
    """The kernel prepared for statics: level `rigid`, all flexibility is static. Torque and angle act on the bores:
    chains of the ports, whose clutches are open at the start, are left out. parameters: of the kernel."""
    kernel = model.kernel(**{"level": 0.0, **parameters})
    kernel.prepare()
    return kernel


def _tangent(kernel: Kernel, phi: float, torque: float) -> float:
    """dT/dte (N) by a central difference of ±TANGENT·T."""
    ends = [kernel.transmission(phi, torque * (1 + sign * TANGENT)).te for sign in (-1, 1)]
    return 2 * TANGENT * torque / (ends[1] - ends[0])


def _shares(state: TeState) -> np.ndarray:
    """Shares by tooth number of the pinion: pair k of the path is tooth k − 2 …, counted from the tooth that leaves
    the mesh."""
    total = sum(sum(forces) for forces in state.forces.values()) or 1.0
    shares = np.zeros(SHARES)
    for (_, tooth), forces in state.forces.items():
        if -(SHARES // 2) <= tooth < SHARES - SHARES // 2:
            shares[tooth + SHARES // 2] += sum(forces) / total
    return shares
