"""Reduction methods that are judged beside those of gearfmu (docs/reduction.md), and whole bodies integrated in time.

`interpolation` works on bodies that another method has reduced.
"""

from __future__ import annotations

from evidence.reduction.methods import snapshots, static
from gearfmu.reduction import methods

METHODS = {**methods.METHODS, "static": static.reduce, "snapshots": snapshots.reduce}
