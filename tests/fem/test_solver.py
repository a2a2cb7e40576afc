"""Both sparse solvers give the same solutions; without pypardiso our own is used. Matrices that are not definite, near
and beyond eigenvalues, against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse.linalg as spl
from blocks import STEEL, box, ring
from hypothesis import given, settings
from hypothesis import strategies as st

from gearfmu.fem import hex20, solver
from gearfmu.fem.dissection import nested_dissection
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


# ---- nested dissection and multifrontal Cholesky ---------------------------------------------------------------------
def held(nodes, elements, fixed):
    k, _ = hex20.assemble(nodes, elements, STEEL)
    free = np.flatnonzero(~np.repeat(fixed, 3))
    return k[free][:, free], free


def test_solution_is_that_of_a_general_solver():
    nodes, elements = ring((3, 12, 3), 0.02, 0.05, 0.03)
    matrix, free = held(nodes, elements, nodes[:, 2] < -0.0149)
    rng = np.random.default_rng(0)
    rhs = rng.standard_normal((len(free), 200))
    solution = Factor(matrix, elements, free // 3).solve(rhs)
    assert np.abs(matrix @ solution - rhs).max() < 1e-9 * np.abs(matrix.data).max() * np.abs(solution).max()
    assert np.allclose(
        solution[:, :3], spl.spsolve(matrix.tocsc(), rhs[:, :3]), rtol=0, atol=1e-9 * np.abs(solution).max()
    )


@settings(max_examples=15)
@given(cells=st.tuples(*[st.integers(1, 5)] * 3))
def test_every_node_is_eliminated_once_and_separators_separate(cells):
    nodes, elements = box(cells, (1.0, 1.3, 1.7))
    groups = nested_dissection(elements)
    assert np.array_equal(np.sort(np.concatenate(groups)), np.arange(len(nodes)))


def test_top_separator_of_a_ring_is_two_cross_sections():
    """The two lowest vectors of a ring are a pair, any mixture of which is as good to the eigensolver: a cut along one
    of them runs askew through the elements, a cut along the right mixture between them."""
    _, elements = ring((3, 16, 2), 0.02, 0.05, 0.03)
    cross_section = 4 * 3 + 3 * 3 + 4 * 2  # corner nodes, mid nodes along the radius and along the axis
    assert len(nested_dissection(elements)[-1]) == 2 * cross_section


def test_a_body_that_is_not_held_is_refused():
    nodes, elements = box((2, 2, 2), (1.0, 1.0, 1.0))
    k, _ = hex20.assemble(nodes, elements, STEEL)
    with pytest.raises(FactorError, match="held"):
        Factor(-k, elements, np.arange(k.shape[0]) // 3)
