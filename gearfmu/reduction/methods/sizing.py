"""Size by tolerance: a basis grows until the transfer matrix of the body is met."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gearfmu.errors import BodyError
from gearfmu.reduction.basis import Basis, Size
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.oscillators import oscillators
from gearfmu.reduction.transfer import Judging, reference, relative_error, transfer

_LINES = 120
_GROWTH = 1.25
_LARGEST = 2000


def sized(body: FullOrder, size: Size, build: Callable[[FullOrder, Size], Basis]) -> Basis:
    """`build` at the given number, or at growing numbers until the error over the band is within the tolerance.

    Numbers grow by a quarter, so the basis is at most that much larger than needed. Raises BodyError with the best
    error when the method does not get there.
    """
    if size.count is not None:
        return build(body, size)
    assert size.tolerance is not None
    judging = Judging.over((max(size.band[0], 1e-3 * size.band[1]), size.band[1]), _LINES)
    full = reference(body, judging)
    count, best, last = max(body.rows().shape[0], 20), float("inf"), 0
    while count <= _LARGEST and last < elastic(body).elastic:
        basis = build(body, replace(size, count=count, tolerance=None))
        if basis.size > last:
            model = transfer(oscillators(body, basis, judging.damping_ratio), judging, body.ground)
            best, last = min(best, float(relative_error(full.matrix, model).max())), basis.size
        if best <= size.tolerance:
            return basis
        count = int(_GROWTH * count) + 1
    raise BodyError(f"{body.name}: this method does not reach {size.tolerance:g}: {best:.2g} with {last} vectors")
