"""Bearings for the tests of the law: one of every kind, and small helpers."""

from __future__ import annotations

import numpy as np

from gearfmu.bearing.law import Balls, Rollers, Rolling, Row

DEEP = Balls(8, 12e-3, 50e-3, (0.52, 0.53), 0.0, 10e-6)
ANGULAR = Balls(12, 9.5e-3, 46e-3, (0.515, 0.525), np.radians(30.0), 0.0)
ROLLERS = Rollers(13, 8e-3, 46e-3, 10e-3, 8e-6)
TAPER = Rollers(17, 7.5e-3, 50e-3, 14e-3, 0.0, np.radians(15.0))
KINDS = {
    "deep groove": Rolling((Row(DEEP),)),
    "angular": Rolling((Row(ANGULAR),)),
    "mirrored, beside the centre": Rolling((Row(ANGULAR, 20e-3, -1, 5e-6),)),
    "two in O arrangement": Rolling((Row(ANGULAR, -30e-3, 1, 8e-6), Row(ANGULAR, 30e-3, -1, 8e-6)), 4),
    "roller": Rolling((Row(ROLLERS),)),
    "taper": Rolling((Row(TAPER),)),
}
_AT = np.array([18e-6, -9e-6, 40e-6, 2e-4, -3e-4])
AT = {name: _AT * ([1, 1, -1, -1, -1] if "mirrored" in name else 1.0) for name in KINDS}  # where they carry


def load(*values: float) -> np.ndarray:
    """Fx, Fy, Fz, Mx, My; zeros for those that are not said."""
    return np.array([*values, *[0.0] * (5 - len(values))])
