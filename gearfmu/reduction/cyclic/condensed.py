"""Loads of a sector condensed onto its cuts: static compliance of all nodal diameters without inner unknowns.

With y = L⁻¹ f_I of the factor of the interior and g = f_B − K_BI K_II⁻¹ f_I, the compliance of nodal diameter ν between
loads f and f' is

    fᴴ C_ν f' = yᵀ y' + g_νᴴ S_ν⁻¹ g'_ν,        g_ν = g on (minus, plus) seen by ν,

exactly, S_ν as of `fem.harmonic`. yᵀ y' and g are the same for all ν. For ν = 0 and 1 loads are balanced first by the
inertia forces of rigid motion, which are loads of the sector like others.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from gearfmu.fem.cyclic import SectorSpace
from gearfmu.fem.harmonic import Harmonic
from gearfmu.reduction.cyclic.sector import SectorBody

_NEGLIGIBLE = 1e-11  # of the largest: singular values of the loads on the cuts that are left out
_COLUMNS = 128


class CondensedLoads:
    """Loads of one space, k in all: those of a tooth that the space sees (`count`), six of the bore, six of inertia.

    gram : yᵀ y', (k, k). border : g, (b, k). patterns (b, r), parts (r, count): the tooth's columns of g as a product.
    """

    def __init__(self, body: SectorBody, space: SectorSpace):
        self.columns = body.seen_loads(space.parity)
        self.count = len(self.columns)
        teeth = space.from_nodes @ body.load_matrix[self.columns].T
        others = np.hstack([space.from_nodes @ body.bore_moments[0].T, space.mass_matrix @ space.rigid])
        loads = sp.csc_array(sp.hstack([teeth, sp.csc_array(others)]))
        inner = np.empty((space.interior, loads.shape[1]))
        self.border, self._motion = loads[space.interior :].toarray(), loads.T.dot(space.rigid).T
        for first in range(0, loads.shape[1], _COLUMNS):
            columns = slice(first, first + _COLUMNS)
            inner[:, columns], passed = space.factor.forward(loads[: space.interior, columns].toarray())
            self.border[:, columns] += passed
        self.gram = inner.T @ inner
        self.patterns, self.parts = _low_rank(self.border[:, : self.count])

    @property
    def bore(self) -> np.ndarray:
        """Columns of the bore's six loads among all, as a selection (k, 6)."""
        return np.eye(len(self.gram))[:, self.count : self.count + 6]

    @property
    def tooth(self) -> np.ndarray:
        """Columns of the tooth's loads among all, as a selection (k, count)."""
        return np.eye(len(self.gram))[:, : self.count]

    def compliance(self, harmonic: Harmonic, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """leftᴴ C_ν right of combinations of the k loads."""
        left, right = (self._balanced(harmonic, parts) for parts in (left, right))
        cut = harmonic.reduce_border(self.border)
        return left.conj().T @ self.gram @ right + (cut @ left).conj().T @ harmonic.solve_cut(cut @ right)

    def kernel(self, harmonic: Harmonic) -> tuple[np.ndarray, np.ndarray]:
        """Of ν ≥ 2: cut displacement (c, r) per load in `patterns`, and their compliance (r, r)."""
        cut = harmonic.reduce_border(self.patterns)
        moved = harmonic.solve_cut(cut)
        return moved, cut.conj().T @ moved

    def _balanced(self, harmonic: Harmonic, parts: np.ndarray) -> np.ndarray:
        if not harmonic.rigid.shape[1]:
            return parts
        rigid = harmonic.rigid_parts
        parts = parts.astype(np.result_type(parts, rigid))
        parts[-6:] -= rigid @ (rigid.conj().T @ (self._motion @ parts))
        return parts


def _low_rank(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal columns, and rows, whose product is the matrix."""
    left, values, right = sl.svd(matrix, full_matrices=False, check_finite=False)
    kept = values > _NEGLIGIBLE * values.max(initial=0.0)
    return left[:, kept], values[kept, None] * right[kept]
