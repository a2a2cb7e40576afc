"""Craig–Bampton: constraint modes of the interfaces and eigenmodes with all interfaces held.

Matched: the static response to interface forces in equilibrium with each other, exactly; dynamics of the inside while
the interfaces rest. Not matched: inertia of the interfaces' own motion, hence slow convergence where they move much.
An interface is held by its rows B q = 0, averaging couplings as exactly as nodes; on a free body the constraint modes
are rigid motion and the response to self-equilibrated interface forces. n = (m − r) constraint modes + fixed-interface
modes. Theory, eq. 22. Source: Craig & Bampton, AIAA J. 6 (1968) 1313.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from gearfmu.errors import BodyError
from gearfmu.reduction.elastic import Elastic, elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.moments import Growing, Size, input_loads, static_response


def reduce(body: FullOrder, size: Size) -> np.ndarray:
    """Constraint modes first, then fixed-interface modes up to n. Raises BodyError when n is less than the former."""
    space, basis = elastic(body), Growing(elastic(body))
    basis.add(static_response(body) @ balanced(space, input_loads(body)))
    constraint = basis.size
    if size.count < constraint:
        raise BodyError(
            f"{body.name}: Craig–Bampton starts with {constraint} constraint modes of this body's interfaces: "
            f"n = {size.count} is too small; give at least that"
        )
    wanted = min(size.count, space.elastic) - constraint
    if wanted:
        inside = Elastic(body.held(body.rows()), twin=space)
        basis.add(inside.modes(min(wanted, inside.elastic))[1])
    return np.array(basis.vectors)


def balanced(space: Elastic, loads: np.ndarray) -> np.ndarray:
    """Combinations (m, m − r) of loads (N, m) that exert no rigid resultant."""
    resultant = space.rigid.T @ loads
    if not len(resultant):
        return np.eye(loads.shape[1])
    norm = np.abs(resultant).max(axis=1, keepdims=True) + np.finfo(float).tiny
    return sl.null_space(resultant / norm, rcond=1e-9)
