"""The linearised stage at the outer rings of its bearings: how it answers where its housing moves.

Rings that move by u pull on the oscillators through the rows N, κ of the supports, and open gaps by Pᵀu, where the
support forces of a stage on rigid ground are B = N q + P λ (theory 2d, 8). With A = (Q + S)⁻¹ the coordinates (q, u)
have the stiffness, damping and mass

    K = [ω²M + WᵀAW    −Nᵀ + WᵀAPᵀ]      C = Σ c eᵀe,  e of contacts and ports S A [W Pᵀ],      M = [M  0]
        [−N + PAW       κ + PAPᵀ  ]          of supports [E  −K_s⁻¹κ]; of q also 2ζωM          [0  0]
                                             and 2Ω (y xᵀ − x yᵀ) of turning rotors (17l)

and the rings the dynamic stiffness D(ω) = K_uu + iωC_uu − (K_uq + iωC_uq)(K_qq + iωC_qq − ω²M)⁻¹(K_qu + iωC_qu). The
housing takes f = f₀ − D u, f₀ the forces on rigid ground. Rings that move together as one rigid body meet the stage's
mass and no stiffness.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import scipy.linalg as sl

from gearfmu.kernel.linear import GROUND, LinearModel
from gearfmu.modes.linear import linearised
from gearfmu.stage import StageModel
from gearfmu.stage.assembly.blob import read_blob

HIGHEST = 10e3  # Hz
SPARE = 1.5  # modes up to this times the highest frequency are dynamic


@dataclass(frozen=True)
class Rings:
    """s directions of outer rings and k modes of the stage: names (s,) of the forces; squared (k,): ω² (rad/s)²;
    damping (k, k) 1/s, with gyroscopic forces; drive (s, k): K_uq, drive_damping (s, k): C_uq; stiffness, loss (s, s):
    K_uu with the static share of all higher modes, and C_uu. Directions are those of forces on the housing, N, N·m."""

    names: tuple[str, ...]
    squared: np.ndarray
    damping: np.ndarray
    drive: np.ndarray
    drive_damping: np.ndarray
    stiffness: np.ndarray
    loss: np.ndarray

    def dynamic_stiffness(self, omega: np.ndarray) -> np.ndarray:
        """D (L, s, s) at ω (L,) rad/s; complex; symmetric where no rotor turns."""
        w = 1j * omega[:, None, None]
        pulled = self.drive + w * self.drive_damping
        inner = w * self.damping + w**2 * np.eye(len(self.squared)) + np.diag(self.squared)
        return self.stiffness + w * self.loss - pulled @ np.linalg.solve(inner, pulled.transpose(0, 2, 1))


def stage_rings(model: StageModel, torque: float, speeds: Mapping[str, float] = MappingProxyType({})) -> Rings:
    """The stage under `torque` (N·m on the input), dynamic up to HIGHEST, at the outer rings of all its supports
    on the ground. speeds: of rotors, rad/s, by name; 0 where absent. SimulationError where it finds no equilibrium."""
    found = linearised(model, torque, 0.0)
    linear, sections = found.linear, read_blob(model.blob)
    names = str(sections["support_names"]).split("|")
    on_ground = np.array([name.startswith("bearing.") for name in names])
    kappa = np.asarray(sections["kappa0"], dtype=float).reshape(len(names), -1)
    springs = np.diag(linear.support_compliance)
    springs = springs if found.coupling is None else springs + found.coupling
    coupling = np.linalg.inv(found.compliance)
    rows = np.hstack([linear.rows, linear.support_forces.T[:, on_ground]])
    stretch = linear.own @ coupling @ rows
    across = np.hstack([linear.damper_rows, -(springs @ kappa)[:, on_ground]])
    n = len(linear.mass)
    full = rows.T @ coupling @ rows
    full[:n, :n] += np.diag(linear.mass * linear.omega**2)
    full[n:, :n] -= linear.support_rows[on_ground]
    full[:n, n:] -= linear.support_rows[on_ground].T
    full[n:, n:] += kappa[np.ix_(on_ground, on_ground)]
    loss = stretch.T @ (linear.dashpot[:, None] * stretch) + across.T @ (linear.damper[:, None] * across)
    loss[:n, :n] += np.diag(2 * linear.zeta * linear.omega * linear.mass) + _whirling(model, linear, sections, speeds)
    kept = tuple(name for name, own in zip(names, on_ground, strict=True) if own)
    return rings_of(kept, full, loss, linear.mass, SPARE * 2 * math.pi * HIGHEST)


def _whirling(
    model: StageModel, linear: LinearModel, sections: Mapping[str, object], speeds: Mapping[str, float]
) -> np.ndarray:
    """(n, n): gyroscopic forces of rotors at their speeds; of patterns of nodal diameter 0 and 1."""
    found, names = np.zeros((len(linear.mass),) * 2), list(model.stage.rotors)
    if "whirl" not in sections:
        return found
    ground = np.flatnonzero(linear.group == GROUND)
    rotors = np.asarray(sections["whirl"]).ravel()
    rows = np.asarray(sections["whirl_rows0"]).reshape(len(rotors), 2, -1)[:, :, linear.number[ground]]
    for rotor, (x, y) in zip(rotors, rows, strict=True):
        speed = speeds.get(names[rotor], 0.0)
        found[np.ix_(ground, ground)] += 2 * speed * (np.outer(y, x) - np.outer(x, y))
    return found


def rings_of(names: Sequence[str], stiffness: np.ndarray, loss: np.ndarray, mass: np.ndarray, highest: float) -> Rings:
    """`Rings` of n coordinates of masses `mass` (n,) and the rings' s behind them: stiffness, loss (n + s, n + s).
    Modes above `highest`, rad/s, answer statically."""
    n, scale = len(mass), 1 / np.sqrt(mass)
    squared, shapes = sl.eigh(scale[:, None] * _even(stiffness[:n, :n]) * scale)
    shapes = scale[:, None] * shapes
    low = squared < highest**2
    drive = stiffness[n:, :n] @ shapes
    static = drive[:, ~low] / squared[~low] @ drive[:, ~low].T
    shapes = shapes[:, low]
    return Rings(
        names=tuple(names),
        squared=squared[low],
        damping=shapes.T @ loss[:n, :n] @ shapes,
        drive=drive[:, low],
        drive_damping=loss[n:, :n] @ shapes,
        stiffness=_even(stiffness[n:, n:]) - static,
        loss=_even(loss[n:, n:]),
    )


def _even(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)
