"""Finite elements of a body that spins about z: what its axes, which turn with it, add to M q̈ + K q = f.

In axes that turn at Ω a displacement u has the acceleration ü + 2Ω e_z × u̇ + Ω̇ e_z × (X + u) − Ω² (X + u)_xy, so that

    M q̈ + 2Ω G q̇ + [K + Ω² (K_σ − M_xy)] q = Ω² f_c,      G = ∫ρ Nᵀ (e_z × N),   f_c = ∫ρ Nᵀ X_xy

G: Coriolis (skew), K_σ: stiffening by the stresses of f_c, M_xy: softening. Source: Bathe, Finite Element Procedures,
6.2 (initial stress stiffness); Southwell and Gough 1921 (the parts of a frequency add up, ω² = ω₀² + B Ω²).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import hex20
from gearfmu.fem.cyclic import SectorSpace


def turn_quarter(fields: np.ndarray) -> np.ndarray:
    """e_z × u of nodal vectors (3N, k)."""
    u = fields.reshape(-1, 3, *fields.shape[1:])
    return np.stack([-u[:, 1], u[:, 0], np.zeros_like(u[:, 2])], axis=1).reshape(fields.shape)


def leave_axial(fields: np.ndarray) -> np.ndarray:
    """Nodal vectors (3N, k) without their component along z."""
    return fields * np.tile([1.0, 1.0, 0.0], len(fields) // 3).reshape(-1, *[1] * (fields.ndim - 1))


def growth(space: SectorSpace, nodes: np.ndarray, mass: sp.csr_array) -> np.ndarray:
    """Displacement (3N,) of a sector under the centrifugal load of all sectors per square of the speed, m·s²; space:
    symmetric about mid-width, or of all fields."""
    harmonic = space.harmonic(0)
    centrifugal = np.asarray(mass @ leave_axial(nodes.ravel()))  # f_c, kg·m
    load = harmonic.reduce((space.from_nodes @ centrifugal)[:, None])
    return np.asarray(space.to_nodes @ harmonic.expand(harmonic.flexibility(load)))[:, 0]


def stress_stiffness(
    nodes: np.ndarray, elements: np.ndarray, material: hex20.Material, displacement: np.ndarray
) -> sp.csr_array:
    """K_σ (N, N) of the stresses that a displacement (3N,) makes, the same for each of the three components.

    nodes (N, 3), m; elements (E, 20). In N/m for a displacement in m; here in kg for one per square of the speed.
    """
    xi, weight = hex20.gauss_hex()
    gradient, positions = hex20.shape_gradient(xi), nodes[elements]
    jacobian = np.einsum("gan,enb->egab", gradient, positions)
    spatial = np.linalg.solve(jacobian, np.broadcast_to(gradient, (len(positions), *gradient.shape)))
    slope = np.einsum("egan,enc->egac", spatial, displacement.reshape(-1, 3)[elements], optimize=True)
    strain = 0.5 * (slope + slope.transpose(0, 1, 3, 2))
    d = hex20.elasticity(material)
    stress = 2 * d[3, 3] * strain + d[0, 1] * np.trace(strain, axis1=2, axis2=3)[..., None, None] * np.eye(3)
    measure = np.linalg.det(jacobian) * weight
    blocks = np.einsum("eg,egan,egab,egbm->enm", measure, spatial, stress, spatial, optimize=True)
    return hex20.symmetric(hex20.scattered(blocks, elements, len(nodes)))
