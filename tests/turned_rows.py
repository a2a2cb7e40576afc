"""Rows of tooth 0 as those of another tooth, by the formula of docs/architecture.md."""

from __future__ import annotations

import numpy as np

from gearfmu.body.body import Flank
from gearfmu.reduction.cyclic.modal import Modes


def on_tooth(modes: Modes | Flank, rows: np.ndarray, tooth: int, teeth: int) -> np.ndarray:
    """Rows (m, n) of the flanks of tooth 0 on another of so many teeth."""
    diameter = modes.diameter if isinstance(modes, Flank) else modes.nodal_diameter
    theta = 2 * np.pi * diameter * tooth / teeth
    result = rows * np.cos(theta)
    first, second = np.flatnonzero(modes.part == 1), np.flatnonzero(modes.part == 2)
    c, s = np.cos(theta[first]), np.sin(theta[first])
    result[:, first] = rows[:, first] * c - rows[:, second] * s
    result[:, second] = rows[:, first] * s + rows[:, second] * c
    return result
