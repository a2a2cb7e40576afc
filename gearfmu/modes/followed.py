"""Modes followed by their shapes from one position of a stage to the next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment


def followed(mass: np.ndarray, shapes: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Order (k,) of the modes at every position in which column j is one mode throughout: from each position to the
    next those are paired whose modal assurance criteria (MAC) add up to the most.

    mass (n,): of the coordinates; shapes: (n, k) at each position, mass-normalised.
    """
    order = [np.arange(shapes[0].shape[1])]
    for before, after in zip(shapes[:-1], shapes[1:], strict=True):
        alike = (before.T @ (mass[:, None] * after)) ** 2
        order.append(linear_sum_assignment(alike, maximize=True)[1][order[-1]])
    return order
