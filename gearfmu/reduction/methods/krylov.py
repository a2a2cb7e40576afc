"""Block Krylov subspaces: moments of the transfer matrix matched at several real expansion points, 0 among them.

Matched: H and its first 2p − 1 derivatives in Ω² at each point, p its number of blocks; the static response among them.
n = b·m for b blocks of m inputs, less what deflation leaves out and what fills no whole block: n floats. Points: 0, the
middle and the end of the band (three factorisations); one that meets an eigenvalue moves. Theory, eq. 24.
Source: Grimme, thesis, Urbana 1997; Lehner & Eberhard, Multibody Syst. Dyn. 17 (2007) 157; paper section 2 (four
nodes · six directions · five moments = 120).
"""

from __future__ import annotations

import numpy as np

from gearfmu.errors import BodyError
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.moments import Expansion, Growing, Size, expansion_points

_POINTS = 3  # expansion points; more blocks than that become higher powers at the same points


def reduce(body: FullOrder, size: Size) -> np.ndarray:
    """Krylov basis with as many whole blocks as `size` allows. Raises BodyError when that is less than one block."""
    inputs = body.rows().shape[0]
    blocks = size.count // inputs
    if not blocks:
        raise BodyError(
            f"{body.name}: Krylov subspaces come in blocks of one vector per input: n = {size.count} is less than the "
            f"{inputs} inputs of this body; give at least that"
        )
    points = expansion_points(min(blocks, _POINTS), size.band)
    powers = [blocks // len(points) + (k < blocks % len(points)) for k in range(len(points))]
    basis = Growing(elastic(body))
    for shift, power in zip(points, powers, strict=True):
        point = Expansion(body, shift, basis)
        for _ in range(power):
            point.advance(basis)
    return np.array(basis.vectors)
