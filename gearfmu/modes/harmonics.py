"""Nodal diameters of a shape by projection on cos and sin around the axis."""

from __future__ import annotations

import numpy as np

from gearfmu.modes.shapes import cylindrical

MOST = 12
CELLS = 24  # of radius and of width: points in one cell are compared with each other around the axis


def harmonic_shares(points: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Parts (MOST + 1,) of a shape's mean square that go with cos and sin of ν times the angle, ν = 0 … MOST.

    points (P, 3) m of a body of revolution or nearly so, shape (P, 3). The cylindrical components of the points in each
    ring-shaped cell (of radius and width) are fitted by least squares, one ν at a time: where points stand at few
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
