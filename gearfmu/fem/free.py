"""A free body as one finite-element model: rigid modes explicit, flexibility with inertia relief in the mean-axis
gauge.

C = P K⁺ Pᵀ with P = I − R Rᵀ M, R the mass-normalised rigid modes: loads are first balanced by the inertia forces of
the rigid motion they cause, the displacement is then freed of rigid motion (M-orthogonal: mean-axis frame).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from gearfmu.fem.coupling import rigid_modes
from gearfmu.fem.factor import Factor


class Balanced:
    """What M and the mass-normalised rigid motions `rigid` say of loads and displacements."""

    mass_matrix: sp.csr_array
    rigid: np.ndarray
    _mass_rigid: np.ndarray

    def mass(self, vectors: np.ndarray) -> np.ndarray:
        """M v."""
        return self.mass_matrix @ vectors

    def balance(self, loads: np.ndarray) -> np.ndarray:
        """Pᵀ f: loads together with the inertia forces of the rigid motion they cause."""
        return loads - self._mass_rigid @ (self.rigid.T @ loads)

    def gauge(self, vectors: np.ndarray) -> np.ndarray:
        """P u: displacement without its rigid part."""
        return vectors - self.rigid @ (self._mass_rigid.T @ vectors)


class FreeBody(Balanced):
    """Free–free body from its stiffness and mass matrix (3N, 3N), nodes (N, 3) and elements (E, 20).

    `rigid` (3N, 6): mass-normalised rigid modes; `mass(v)`, `flexibility(f)` as the eigensolver needs them.
    """

    dtype = float

    def __init__(self, stiffness: sp.csr_array, mass: sp.csr_array, nodes: np.ndarray, elements: np.ndarray):
        self.stiffness, self.mass_matrix, self.elements = stiffness, mass, elements
        self.size, self.elastic = 3 * len(nodes), 3 * len(nodes) - 6
        fields = rigid_modes(nodes)
        self.rigid_mass = fields.T @ (mass @ fields)
        self.rigid = sl.solve_triangular(np.linalg.cholesky(self.rigid_mass), fields.T, lower=True).T
        self._mass_rigid = mass @ self.rigid
        self._held = sl.qr(fields.T, mode="r", pivoting=True)[1][:6]

    @cached_property
    def _factor(self) -> tuple[np.ndarray, Factor]:
        free = np.setdiff1d(np.arange(self.size), self._held)
        return free, Factor(self.stiffness[free][:, free], self.elements, free // 3)

    def flexibility(self, loads: np.ndarray) -> np.ndarray:
        """C f = P K⁺ Pᵀ f, N → m. K⁺ by six statically determinate supports, which carry nothing of balanced loads."""
        free, factor = self._factor
        solution = np.zeros((self.size, loads.shape[1]))
        solution[free] = factor.solve(self.balance(loads)[free])
        return self.gauge(solution)
