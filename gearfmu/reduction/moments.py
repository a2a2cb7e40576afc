"""A basis as it grows, and moments of the transfer matrix to grow it by: Krylov blocks of (K − σM)⁻¹ at real shifts σ
in Ω², zero among them.

H(s) = B (K − sM)⁻¹ Bᵀ with s = Ω²/(1 + 2iζ) is, with structural damping, the undamped transfer matrix at a complex
s, so that undamped real moments serve every damping ratio. The blocks
    X₁ = (K − σM)⁻¹ Bᵀ,   X_{j+1} = (K − σM)⁻¹ M X_j,   j ≤ p,
make the projected H̄ agree with H at s = σ in value and 2p − 1 derivatives (symmetric projection doubles them).
For a free body rigid motion is taken out: at σ = 0 the blocks are those of the flexibility P K⁺ Pᵀ.
Theory, eqs. 24 and 26. Source: Grimme, thesis, Urbana 1997, th. 3.1; Lehner & Eberhard, Multibody Syst. Dyn. 17 (2007)
157 (flexible multibody systems); Beattie & Gugercin, Syst. Control Lett. 58 (2009) 225 (structured systems).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearfmu.errors import BodyError
from gearfmu.reduction.elastic import Elastic, elastic
from gearfmu.reduction.full_order import FullOrder

BAND = (50.0, 10e3)
DEPENDENT = 1e-10  # norm, relative to that before projection, at which a direction counts as known
_FIRST, _ROOM = 640, 4  # room for vectors and by how much it grows: what is not written yet takes no memory


@dataclass(frozen=True)
class Size:
    """How large a basis shall be. Raises BodyError for what is no size.

    count : elastic vectors n; rigid modes come on top. A method may return fewer, never more. band : Hz, places the
    expansion points of the Krylov method.
    """

    count: int
    band: tuple[float, float] = BAND

    def __post_init__(self) -> None:
        if self.count < 1:
            raise BodyError(f"size: count = {self.count}: at least one vector")
        if not 0 <= self.band[0] < self.band[1]:
            raise BodyError(f"size: band = {self.band} Hz: from a lower to a higher frequency")


class Growing:
    """A basis that grows block by block, orthonormal in M and to the rigid modes.

    Each block is scaled to unit columns, freed of what is there, twice, and of directions that then are shorter than
    `DEPENDENT` (deflation relative to the norm before projection). Source: Grimme, Krylov projection methods for model
    reduction, thesis, Urbana 1997; twice: Giraud et al., Numer. Math. 101 (2005) 87.
    """

    def __init__(self, space: Elastic):
        self.space, self.size = space, 0
        self._v = np.empty((space.size, 0), order="F")

    @property
    def vectors(self) -> np.ndarray:
        """V (N, n)."""
        return self._v[:, : self.size]

    def add(self, block: np.ndarray) -> np.ndarray:
        """Append what is new in `block` (N, k); returns M times the new vectors (N, ≤ k)."""
        block, inertia = self._new(block)
        first, self.size = self.size, self.size + block.shape[1]
        self._reserve()
        self._v[:, first : self.size] = block
        return inertia

    def _new(self, block: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        norm = np.sqrt(np.einsum("ij,ij->j", block, self.space.mass(block)))
        block = block[:, norm > 0] / norm[norm > 0]
        limit = DEPENDENT**2
        for _ in range(2):
            block = self.space.gauge(block)
            block = block - self.vectors @ (self.vectors.T @ self.space.mass(block))
            inertia = self.space.mass(block)
            values, turn = np.linalg.eigh(block.T @ inertia)
            keep = np.flatnonzero(values > limit)[::-1]
            turn = turn[:, keep] / np.sqrt(values[keep])
            block, inertia, limit = block @ turn, inertia @ turn, 0.25
        return block, inertia

    def _reserve(self) -> None:
        if self.size <= self._v.shape[1]:
            return
        old = self._v
        self._v = np.empty((self.space.size, max(self.size, _FIRST, _ROOM * old.shape[1])), order="F")
        self._v[:, : old.shape[1]] = old


def input_loads(body: FullOrder) -> np.ndarray:
    """Unit loads at all interfaces, moments divided by the body's length: (N, m)."""
    return body.rows().T.toarray() / body.scales()


def static_response(body: FullOrder) -> np.ndarray:
    """Displacement under the `input_loads`: (N, m), the first block of moments at 0. Made once for each body."""
    space = elastic(body)
    return space.kept("static response", lambda: space.flexibility(input_loads(body)))


class Expansion:
    """One expansion point of a body: `advance` adds the next block of moments to a basis.

    known : vectors whose Rayleigh quotients tell of eigenvalues at which the point must not lie.
    shift : σ as used, rad²/s² (moved when it was an eigenvalue).
    """

    def __init__(self, body: FullOrder, shift: float, known: Growing | None = None):
        self.body = body
        estimates = None if known is None else _ritz_values(body, known)
        self._solver = elastic(body).shifted(shift, estimates) if shift else None
        self.shift = self._solver.shift if self._solver else 0.0
        self._loads: np.ndarray | None = None

    def advance(self, basis: Growing) -> None:
        """Add the next power of this point to `basis`, unless the last one brought nothing new."""
        if self._loads is None or self._loads.shape[1]:
            self._loads = basis.add(self._next())

    def _next(self) -> np.ndarray:
        if self._solver:
            return self._solver.solve(input_loads(self.body) if self._loads is None else self._loads)
        return static_response(self.body) if self._loads is None else elastic(self.body).flexibility(self._loads)


def _ritz_values(body: FullOrder, basis: Growing) -> np.ndarray:
    """Eigenvalues of K projected on a basis, rad²/s²."""
    return np.linalg.eigvalsh(basis.vectors.T @ (body.stiffness @ basis.vectors))


def expansion_points(count: int, band: tuple[float, float]) -> np.ndarray:
    """`count` real points σ = Ω², rad²/s²: 0 and the rest on Chebyshev points of the second kind in Ω up to the upper
    end of `band` (Hz)."""
    if count == 1:
        return np.zeros(1)
    top = 2 * np.pi * band[1]
    return (top * 0.5 * (1 - np.cos(np.pi * np.arange(count) / (count - 1)))) ** 2
