"""Which modes of a gear are dynamic at which fidelity level: those below the cut of the level that flanks feel. What is
left out is static: its compliance is in the model at every level."""

from __future__ import annotations

import numpy as np

from gearfmu.quantities import kernel_number
from gearfmu.stagefile.tables.connections import LevelSpec

LEVELS = ("rigid", "fast", "standard", "full")
RIGID, FAST, STANDARD, FULL = range(len(LEVELS))
SHARED_BELOW = kernel_number(
    "SHARED_BELOW"
)  # of the cut of level fast: modes below are dynamic at every level (rigid: of shared gears only)
FELT = 3e-4  # of the compliance of all modes: modes below are static at levels fast and standard
WITHIN = 0.15  # of a cut: where the widest gap between two modes is looked for


def lowest_levels(
    omega: np.ndarray, member: np.ndarray, rows: np.ndarray, degrees: np.ndarray, cuts: LevelSpec
) -> np.ndarray:
    """(m,) the lowest level at which each mode is dynamic.

    omega (m,) rad/s, ascending; member (m,): 0 single, 1 and 2 of a pair; rows (2, P, A, m), kg^-½: displacement of a
    flank by Legendre `degrees` (A,) over the face width.
    """
    found = np.full(omega.size, FULL)
    felt = _shares(omega, member, rows, degrees) >= FELT
    for level, cut in ((STANDARD, cuts.standard_cut), (FAST, cuts.fast_cut)):
        n = _below(omega, member, 2 * np.pi * cut)
        found[:n][felt[:n]] = level
    found[: _below(omega, member, 2 * np.pi * SHARED_BELOW * cuts.fast_cut)] = RIGID
    return found


def _shares(omega: np.ndarray, member: np.ndarray, rows: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """(m,) compliance of a flank by each mode or pair where it is largest, of that by all: means over the width."""
    if not omega.size:
        return np.zeros(0)
    yields = np.einsum("fpam,a->fpm", (rows / omega) ** 2, 1 / (2 * degrees + 1))
    share = yields.max(axis=(0, 1)) / yields.sum(axis=2).max()
    first = np.flatnonzero(member == 1)
    share[first] = share[first + 1] = share[first] + share[first + 1]
    return share


def _below(omega: np.ndarray, member: np.ndarray, cut: float) -> int:
    """Number of modes below a cut in rad/s, moved to the widest gap nearby: never inside a cluster or a pair."""
    best = int(np.searchsorted(omega, cut))
    if best == omega.size:
        return best
    at = np.arange(1, omega.size)
    near = (member[1:] != 2) & (omega[1:] >= (1 - WITHIN) * cut) & (omega[:-1] <= (1 + WITHIN) * cut)
    gaps = np.where(near, omega[1:] / omega[:-1] - 1, 0.0)
    if gaps.size and gaps.max() > 0.0:
        return int(at[np.argmax(gaps)])
    return best + bool(member[best] == 2)
