"""Sparse factorisation of symmetric matrices that need not be definite: K − σM at a real shift.

As `factor.Factor`, front by front on nested dissection. A front that is positive definite is eliminated by Cholesky,
any other by LU with partial pivoting among its own unknowns; far below a body's high frequencies those are only the
last few fronts. Pivots never leave their front, so digits can be lost where the shift is an eigenvalue of a held part
of the body: a solution with a larger residual than rounding explains is refined until it no longer improves.
Source: Duff & Reid, ACM Trans. Math. Softw. 9 (1983) 302; refinement: Arioli, Demmel & Duff, SIAM J. Matrix Anal. 10
(1989) 165.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from gearfmu.fem.factor import Factor, FactorError, cholesky_front

_REFINED = 1e-9  # residual relative to the right-hand side; rounding leaves a tenth of it on solid bodies
_ROUNDS = 3

Product = Callable[[np.ndarray], np.ndarray]


@dataclass
class _PivotedFront:
    """Unknowns start:stop with the LU factors of their block A and W = A⁻¹ Bᵀ, B the coupling to the rows `below`."""

    start: int
    stop: int
    below: np.ndarray
    own: tuple[np.ndarray, np.ndarray]
    influence: np.ndarray

    def forward(self, work: np.ndarray) -> None:
        """The own rows' part taken off the rows of `work` (n, k) below."""
        work[self.below] -= self.influence.T @ work[self.start : self.stop]

    def backward(self, work: np.ndarray) -> None:
        """The own rows, those below being solved for already."""
        own = work[self.start : self.stop]
        own[:] = sl.lu_solve(self.own, own, check_finite=False) - self.influence @ work[self.below]

    def kept_as(self, number: np.dtype) -> _PivotedFront:
        """The same in numbers of another precision."""
        factors, pivots = self.own
        own = factors.astype(number, copy=False), pivots
        return replace(self, own=own, influence=self.influence.astype(number, copy=False))


class SymmetricFactor(Factor):
    """Factorisation of a real symmetric matrix (n, n), definite or not; arguments as of `factor.Factor`. Raises
    FactorError where the matrix is singular to working accuracy."""

    def __init__(self, matrix: sp.csr_array, cells: np.ndarray, node_of_dof: np.ndarray):
        super().__init__(matrix, cells, node_of_dof, eliminate_symmetric)
        self._matrix = matrix

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """A⁻¹ rhs, rhs (n, k) real; refined."""
        return refined(super().solve, lambda vectors: self._matrix @ vectors, rhs)


def refined(solve: Product, product: Product, rhs: np.ndarray) -> np.ndarray:
    """A⁻¹ rhs (n, k) by `solve`, again for the residual while it is larger than rounding explains and shrinks.

    product : A times vectors."""
    solution = solve(rhs)
    size = np.linalg.norm(rhs, axis=0) + np.finfo(float).tiny
    residual = rhs - product(solution)
    error = (np.linalg.norm(residual, axis=0) / size).max(initial=0.0)
    for _ in range(_ROUNDS):
        if error < _REFINED:
            break
        better = solution + solve(residual)
        residual = rhs - product(better)
        last, error = error, (np.linalg.norm(residual, axis=0) / size).max(initial=0.0)
        if not error < last:
            break
        solution = better
        if error > 0.25 * last:
            break
    return solution


def eliminate_symmetric(dense: np.ndarray, start: int, stop: int, below: np.ndarray) -> tuple[Any, np.ndarray]:
    """A gathered front of a symmetric matrix eliminated: what is kept of it, and the update of the rows below."""
    found = cholesky_front(dense, start, stop, below)
    if found is not None:
        return found
    size = stop - start
    block, coupling = dense[:size, :size], dense[size:, :size]
    own = lu(np.tril(block) + np.tril(block, -1).T)
    influence = sl.lu_solve(own, np.asfortranarray(coupling.T), check_finite=False)
    product = coupling @ influence
    update = np.subtract(dense.T[size:, size:], product, out=product)
    return _PivotedFront(start, stop, below, own, influence), update


def lu(block: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """LU factors of a dense block, which is overwritten. Raises FactorError where it is singular."""
    factors, pivots, info = sl.get_lapack_funcs(("getrf",), (block,))[0](block, overwrite_a=True)
    diagonal = np.abs(factors.diagonal())
    if info or not diagonal.min() > 1e-14 * diagonal.max():
        raise FactorError("the shifted stiffness matrix is singular: the shift is an eigenvalue; move it")
    return factors, pivots
