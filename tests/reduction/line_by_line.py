"""The full model solved at single lines by a general sparse solver: what a reference must agree with."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from gearfmu.reduction.full_order import FullOrder


def direct(body: FullOrder, frequency: float, damping_ratio: float) -> np.ndarray:
    """H (m, m) at one line by factorising K(1 + 2iζ) − Ω²M of the full model, ground held by constraint."""
    held = body.grounded()
    matrix = held.stiffness * (1 + 2j * damping_ratio) - (2 * np.pi * frequency) ** 2 * held.mass
    factor = spl.splu(sp.csc_matrix(matrix), "MMD_AT_PLUS_A")
    rows = sp.csr_array(sp.diags_array(held.scales()) @ held.rows())
    response = factor.solve(rows.T.toarray().astype(complex))
    if held.constraints is not None:
        reaction = factor.solve(held.constraints.T.toarray().astype(complex))
        carried = np.linalg.solve(held.constraints @ reaction, held.constraints @ response)
        response = response - reaction @ carried
    return rows @ response
