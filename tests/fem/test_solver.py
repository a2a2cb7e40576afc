"""Both sparse solvers give the same solutions; without pypardiso our own is used. Matrices that are not definite, near
and beyond eigenvalues, against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
from blocks import STEEL, box

from gearfmu.fem import hex20, solver
from gearfmu.fem.factor import Factor, FactorError, SymmetricFactor

NODES, ELEMENTS = box((6, 3, 2), (0.09, 0.04, 0.02))
STIFFNESS, MASS = hex20.assemble(NODES, ELEMENTS, STEEL)
NODE_OF_DOF = np.arange(NODES.size) // 3
SHIFT = (2 * np.pi * 3e4) ** 2
RHS = np.random.default_rng(0).standard_normal((NODES.size, 5))


def test_without_pypardiso_our_own_solver_is_used(monkeypatch) -> None:
    monkeypatch.setattr(solver, "solver_name", lambda: "gearfmu")
    assert isinstance(solver.definite_factor(STIFFNESS + SHIFT * MASS, ELEMENTS, NODE_OF_DOF), Factor)
    assert isinstance(solver.symmetric_factor(STIFFNESS - SHIFT * MASS, ELEMENTS, NODE_OF_DOF), SymmetricFactor)


@pytest.mark.needs("pypardiso")
@pytest.mark.parametrize("sign", [1, -1])
def test_pypardiso_gives_the_same_solutions(sign: int) -> None:
    matrix = STIFFNESS + sign * SHIFT * MASS
    own = SymmetricFactor(matrix, ELEMENTS, NODE_OF_DOF)
    make = solver.definite_factor if sign > 0 else solver.symmetric_factor
    fast = make(matrix, ELEMENTS, NODE_OF_DOF)
    assert isinstance(fast, solver.PardisoFactor)
    assert np.linalg.norm(fast.solve(RHS) - own.solve(RHS)) < 1e-9 * np.linalg.norm(own.solve(RHS))


@pytest.mark.needs("pypardiso")
def test_a_factor_that_pypardiso_cannot_make_is_our_own() -> None:
    assert isinstance(solver.definite_factor(STIFFNESS + SHIFT * MASS, ELEMENTS, NODE_OF_DOF), solver.PardisoFactor)
    assert solver._pardiso(STIFFNESS - SHIFT * MASS, 2) is None


# ---- matrices that are not definite ---------------------------------------------------------------------------------
SQUARED = sl.eigh(STIFFNESS.toarray(), MASS.toarray(), eigvals_only=True)


def solved(matrix):
    return SymmetricFactor(matrix, ELEMENTS, NODE_OF_DOF).solve(RHS)


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
