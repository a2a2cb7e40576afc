"""Reduction methods, one file each; every one is `reduce(body: FullOrder, size: Size) -> Basis`.

What each matches stands at the head of its file; equations in docs/theory.md, section 7.
"""

from __future__ import annotations

from collections.abc import Callable

from gearfmu.reduction.basis import Basis, Size
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.methods import craig_bampton, krylov, modal, rubin

Method = Callable[[FullOrder, Size], Basis]
METHODS: dict[str, Method] = {
    "modal": modal.reduce,
    "craig_bampton": craig_bampton.reduce,
    "rubin": rubin.reduce,
    "krylov": krylov.reduce,
}
