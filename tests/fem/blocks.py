"""Structured hex20 meshes for tests: boxes and rings, from a mapped grid."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp
from scipy.linalg import expm
from scipy.optimize import brentq

from gearfmu.fem import hex20
from gearfmu.fem.coupling import rigid_modes
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import FullOrder

STEEL = SimpleNamespace(youngs_modulus=206e9, poisson_ratio=0.3, density=7850.0)
COUNT = 41  # modes of a body by one sector that are compared with those of the whole


def free_body(stiffness: sp.csr_array, mass: sp.csr_array, nodes: np.ndarray, cells: np.ndarray) -> Elastic:
    """A body that nothing holds, without any symmetry, from its matrices."""
    of_dof = np.repeat(np.arange(len(nodes)), 3)
    return Elastic(FullOrder("body", stiffness, mass, rigid_modes(nodes), (), (), 1.0, cells, of_dof))


@cache
def modes_of(whole: Elastic) -> tuple[np.ndarray, np.ndarray]:
    """Squared frequencies and shapes of a few modes more than COUNT."""
    return lowest_modes(whole, COUNT + 6, block=12)


def grid_mesh(cells: tuple[int, int, int], mapping: Callable[[np.ndarray], np.ndarray]):
    """Nodes (N, 3) and hex20 elements (E, 20) of the unit cube cut into cells and mapped; coincident nodes merged."""
    lattice = np.stack(np.meshgrid(*(np.arange(c) for c in cells), indexing="ij"), axis=-1).reshape(-1, 3)
    keys = 2 * lattice[:, None, :] + (hex20.NATURAL[None] + 1).astype(int)
    positions = mapping(keys.reshape(-1, 3) / (2 * np.array(cells)))
    scale = np.ptp(positions, axis=0).max()
    _, index, inverse = np.unique(np.round(positions / scale, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    return positions[index], inverse.reshape(-1, 20)


def box(cells: tuple[int, int, int], size: tuple[float, float, float]):
    """A box centred on the origin."""
    return grid_mesh(cells, lambda u: (u - 0.5) * np.array(size))


def ring_mapping(inner: float, outer: float, height: float, start: float, angle: float):
    def mapping(u: np.ndarray) -> np.ndarray:
        r, phi = inner + (outer - inner) * u[:, 0], start + angle * u[:, 1]
        return np.stack([r * np.cos(phi), r * np.sin(phi), height * (u[:, 2] - 0.5)], axis=1)

    return mapping


def ring(cells: tuple[int, int, int], inner: float, outer: float, height: float):
    """A closed ring about z; cells = (radial, around, axial)."""
    return grid_mesh(cells, ring_mapping(inner, outer, height, 0.0, 2 * np.pi))


def ring_sector(cells: tuple[int, int, int], inner: float, outer: float, height: float, teeth: int):
    """Sector of 2π/teeth centred on +x: namespace with nodes, elements, teeth, cut_minus, cut_plus, sets."""
    angle = 2 * np.pi / teeth
    nodes, elements = grid_mesh(cells, ring_mapping(inner, outer, height, -angle / 2, angle))
    phi = np.arctan2(nodes[:, 1], nodes[:, 0])
    r = np.hypot(nodes[:, 0], nodes[:, 1])
    order = np.lexsort((np.round(nodes[:, 2], 9), np.round(r, 9)))
    minus, plus = (order[np.abs(phi[order] - s * angle / 2) < 1e-9] for s in (-1, 1))
    bore = np.flatnonzero(np.abs(r - inner) < 1e-9)
    return SimpleNamespace(
        nodes=nodes, elements=elements, teeth=teeth, cut_minus=minus, cut_plus=plus, sets={"bore": bore}
    )


def free_bending(
    length: float, bending: float, shear: float, mass: float, inertia: float, bracket: tuple[float, float]
) -> float:
    """Frequency (rad/s) between those of `bracket`. bending, shear: stiffness (N·m², N) of the section; mass, inertia:
    of rotation, per length (kg/m, kg·m). The state (w, θ, M, Q) is carried over the length by the matrix
    exponential."""

    def determinant(omega: float) -> float:
        a = np.zeros((4, 4))
        a[0, 1], a[0, 3], a[1, 2] = 1.0, 1 / shear, 1 / bending
        a[2, 3], a[2, 1], a[3, 0] = -1.0, -inertia * omega**2, -mass * omega**2
        scale = np.array([length, 1.0, bending / length, bending / length**2])
        return float(np.linalg.det(expm(a * length * scale / scale[:, None])[2:, :2]))

    return brentq(determinant, *bracket, xtol=1e-6, rtol=1e-14)
