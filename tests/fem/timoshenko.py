"""Free bending of a uniform Timoshenko beam: the zeros of its end forces' determinant."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq


def free_bending(
    length: float, bending: float, shear: float, mass: float, inertia: float, bracket: tuple[float, float]
) -> float:
    """Frequency (rad/s) between those of `bracket`. bending, shear: stiffness (N·m², N) of the section; mass, inertia:
    of rotation, per length (kg/m, kg·m). The state (w, θ, M, Q) is carried over the length by the matrix
    exponential."""

    def determinant(omega: float) -> float:
        a = np.zeros((4, 4))
        a[0, 1], a[0, 3], a[1, 2] = 1.0, 1 / shear, 1 / bending
        a[2, 3], a[2, 1], a[3, 0] = -1.0, -inertia * omega**2, -mass * omega**2
        scale = np.array([length, 1.0, bending / length, bending / length**2])
        return float(np.linalg.det(expm(a * length * scale / scale[:, None])[2:, :2]))

    return brentq(determinant, *bracket, xtol=1e-6, rtol=1e-14)
