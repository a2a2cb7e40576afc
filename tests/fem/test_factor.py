"""Nested dissection and multifrontal Cholesky against a general sparse solver."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse.linalg as spl
from blocks import STEEL, box, ring
from hypothesis import given, settings
from hypothesis import strategies as st

from gearfmu.fem import hex20
from gearfmu.fem.dissection import nested_dissection
from gearfmu.fem.factor import Factor, FactorError


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
