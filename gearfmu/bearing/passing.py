"""What passing rolling elements do: how often, and how far the rings move under a constant load.

Without slip the cage turns at ½ (1 − γ) of the inner ring's speed, γ = D_w cos α / D_pw (Harris, *Rolling Bearing
Analysis*, 4th ed., ch. 8).
"""

from __future__ import annotations

import math

import numpy as np

from gearfmu.bearing.law import Law, Rolling
from gearfmu.bearing.rest import rest

_ANGLES = 24  # of the cage over the distance of two rolling elements


def pass_orders(law: Law) -> tuple[float, float]:
    """Rolling elements that pass a point of the outer, and of the inner ring, in one revolution of the inner ring."""
    gamma = law.diameter * math.cos(law.contact_angle) / law.pitch_diameter
    return 0.5 * law.count * (1 - gamma), 0.5 * law.count * (1 + gamma)


def pass_swing(bearing: Rolling, load: np.ndarray) -> np.ndarray:
    """(5,) m, rad, peak to peak: motion of the inner ring under a constant load (5,) while rolling elements pass.
    NoRestError: `rest`."""
    count = bearing.rows[0].law.count
    alone = bearing.spread(1)
    angles = 2 * math.pi / count * np.arange(_ANGLES) / _ANGLES
    return np.ptp([rest(alone.at(angle), load).displacement for angle in angles], axis=0)
