"""Lowest eigenmodes by block Lanczos on the flexibility operator, with full reorthogonalisation in the mass product.

Eigenpairs of K φ = ω² M φ are those of C M φ = φ/ω² with C the flexibility of the body without its rigid motion, so
that a free body has no zero eigenvalues left. Source: Grimes, Lewis & Simon, SIAM J. Matrix Anal. 15 (1994).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

_DEPENDENT = 1e-11  # relative norm at which a new direction counts as a combination of the others


class Vibrating(Protocol):
    """A body as the eigensolver sees it: vectors are (n, k), real or complex."""

    @property
    def size(self) -> int: ...

    @property
    def elastic(self) -> int: ...

    @property
    def dtype(self) -> type[float] | type[complex]: ...

    def mass(self, vectors: np.ndarray) -> np.ndarray: ...

    def flexibility(self, loads: np.ndarray) -> np.ndarray: ...


class ModesError(ArithmeticError):
    """The eigensolver did not converge."""


def lowest_modes(
    body: Vibrating, count: int, tolerance: float = 1e-9, block: int = 8, start: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The `count` lowest elastic modes (fewer when the body has fewer).

    Returns ω² (k,), rad²/s², ascending, and mass-normalised shapes (n, k). `tolerance` bounds the residual of
    C M φ = φ/ω² relative to 1/ω², in the mass norm; the error of ω² is of the order of its square. Starts from `start`
    (n, k), approximate modes without rigid motion, or else from `block` fixed random vectors. Raises ModesError when
    the Krylov space ends before `count` modes have converged.
    """
    count = min(count, body.elastic)
    space = _Krylov(body, _random_start(body, min(block, body.elastic)) if start is None else start)
    while True:
        if space.size >= count:
            values, vectors, residual = (part[..., :count] for part in space.ritz())
            if np.all(residual <= tolerance * values):
                return 1 / values, space.basis() @ vectors
        if not space.grow():
            raise ModesError(f"not all of {count} modes found: the Krylov space ends at {space.size} vectors")


def _random_start(body: Vibrating, block: int) -> np.ndarray:
    start: np.ndarray = np.random.default_rng(1).standard_normal((body.size, block)).astype(body.dtype)
    return body.flexibility(body.mass(start))


class _Krylov:
    """Basis V, orthonormal in M, and T = Vᴴ M C M V, one block larger with each `grow`."""

    def __init__(self, body: Vibrating, start: np.ndarray):
        self.body, self.size = body, 0
        self.v: np.ndarray = np.empty((body.size, 0), body.dtype, order="F")
        self.mv = self.v.copy(order="F")
        self.t: np.ndarray = np.zeros((0, 0), body.dtype)
        self.last, self.next = start.shape[1], start
        self.grow()

    def basis(self) -> np.ndarray:
        return self.v[:, : self.size]

    def grow(self) -> bool:
        """Add the pending block and prepare the one after it; False when nothing independent is left."""
        block, inertia = self._orthonormal(self.next)
        if block.shape[1] == 0:
            return False
        self._append(block, inertia)
        image = self.body.flexibility(inertia)
        column = self._project(image)
        self.t[: self.size, self.size - self.last : self.size] = column
        self.next = image - self.basis() @ column
        return True

    def ritz(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ritz values 1/ω² descending, their vectors in the basis and residual norms in M."""
        t = self.t[: self.size, : self.size]
        upper = np.triu(t, 1)
        values, vectors = np.linalg.eigh(upper + upper.conj().T + np.diag(t.diagonal().real))
        values, vectors = values[::-1], vectors[:, ::-1]
        gram = self.next.conj().T @ self.body.mass(self.next)
        tail = vectors[-self.last :]
        return values, vectors, np.sqrt(np.abs(np.einsum("ik,ij,jk->k", tail.conj(), gram, tail)))

    def _project(self, block: np.ndarray) -> np.ndarray:
        """Vᴴ M block."""
        return (block.conj().T @ self.mv[:, : self.size]).conj().T

    def _append(self, block: np.ndarray, inertia: np.ndarray) -> None:
        self.last = block.shape[1]
        first, self.size = self.size, self.size + self.last
        if self.size > self.v.shape[1]:
            room = 2 * self.size
            for name in ("v", "mv"):
                larger: np.ndarray = np.empty((self.body.size, room), self.body.dtype, order="F")
                larger[:, :first] = getattr(self, name)[:, :first]
                setattr(self, name, larger)
            t: np.ndarray = np.zeros((room, room), self.body.dtype)
            t[:first, :first] = self.t[:first, :first]
            self.t = t
        self.v[:, first : self.size], self.mv[:, first : self.size] = block, inertia

    def _orthonormal(self, block: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The block freed of the basis and made orthonormal, without directions that vanish; and M times it."""
        limit = None
        for _ in range(2):
            block = block - self.basis() @ self._project(block)
            inertia = self.body.mass(block)
            values, vectors = np.linalg.eigh(block.conj().T @ inertia)
            limit = _DEPENDENT**2 * values.max(initial=0.0) if limit is None else 0.25
            keep = values > max(limit, 0.0)
            turn = vectors[:, keep] / np.sqrt(values[keep])
            block, inertia = block @ turn, inertia @ turn
        return block, inertia
