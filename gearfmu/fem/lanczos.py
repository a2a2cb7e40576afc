"""Lowest eigenmodes by block Lanczos on the flexibility operator, with full reorthogonalisation in the mass product.

Eigenpairs of K φ = ω² M φ are those of C M φ = φ/ω² with C the flexibility of the body without its rigid motion, so
that a free body has no zero eigenvalues left. Source: Grimes, Lewis & Simon, SIAM J. Matrix Anal. 15 (1994).
"""
from __future__ import annotations

from typing import Protocol

import numpy as np

_DEPENDENT = 1e-12


class Vibrating(Protocol):
    """A body as the eigensolver sees it: vectors are (n, k), real or complex."""

    size: int
    elastic: int
    dtype: type

    def mass(self, vectors: np.ndarray) -> np.ndarray: ...

    def flexibility(self, loads: np.ndarray) -> np.ndarray: ...


class ModesError(ArithmeticError):
    """The eigensolver did not converge."""


def lowest_modes(body: Vibrating, count: int, tolerance: float = 1e-9, block: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """The `count` lowest elastic modes (fewer when the body has fewer).

    Returns ω² (k,), rad²/s², ascending, and mass-normalised shapes (n, k). `tolerance` bounds the residual of
    C M φ = φ/ω² relative to 1/ω², in the mass norm; the error of ω² is of the order of its square. Starts from fixed
    random vectors. Raises ModesError when the Krylov space ends before `count` modes have converged.
    """
    count = min(count, body.elastic)
    space = _Krylov(body, min(block, body.elastic))
    while True:
        values, vectors, residual = space.ritz()
        wanted = slice(0, count)
        if len(values) >= count and np.all(residual[wanted] <= tolerance * values[wanted]):
            return 1 / values[wanted], space.basis() @ vectors[:, wanted]
        if not space.grow():
            raise ModesError(f"only {len(values)} of {count} modes found: the Krylov space is exhausted")


class _Krylov:
    """Basis V, orthonormal in M, and T = Vᴴ M C M V, one block larger with each `grow`."""

    def __init__(self, body: Vibrating, block: int):
        self.body = body
        self.v, self.mv, self.coefficients = [], [], []
        start = np.random.default_rng(1).standard_normal((body.size, block)).astype(body.dtype)
        self.next = body.flexibility(body.mass(start))
        self.grow()

    def basis(self) -> np.ndarray:
        return np.hstack(self.v)

    def grow(self) -> bool:
        """Add the pending block and prepare the one after it; False when nothing independent is left."""
        block, _ = self._orthonormal(self.next)
        if block.shape[1] == 0:
            return False
        self.v.append(block)
        self.mv.append(self.body.mass(block))
        image = self.body.flexibility(self.mv[-1])
        column = 0.0
        for _ in range(2):
            part = [m.conj().T @ image for m in self.mv]
            for v, p in zip(self.v, part, strict=True):
                image = image - v @ p
            column = column + np.vstack(part)
        self.coefficients.append(column)
        self.next = image
        return True

    def ritz(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ritz values 1/ω² descending, their vectors in the basis and residual norms in M."""
        size = sum(v.shape[1] for v in self.v)
        t = np.zeros((size, size), dtype=self.body.dtype)
        start = 0
        for column in self.coefficients:
            t[: column.shape[0], start : start + column.shape[1]] = column
            start += column.shape[1]
        upper = np.triu(t, 1)
        values, vectors = np.linalg.eigh(upper + upper.conj().T + np.diag(t.diagonal().real))
        values, vectors = values[::-1], vectors[:, ::-1]
        last = self.v[-1].shape[1]
        gram = self.next.conj().T @ self.body.mass(self.next)
        tail = vectors[-last:]
        return values, vectors, np.sqrt(np.abs(np.einsum("ik,ij,jk->k", tail.conj(), gram, tail)))

    def _orthonormal(self, block: np.ndarray) -> tuple[np.ndarray, int]:
        scale = None
        for _ in range(3):
            for v, m in zip(self.v, self.mv, strict=True):
                block = block - v @ (m.conj().T @ block)
            values, vectors = np.linalg.eigh(block.conj().T @ self.body.mass(block))
            scale = values.max(initial=0.0) if scale is None else scale
            keep = values > _DEPENDENT**2 * scale if scale > 0 else np.zeros(len(values), bool)
            block = block @ (vectors[:, keep] / np.sqrt(values[keep]))
            scale = 1.0
        return block, block.shape[1]
