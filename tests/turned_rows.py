"""Rows of tooth 0 as those of another tooth, by the formula of docs/architecture.md."""

from __future__ import annotations

import numpy as np

from gearfmu.reduction.cyclic.modal import Modes


def on_tooth(modes: Modes, rows: np.ndarray, tooth: int, teeth: int) -> np.ndarray:
    """Rows (m, n) of the flanks of tooth 0 on another of so many teeth."""
    theta = 2 * np.pi * modes.nodal_diameter * tooth / teeth
    result = rows * np.cos(theta)
    first, second = np.flatnonzero(modes.part == 1), np.flatnonzero(modes.part == 2)
    c, s = np.cos(theta[first]), np.sin(theta[first])
    result[:, first] = rows[:, first] * c - rows[:, second] * s
    result[:, second] = rows[:, first] * s + rows[:, second] * c
    return result
