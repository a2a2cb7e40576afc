"""Static modes only: the displacement under unit loads at the interfaces, no eigenmodes.

Matched: the static response to every interface force when n is the number of inputs m (one block of moments at 0); with
fewer, the n load patterns that yield most (largest eigenvalues of the scaled compliance), each exactly. n never exceeds
m. Source: Craig & Kurdila, Fundamentals of Structural Dynamics (2006), ch. 17; paper section 2 (static modes).
"""

from __future__ import annotations

import numpy as np

from gearfmu.reduction.basis import Basis, Growing, Size
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.moments import input_loads, static_response


def reduce(body: FullOrder, size: Size) -> Basis:
    """At most one static mode per input."""
    loads = input_loads(body)
    response = static_response(body)
    if size.count < loads.shape[1]:
        compliance = loads.T @ response
        response = response @ np.linalg.eigh(0.5 * (compliance + compliance.T))[1][:, ::-1][:, : size.count]
    basis = Growing(elastic(body))
    basis.add(response)
    return Basis("static", np.array(basis.vectors), {"inputs": loads.shape[1]})
