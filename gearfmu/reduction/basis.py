"""A basis of a body's elastic motion as it grows, and how large it shall be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearfmu.errors import BodyError
from gearfmu.reduction.elastic import Elastic

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
