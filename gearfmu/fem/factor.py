"""One small face on sparse direct factorisation: SuperLU of scipy, or MKL PARDISO where pypardiso is installed."""
from __future__ import annotations

import importlib.util

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

_COLUMNS = 64


class FactorError(ArithmeticError):
    """The matrix could not be factorised (singular, or not finite)."""


class Factor:
    """Factorisation of a real symmetric positive definite matrix (n, n).

    Symmetric mode without pivoting: correct for definite matrices, several times faster and smaller than the default.
    `backend`: "superlu", or "pardiso" (extra [fast]; falls back to SuperLU when it fails), or None to choose.
    Raises FactorError.
    """

    def __init__(self, matrix: sp.sparray, backend: str | None = None):
        self.shape = matrix.shape
        wanted = backend or ("pardiso" if importlib.util.find_spec("pypardiso") else "superlu")
        if wanted == "pardiso":
            self._solve = _pardiso(matrix) or _superlu(matrix)
        else:
            self._solve = _superlu(matrix)

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """A⁻¹ rhs for real or complex rhs (n,) or (n, k)."""
        if np.iscomplexobj(rhs):
            columns = rhs.reshape(len(rhs), -1)
            both = self.solve(np.hstack([columns.real, columns.imag]))
            return (both[:, : columns.shape[1]] + 1j * both[:, columns.shape[1] :]).reshape(rhs.shape)
        if rhs.ndim == 1 or rhs.shape[1] <= _COLUMNS:
            return self._solve(np.asfortranarray(rhs))
        parts = [self._solve(np.asfortranarray(rhs[:, k : k + _COLUMNS])) for k in range(0, rhs.shape[1], _COLUMNS)]
        return np.hstack(parts)


def _superlu(matrix: sp.sparray):
    try:
        factor = spl.splu(
            sp.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError as error:
        raise FactorError(f"factorisation of a {matrix.shape[0]} × {matrix.shape[0]} matrix failed: {error}") from error
    return factor.solve


def _pardiso(matrix: sp.sparray):
    from pypardiso import PyPardisoSolver

    solver, csr = PyPardisoSolver(), sp.csr_matrix(matrix)
    try:
        solver.factorize(csr)
    except Exception:  # any failure of the optional backend has the same answer: the one that is always there
        return None
    return lambda rhs: np.asarray(solver.solve(csr, rhs)).reshape(rhs.shape)
