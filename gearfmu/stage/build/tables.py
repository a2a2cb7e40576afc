"""Reduced body → the tables of one gear in the model blob: rows and compliances on an even grid of rolls, for the
width functions that the stage can excite."""

from __future__ import annotations

import numpy as np

from gearfmu.body import Body

ROLLS = 48  # error and price of the grid: docs/decisions.md
MOST_FUNCTIONS = 6
OFFSETS = range(-3, 4)


def resampling(roll: np.ndarray, s_form: float, s_tip: float, rolls: int = ROLLS) -> np.ndarray:
    """(rolls, R) weights from values at the body's Chebyshev points of the first kind `roll` (R,) to an even grid on
    [s_form, s_tip].

    Barycentric formula with the known weights (−1)^k sin((2k + 1)π/2R) (Berrut & Trefethen 2004). Applied to both
    sides of a compliance it stays positive semidefinite. (scipy's interpolator permutes the points at random: two
    calls, two last bits.)
    """
    k = np.arange(roll.size)
    weight = (-1.0) ** k * np.sin((2 * k + 1) * np.pi / (2 * roll.size))
    distance = np.linspace(s_form, s_tip, rolls)[:, None] - roll
    hit = distance == 0.0
    terms = weight / np.where(hit, 1.0, distance)
    terms = np.where(hit.any(axis=1, keepdims=True), hit.astype(float), terms)
    return terms / sum(terms.T)[:, None]


def stored_points(body: Body, s_form: float, s_tip: float, rolls: int) -> tuple[np.ndarray, np.ndarray]:
    """Where a model stores what a flank reads: at the body's own R points, or on the even grid where that has fewer.

    (P, R) weights from the body's points to those that are stored, (rolls, P) from these to the even grid.
    """
    to_grid = resampling(body.toothed.roll, s_form, s_tip, rolls)
    own = body.toothed.roll.size < rolls
    return (np.eye(body.toothed.roll.size), to_grid) if own else (to_grid, np.eye(rolls))


def blend(weights: np.ndarray, values: np.ndarray, axis: int) -> np.ndarray:
    """`values` with `axis` (R,) replaced by (rolls,): Σ_r weights[:, r]·values[r], summed in the order of r.

    Element by element on purpose: matrix products may sum in another order from call to call, and equal inputs must
    give an equal blob.
    """
    moved = np.moveaxis(values, axis, 0)
    if np.array_equal(weights, np.eye(len(moved))):
        return values.astype(float)
    flat = np.ascontiguousarray(moved, float).reshape(len(moved), -1)
    total = np.zeros((weights.shape[0], flat.shape[1]))
    part = np.empty_like(total)
    for weight, value in zip(weights.T, flat, strict=True):
        total += np.multiply(weight[:, None], value, out=part)
    return np.moveaxis(total.reshape(-1, *moved.shape[1:]), 0, axis)


def symmetric_functions(count: int) -> np.ndarray:
    """Degrees of the Legendre functions that a load symmetric about mid-width can excite.

    A spur pair without lead modification loads its slices symmetrically: odd functions and antisymmetric modes stay
    at rest exactly.
    """
    return np.arange(0, count, 2)


def excited_modes(body: Body, degrees: np.ndarray) -> np.ndarray:
    """Indices of the modes with a row in the chosen width functions or in the planar motion of the bore; pairs stay
    together. Of modes of no parity (imported bodies without a mirror at mid-width) the rows of the chosen functions
    count."""
    flank = body.toothed
    rows = np.abs(flank.rows[:, :, degrees, :]).max(axis=(0, 1, 2)) / np.abs(flank.rows).max()
    seen = (rows > 1e-9) & (flank.parity >= 0)
    second = np.flatnonzero(flank.part == 2)
    seen[second] = seen[second - 1] = seen[second] | seen[second - 1]
    return np.flatnonzero(seen)
