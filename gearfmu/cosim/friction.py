"""Which clutches stick: the complementarity problem of dry friction at the instant when slips are zero."""

from __future__ import annotations

import numpy as np

MAX_SWEEPS = 500


def sticking_torques(delassus: np.ndarray, slip_acceleration: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Torques T (m,), |T| ≤ bound, such that each clutch sticks (slip acceleration zero) or transmits ±bound along
    its slip acceleration.

    delassus : (m, m) G = D M⁻¹ Dᵀ, 1/(kg·m²), positive definite; slip_acceleration : (m,) of the clutches without
    torque, rad/s²; bound : (m,) N·m. The slip acceleration with them is slip_acceleration − G T. Projected
    Gauss–Seidel, which converges for every positive definite G (Cottle, Pang, Stone: The Linear Complementarity
    Problem, 5.3).
    """
    torque = np.zeros_like(slip_acceleration)
    for _ in range(MAX_SWEEPS):
        before = torque.copy()
        for i in range(len(torque)):
            rest = slip_acceleration[i] - delassus[i] @ torque + delassus[i, i] * torque[i]
            torque[i] = min(max(rest / delassus[i, i], -bound[i]), bound[i])
        if np.all(np.abs(torque - before) <= 1e-14 * (bound + np.abs(torque))):
            break
    return torque
