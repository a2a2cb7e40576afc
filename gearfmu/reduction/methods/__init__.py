"""Reduction methods, one file each; every one is `reduce(body, size)`: V (N, n), orthonormal in M and
M-orthogonal to the rigid modes that nothing holds.

What each matches stands at the head of its file; equations in docs/theory.md, section 7.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.methods import craig_bampton, krylov, modal, rubin
from gearfmu.reduction.moments import Size

Method = Callable[[FullOrder, Size], np.ndarray]
METHODS: dict[str, Method] = {
    "modal": modal.reduce,
    "craig_bampton": craig_bampton.reduce,
    "rubin": rubin.reduce,
    "krylov": krylov.reduce,
}
