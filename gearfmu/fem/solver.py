"""Which sparse solver factorises a whole body: pypardiso (Intel MKL) where it is installed, else our own.

Our own needs numpy and scipy only. pypardiso comes with the extra `[fast]`; a factor of it that fails, or leaves a
residual that rounding does not explain, is made again by our own. Both give the same solutions to rounding.
Source: Schenk & Gärtner, Future Gener. Comput. Syst. 20 (2004) 475 (PARDISO).
"""

from __future__ import annotations

import importlib.util
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from gearfmu.fem.factor import Factor, SymmetricFactor

_REAL_DEFINITE, _REAL_INDEFINITE = 2, -2  # PARDISO's matrix types
_RESIDUAL = 1e-8  # relative to the right-hand side; rounding leaves a hundredth of it on solid bodies


class Solves(Protocol):
    """A factorised matrix."""

    def solve(self, rhs: np.ndarray) -> np.ndarray: ...


def definite_factor(matrix: sp.csr_array, cells: np.ndarray, node_of_dof: np.ndarray) -> Solves:
    """Factor of a real symmetric positive definite matrix; arguments and errors as of `factor.Factor`."""
    return _pardiso(matrix, _REAL_DEFINITE) or Factor(matrix, cells, node_of_dof)


def symmetric_factor(matrix: sp.csr_array, cells: np.ndarray, node_of_dof: np.ndarray) -> Solves:
    """Factor of a real symmetric matrix; arguments and errors as of `factor.SymmetricFactor`."""
    return _pardiso(matrix, _REAL_INDEFINITE) or SymmetricFactor(matrix, cells, node_of_dof)


def solver_name() -> str:
    """ "pypardiso" or "gearfmu", for reports."""
    return "pypardiso" if importlib.util.find_spec("pypardiso") else "gearfmu"


def _pardiso(matrix: sp.csr_array, kind: int) -> PardisoFactor | None:
    if solver_name() != "pypardiso":
        return None
    from pypardiso.pardiso_wrapper import PyPardisoError

    try:
        factor = PardisoFactor(matrix, kind)
        probe = np.cos(np.arange(matrix.shape[0]))[:, None]
        residual = matrix @ factor.solve(probe) - probe
    except (PyPardisoError, ImportError):
        return None
    return factor if np.linalg.norm(residual) < _RESIDUAL * np.linalg.norm(probe) else None


class PardisoFactor:
    """A factor kept by PARDISO; kind : its matrix type (2, −2 real symmetric, definite or not)."""

    def __init__(self, matrix: sp.csr_array, kind: int):
        import pypardiso

        self._upper = sp.csr_matrix(sp.triu(matrix))
        self._upper.sort_indices()
        self._solver = pypardiso.PyPardisoSolver(mtype=kind)
        self._solver.factorize(self._upper)

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """A⁻¹ rhs, rhs (n, k)."""
        if not rhs.shape[1]:
            return rhs
        rhs = np.asfortranarray(rhs, dtype=float)
        return np.asarray(self._solver.solve(self._upper, rhs)).reshape(rhs.shape)

    def __del__(self) -> None:
        solver = getattr(self, "_solver", None)
        if solver is not None:
            solver.free_memory(everything=True)
