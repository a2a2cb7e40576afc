"""Direct solution for bodies of N equal parts about z: one part is factorised for all of them.

The unknowns inside part j are those of part 0 turned by 2πj/N. Each part is condensed onto its border, what it shares
with others; the condensed matrix of part 0, turned, is that of every part. Borders are small (cuts of a carrier
between its bolts, the master of its bore), so that their sum S is factorised dense:
    S = A_BB − Σ_j R_j A_BI A_II⁻¹ A_IB R_jᵀ.
Real, exact for any shift, and the factor takes less than an N-th of the whole body's memory: it is formed in double
precision and kept in single; solutions are refined with A in double (`refined`: two or three times). Source:
substructuring with repeated parts: Craig & Kurdila, Fundamentals of Structural Dynamics (2006), ch. 17.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from gearfmu.fem.factor import CondensedFactor, Product, eliminate_symmetric, lu, refined
from gearfmu.geometry.plane import about_z

_COLUMNS = 128


@dataclass(frozen=True)
class Parts:
    """N equal parts of a body; unknowns come in threes, a vector each, one behind the other.

    inner (N, n), border (N, b) : unknowns of each part, those of part j being those of part 0 turned by 2πj/N about z.
    Borders of parts overlap, inner unknowns do not; together they are all unknowns.
    """

    inner: np.ndarray
    border: np.ndarray

    @property
    def count(self) -> int:
        """N."""
        return len(self.inner)

    def turned(self, vectors: np.ndarray, part: int) -> np.ndarray:
        """Vectors (3m, k) of part 0 turned into `part`; a negative `part` turns back."""
        turn = about_z(2 * np.pi * part / self.count)
        return np.matmul(turn, vectors.reshape(-1, 3, vectors.shape[1])).reshape(vectors.shape)


class RepeatedFactor:
    """Factorisation of a real symmetric matrix A (n, n), definite or not, of a body of equal `parts`.

    block : the square block of A on given unknowns; only those of one part and the shared ones are asked for. product :
    A times vectors. mesh : cells and node_of_dof as of `factor.Factor`, of the whole body. held : unknowns of the
    borders that stay 0: their loads are ignored. Raises FactorError where A is singular to working accuracy.
    """

    def __init__(
        self,
        block: Callable[[np.ndarray], sp.csr_array],
        product: Product,
        parts: Parts,
        mesh: tuple[np.ndarray, np.ndarray],
        held: np.ndarray | None = None,
    ):
        self._times, self._parts = product, parts
        self._held = np.empty(0, int) if held is None else held
        inner, border = parts.inner[0], parts.border[0]
        nodes = mesh[1][inner]
        inside = np.where(np.isin(mesh[0], nodes), mesh[0], -1)
        alone = _without_border(block(np.concatenate([inner, border])), len(inner))
        cells = inside[(inside >= 0).any(axis=1)]
        self._factor = CondensedFactor(alone, cells, nodes, eliminate_symmetric, np.float32)
        self._shared = np.setdiff1d(np.unique(parts.border), self._held)
        self._place = [self._places(part) for part in range(parts.count)]
        self._small = lu(self._assembled(block(self._shared).toarray()))

    def _places(self, part: int) -> np.ndarray:
        """Where the border of a part is among the shared unknowns, one past them for what is held."""
        border = self._parts.border[part]
        place = np.searchsorted(self._shared, border)
        return np.where(np.isin(border, self._held), len(self._shared), place)

    def _assembled(self, shared: np.ndarray) -> np.ndarray:
        small = np.pad(shared, (0, 1))
        for part, place in enumerate(self._place):
            half = self._parts.turned(self._factor.schur, part)
            small[np.ix_(place, place)] += self._parts.turned(np.ascontiguousarray(half.T), part)
        return small[:-1, :-1]

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """A⁻¹ rhs, rhs (n, k) real; refined."""
        loads = rhs
        if len(self._held):
            loads = rhs.copy()
            loads[self._held] = 0
        return refined(self._solve_once, self._product, loads)

    def _product(self, vectors: np.ndarray) -> np.ndarray:
        result = self._times(vectors)
        result[self._held] = 0
        return result

    def _solve_once(self, rhs: np.ndarray) -> np.ndarray:
        result = np.zeros(rhs.shape)
        step = max(1, _COLUMNS // self._parts.count)
        for first in range(0, rhs.shape[1], step):
            columns = slice(first, first + step)
            self._solve_columns(rhs[:, columns], result[:, columns])
        return result

    def _solve_columns(self, rhs: np.ndarray, result: np.ndarray) -> None:
        parts, width = self._parts, rhs.shape[1]
        loads = np.hstack([parts.turned(rhs[inner], -part) for part, inner in enumerate(parts.inner)])
        kept, passed = self._factor.forward(loads)
        shared = np.vstack([rhs[self._shared], np.zeros((1, width))])
        for part, place in enumerate(self._place):
            shared[place] += parts.turned(passed[:, part * width : (part + 1) * width].copy(), part)
        shared[:-1] = sl.lu_solve(self._small, shared[:-1], check_finite=False)
        shared[-1] = 0
        border = np.hstack([parts.turned(shared[place], -part) for part, place in enumerate(self._place)])
        inside = self._factor.backward(kept, border)
        result[self._shared] = shared[:-1]
        for part, inner in enumerate(parts.inner):
            result[inner] = parts.turned(inside[:, part * width : (part + 1) * width].copy(), part)


def _without_border(matrix: sp.csr_array, inner: int) -> sp.csr_array:
    """The matrix without its entries between unknowns from `inner` on."""
    own = matrix.tocoo()
    coupled = (own.row < inner) | (own.col < inner)
    entries = own.data[coupled], (own.row[coupled], own.col[coupled])
    return sp.csr_array(sp.coo_array(entries, shape=own.shape))
