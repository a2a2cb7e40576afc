"""The factorisation of matrices that are not definite: against dense algebra, near and beyond eigenvalues."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
from blocks import STEEL, box

from gearfmu.fem import hex20
from gearfmu.fem.indefinite import FactorError, SymmetricFactor

NODES, ELEMENTS = box((6, 3, 2), (0.09, 0.04, 0.02))
STIFFNESS, MASS = hex20.assemble(NODES, ELEMENTS, STEEL)
NODE_OF_DOF = np.arange(NODES.size) // 3
SQUARED = sl.eigh(STIFFNESS.toarray(), MASS.toarray(), eigvals_only=True)
RHS = np.random.default_rng(0).standard_normal((NODES.size, 5))


def solved(matrix, rhs=RHS):
    return SymmetricFactor(matrix, ELEMENTS, NODE_OF_DOF).solve(rhs)


@pytest.mark.parametrize("mode", [7, 20, 80, 300])
def test_beyond_any_number_of_eigenvalues(mode: int) -> None:
    matrix = STIFFNESS - 0.5 * (SQUARED[mode] + SQUARED[mode + 1]) * MASS
    residual = matrix @ solved(matrix) - RHS
    assert np.linalg.norm(residual) < 1e-10 * np.linalg.norm(RHS)
    assert np.allclose(solved(matrix), np.linalg.solve(matrix.toarray(), RHS), rtol=0, atol=1e-7 * np.abs(RHS).max())


def test_a_negative_shift_is_definite_for_a_free_body() -> None:
    matrix = STIFFNESS + SQUARED[10] * MASS
    exact = np.linalg.solve(matrix.toarray(), RHS)
    assert np.linalg.norm(solved(matrix) - exact) < 1e-11 * np.linalg.norm(exact)


def test_an_unknown_that_nothing_holds_is_refused() -> None:
    matrix = STIFFNESS.tolil()
    matrix[4, :], matrix[:, 4] = 0, 0
    with pytest.raises(FactorError, match="singular"):
        SymmetricFactor(matrix.tocsr(), ELEMENTS, NODE_OF_DOF)
