"""Sparse Cholesky factorisation of finite-element matrices: multifrontal, on nested dissection, in dense numpy blocks.

A = L Lᵀ group by group (see `dissection`): each group's front gathers its rows of A and the Schur complements its
descendants left, and leaves its own. Nearly all work is dense matrix products, with many right-hand sides also in the
solution: on solid gear sectors some ten times faster per right-hand side than general sparse LU (SuperLU).
Source: Duff & Reid, ACM Trans. Math. Softw. 9 (1983) 302; Liu, SIAM Review 34 (1992) 82.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.linalg.blas import dtrsm

from gearfmu.fem.dissection import nested_dissection

_COLUMNS = 128


class FactorError(ArithmeticError):
    """The matrix is not positive definite (a body that is not held, or not finite)."""


@dataclass
class _Front:
    """Rows start:stop of L: the triangle (own × own) and the part below it, on the rows `below`."""

    start: int
    stop: int
    below: np.ndarray
    triangle: np.ndarray
    rest: np.ndarray


class Factor:
    """Factorisation of a real symmetric positive definite matrix (n, n).

    cells : (E, k) node numbers of each element, −1 for none; node_of_dof : (n,) the node of each unknown. Two unknowns
    may be coupled only if their nodes share an element. Raises FactorError.
    """

    def __init__(self, matrix: sp.sparray, cells: np.ndarray, node_of_dof: np.ndarray):
        self.shape = matrix.shape
        groups = dof_groups(nested_dissection(cells), node_of_dof)
        self._order = np.concatenate(groups)
        assert len(self._order) == matrix.shape[0], "every unknown must belong to a node of some element"
        ordered = sp.csr_array(matrix)[self._order][:, self._order].tocsr()
        ends = np.cumsum([len(group) for group in groups])
        self._fronts = eliminated(ordered, ends, _eliminate)

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """A⁻¹ rhs for real or complex rhs (n, k)."""
        if np.iscomplexobj(rhs):
            return self.solve(np.ascontiguousarray(rhs).view(float)).view(complex)
        result = np.empty(rhs.shape)
        for first in range(0, rhs.shape[1], _COLUMNS):
            columns = slice(first, first + _COLUMNS)
            work = np.ascontiguousarray(rhs[self._order, columns], dtype=float)
            self._substitute(work)
            result[self._order, columns] = work
        return result

    def _substitute(self, work: np.ndarray) -> None:
        """Forward and back substitution in place; (n, k) in C order, so that a group's rows are one block."""
        for front in self._fronts:
            own = work[front.start : front.stop]
            own[:] = dtrsm(1.0, front.triangle, own.T, side=1, lower=1, trans_a=1).T
            work[front.below] -= front.rest @ own
        for front in reversed(self._fronts):
            own = work[front.start : front.stop]
            own -= front.rest.T @ work[front.below]
            own[:] = dtrsm(1.0, front.triangle, own.T, side=1, lower=1).T


def dof_groups(groups: list[np.ndarray], node_of_dof: np.ndarray) -> list[np.ndarray]:
    """The unknowns of each group of nodes, groups without any left out."""
    order = np.argsort(node_of_dof, kind="stable")
    nodes = node_of_dof[order]
    result = []
    for group in groups:
        first, last = np.searchsorted(nodes, group, "left"), np.searchsorted(nodes, group, "right")
        dofs = np.concatenate([order[a:b] for a, b in zip(first, last, strict=True)])
        if len(dofs):
            result.append(dofs)
    return result


def eliminated(matrix: sp.csr_array, ends: np.ndarray, eliminate: Callable[..., tuple[Any, np.ndarray]]) -> list[Any]:
    """Fronts of an ordered matrix (n, n), group by group up to `ends`.

    eliminate(dense, start, stop, below): of a gathered front with rows start:stop and `below` first, what is kept of it
    and the update that it leaves to the rows below.
    """
    group_of = np.repeat(np.arange(len(ends)), np.diff(ends, prepend=0))
    waiting: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in ends]
    fronts, workspace = [], Workspace()
    for number, stop in enumerate(ends):
        start = int(ends[number - 1]) if number else 0
        rows = matrix[start:stop]
        children, waiting[number] = waiting[number], []
        touched = np.unique(np.concatenate([rows.indices, *(index for index, _ in children)]))
        below = touched[touched >= stop]
        dense = gathered(rows, start, below, children, workspace)
        front, update = eliminate(dense, start, int(stop), below)
        fronts.append(front)
        if len(below):
            waiting[group_of[below[0]]].append((below, update))
    return fronts


class Workspace:
    """Memory for one front after the other: asking the system for it anew took longer than the arithmetic."""

    def __init__(self) -> None:
        self._memory = np.empty(0)

    def square(self, size: int, dtype: np.dtype) -> np.ndarray:
        """(size, size) zeros in Fortran order; valid until the next call."""
        if self._memory.size < size * size:
            self._memory = np.empty(size * size, dtype)
        dense = self._memory[: size * size].reshape(size, size, order="F")
        dense.fill(0)
        return dense


def gathered(rows: sp.csr_array, start: int, below: np.ndarray, children: list, workspace: Workspace) -> np.ndarray:
    """Lower triangle of a front (complex as `rows`): own columns of A and the children's Schur complements.

    children : (places, Schur complement), of which the upper triangle is read.
    """
    own = rows.shape[0]
    size = own + len(below)
    position = np.empty(rows.shape[1], int)
    position[start : start + own] = np.arange(own)
    position[below] = np.arange(own, size)
    dense = workspace.square(size, rows.dtype)
    entries = rows.tocoo()
    ahead = entries.col >= start
    dense[position[entries.col[ahead]], entries.row[ahead]] = entries.data[ahead]
    for index, update in children:
        _add_lower(dense, position[index], update)
    return dense


def _add_lower(dense: np.ndarray, place: np.ndarray, update: np.ndarray) -> None:
    """Add the upper triangle of `update` (C order) to the lower one of `dense` (Fortran order) at ascending places.

    Run by run of consecutive places, so that whole columns are added at once.
    """
    ends = np.append(np.flatnonzero(np.diff(place) > 1) + 1, len(place))
    columns, first = dense.T, 0
    for last in ends:
        columns[place[first] : place[last - 1] + 1, place[first:]] += update[first:last, first:]
        first = last


def _eliminate(dense: np.ndarray, start: int, stop: int, below: np.ndarray) -> tuple[_Front, np.ndarray]:
    own = stop - start
    try:
        triangle = sl.cholesky(dense[:own, :own], lower=True, check_finite=False)
    except np.linalg.LinAlgError as error:
        raise FactorError(
            "the stiffness matrix is not positive definite: is the body held, are all elements sound?"
        ) from error
    rest = dtrsm(1.0, triangle, dense[own:, :own], side=1, lower=1, trans_a=1)
    product = np.matmul(rest, rest.T)
    update = np.subtract(dense.T[own:, own:], product, out=product)
    return _Front(start, stop, below, np.asfortranarray(triangle), rest), update
