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
