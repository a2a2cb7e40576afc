"""Directions in the transverse plane, and turns about the z axis."""

from __future__ import annotations

import numpy as np


def direction(angle: float | np.ndarray) -> np.ndarray:
    """Unit vectors (…, 2) at angles (…) from +x, rad."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def about_z(angle: float) -> np.ndarray:
    """(3, 3): turns vectors by `angle` (rad) about +z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def frames(teeth: int) -> np.ndarray:
    """(z, 6, 6): vectors of each tooth's frame in the frame of the gear, displacements and rotations."""
    return np.array([np.kron(np.eye(2), about_z(angle)) for angle in 2 * np.pi * np.arange(teeth) / teeth])
