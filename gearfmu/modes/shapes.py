"""Modes of one body with their shapes on its surface: the source of pictures, .vtu files and tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

MOST = 12
CELLS = 24  # of radius and of width: points in one cell are compared with each other around the axis

DRAWN = 0.05  # of the body's diameter: the largest displacement as it is drawn


@dataclass(frozen=True)
class Mode:
    """One frequency of a body: a single mode, or the pair of a cyclic body.

    numbers : which modes of the body, counted from 1. frequency : Hz. damping_ratio. parity : +1 symmetric about
    mid-width (motion in the plane), −1 antisymmetric (out of it), 0 no such symmetry. nodal_diameter : ν, and
    `harmonic_share` the part of the surface's mean square that has it (1 in a body of many equal sectors).
    energy : (3,) shares of the kinetic energy in radial, tangential and axial motion.
    shape : (1 or 2, P, 3) displacement of the surface's points in kg^-½, mass-normalised, of the mode or of either one
    of the pair.
    """

    numbers: tuple[int, ...]
    frequency: float
    damping_ratio: float
    parity: int
    nodal_diameter: int
    harmonic_share: float
    energy: np.ndarray
    shape: np.ndarray

    @property
    def motion(self) -> str:
        """In words: in or out of the plane, by symmetry about mid-width, else by where most of the energy is."""
        parity = self.parity or (-1 if self.energy[2] > 0.5 else 1)
        return "in-plane" if parity > 0 else "out-of-plane"

    @property
    def name(self) -> str:
        """Name of the shape: umbrella, torsion, breathing, tilting, …"""
        radial, tangential, axial = self.energy
        if self.motion == "out-of-plane":
            return {0: "umbrella" if axial > 0.5 else "counter-torsion", 1: "tilting"}.get(
                self.nodal_diameter, "disc bending"
            )
        turning = tangential > 0.8 * (radial + tangential)
        return {0: "torsion" if turning else "breathing", 1: "shifting"}.get(
            self.nodal_diameter, "tangential shear" if turning else f"{self.nodal_diameter} lobes"
        )


@dataclass(frozen=True, eq=False)
class BodyModes:
    """Modes of one body by ascending frequency. points (P, 3) m: nodes of the finite elements' surface; faces (F, 8):
    quadratic quadrilaterals (VTK order), normals outward."""

    name: str
    points: np.ndarray
    faces: np.ndarray
    modes: tuple[Mode, ...]

    def drawn(self, mode: Mode) -> np.ndarray:
        """The shape of a mode scaled so that its largest displacement is `DRAWN` of the body's diameter, m: (1 or 2, P,
        3)."""
        diameter = 2 * np.linalg.norm(self.points[:, :2], axis=1).max()
        return mode.shape * (DRAWN * diameter / np.linalg.norm(mode.shape[0], axis=1).max())


def energy_shares(nodes: np.ndarray, mass: sp.csr_array, shape: np.ndarray) -> np.ndarray:
    """Shares (3,) of a shape's kinetic energy in radial, tangential and axial motion about z.

    nodes (N, 3) m; mass (N, N) kg: of each component alike; shape (N, 3) real or complex. The consistent mass is
    applied to the nodal values of the cylindrical components; their sum differs from the energy by the turn of the
    axes within an element and is scaled to 1.
    """
    parts = np.array([np.vdot(u, mass @ u).real for u in cylindrical(nodes, shape).T])
    return parts / parts.sum()


def cylindrical(points: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Radial, tangential and axial components (P, 3) of vectors (P, 3), real or complex, at points (P, 3)."""
    radius = np.hypot(points[:, 0], points[:, 1])
    c, s = (points[:, k] / np.where(radius > 0, radius, 1.0) for k in (0, 1))
    radial, tangential = c * vectors[:, 0] + s * vectors[:, 1], c * vectors[:, 1] - s * vectors[:, 0]
    return np.stack([radial, tangential, vectors[:, 2]], axis=1)


def harmonic_shares(points: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Parts (MOST + 1,) of a shape's mean square that go with cos and sin of ν times the angle, ν = 0 … MOST.

    points (P, 3) m of a body of revolution or nearly so, shape (P, 3). The cylindrical components of the points in each
    ring-shaped cell (of radius and width) are fitted by least squares, one ν at a time: where points lie at few
    angles, as on bolts, several ν fit and the parts add up to more than 1.
    """
    angle, radius = np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])
    field = cylindrical(points, shape)
    cell = _cells(radius) * CELLS + _cells(points[:, 2])
    total, shares = (field**2).sum(), np.zeros(MOST + 1)
    for number in np.unique(cell):
        here = np.flatnonzero(cell == number)
        for nu in range(MOST + 1):
            basis = np.stack([np.cos(nu * angle[here]), np.sin(nu * angle[here])][: 2 if nu else 1], axis=1)
            fitted = basis @ np.linalg.lstsq(basis, field[here], rcond=None)[0]
            shares[nu] += (fitted**2).sum() / total
    return shares


def main_harmonic(points: np.ndarray, shape: np.ndarray, cyclic_index: int, sectors: int) -> tuple[int, float]:
    """Nodal diameter of a mode of a cyclic body, and its share: `cyclic_index`, and 1, with many sectors; with few of
    them the strongest of those with this index (ν = index, N − index, N + index …)."""
    if sectors > MOST:
        return cyclic_index, 1.0
    possible = [nu for nu in range(MOST + 1) if 0 in ((nu - cyclic_index) % sectors, (nu + cyclic_index) % sectors)]
    shares = harmonic_shares(points, shape)[possible]
    return possible[int(np.argmax(shares))], float(shares.max())


def _cells(values: np.ndarray) -> np.ndarray:
    """Number of each value's cell; cells are a little wider than the span over CELLS, and lie so that equal values but
    for rounding share one."""
    span = max(np.ptp(values), 1e-6 * np.abs(values).max())
    return ((values - values.min()) / span * (CELLS - 1) + 0.37).astype(int)
