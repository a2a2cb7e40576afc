"""Rubin / MacNeal: free eigenmodes and residual attachment modes, the static response that the eigenmodes leave out.

    V = [Φ_k, (C_static − Φ_k Ω_k⁻² Φ_kᵀ) Bᵀ],   k = n − m,   C_static = P K⁺ Pᵀ (inertia relief) or K⁻¹ of a held body

Matched: the static response to every interface force (on a free body in the mean-axis frame), and the lowest poles with
their residues. Projecting mass and stiffness alike keeps the inertia of the attachment modes (Rubin); MacNeal leaves
it out. Theory, eq. 23. Source: Rubin, AIAA J. 13 (1975) 995; MacNeal, Comput. Struct. 1 (1971) 581; paper section 2
(24 + 96).
"""

from __future__ import annotations

import numpy as np

from gearfmu.errors import BodyError
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.moments import Growing, Size, static_response


def reduce(body: FullOrder, size: Size) -> np.ndarray:
    """One attachment mode per input and free modes up to n. Raises BodyError when n is less than the inputs."""
    space, inputs = elastic(body), body.rows().shape[0]
    if size.count < inputs:
        raise BodyError(
            f"{body.name}: Rubin's method needs one attachment mode for each of the {inputs} inputs of this body: "
            f"n = {size.count} is too small; give at least that"
        )
    basis = Growing(space)
    if size.count > inputs:
        basis.add(space.modes(min(size.count, space.elastic) - inputs)[1])
    basis.add(static_response(body))
    return np.array(basis.vectors)
