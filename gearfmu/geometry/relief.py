"""Tip relief: material taken off the flank towards the tip, normal to the involute."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class ReliefCurve:
    """Relief δ(s) = amount·((s − start)/(s_a − start))² for s > start, else 0 (tip relief C_a of ISO 21771).

    amount: m, normal to the involute, at the roll s_a of the tip circle. start, s_a: rolls, m; start < s_a.
    """

    amount: float
    start: float
    s_a: float

    def depth(self, roll: ArrayLike) -> np.ndarray:
        """δ (m), positive into the tooth, at rolls of any shape."""
        part = np.maximum(np.asarray(roll, float) - self.start, 0.0) / (self.s_a - self.start)
        return self.amount * part**2

    def slope(self, roll: ArrayLike) -> np.ndarray:
        """dδ/ds (dimensionless)."""
        reach = self.s_a - self.start
        return 2 * self.amount * np.maximum(np.asarray(roll, float) - self.start, 0.0) / reach**2
