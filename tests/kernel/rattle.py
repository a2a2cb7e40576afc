"""Small conservation problems for the time step: two bodies with elastic modes, tooth pairs of coupled slices,
both flanks, frozen in place.

Orders of magnitude are those of a steel spur pair (1 kg a gear, 7e8 N/m of massless path a tooth pair,
modes from 4 to 60 kHz). Gaps of drive flanks grow with
x_B − x_A, gaps of coast flanks shrink with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from reference_dg4 import Problem

PAIR_COMPLIANCE = 1.5e-9  # m/N of one tooth pair under uniform load
LOCAL_COMPLIANCE = 0.15  # share of a slice's own compliance that its neighbours do not feel


@dataclass(frozen=True)
class Layout:
    """pairs and slices in contact; backlash between the flanks, m (negative:
    jammed); coupling C_ab/C_aa of slices of one pair;
    modes per body; zeta; stops: stiffness of each body's bearing as a bilateral row, N/m, or 0; seed."""

    pairs: int = 2
    slices: int = 5
    backlash: float = 60e-6
    coupling: float = 0.6
    modes: int = 8
    zeta: float = 0.0
    bearing: float = 0.0
    dashpot: float = 0.0
    unevenness: float = 0.5e-6
    seed: int = 1


def rattle(layout: Layout) -> Problem:
    """The problem of a layout; modal coordinate 0 is body A's rigid motion, `layout.modes + 1` that of body B."""
    rng = np.random.default_rng(layout.seed)
    bodies = [_body(layout, mass, rng) for mass in (0.8, 1.7)]
    omega = np.concatenate([b[0] for b in bodies])
    place = np.hstack([-bodies[0][1], bodies[1][1]])  # x_B − x_A at every slice of every pair
    compliance = np.kron(np.eye(layout.pairs), _pair_compliance(layout))
    uneven = layout.unevenness * rng.standard_normal(2 * len(place))
    rows = np.vstack([place, -place])
    full = np.kron(np.eye(2), compliance)
    offset = np.concatenate([np.zeros(len(place)), np.full(len(place), layout.backlash)]) + uneven
    bilateral = np.zeros(len(offset), bool)
    dashpot = np.full(len(offset), layout.dashpot)
    if layout.bearing:
        held = np.zeros((2, len(omega)))
        held[0, : layout.modes + 1], held[1, layout.modes + 1 :] = bodies[0][1][0], bodies[1][1][0]
        rows, offset = np.vstack([rows, held]), np.concatenate([offset, np.zeros(2)])
        full = np.block([[full, np.zeros((len(full), 2))], [np.zeros((2, len(full))), np.eye(2) / layout.bearing]])
        bilateral, dashpot = np.concatenate([bilateral, [True, True]]), np.concatenate([dashpot, np.zeros(2)])
    return Problem(omega, np.where(omega > 0, layout.zeta, 0.0), rows, full, offset, bilateral, dashpot)


def _body(layout: Layout, mass: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """ω (n,) and the displacement of every slice per mode (pairs·slices, n) of one body, rigid motion first."""
    omega = np.concatenate([[0.0], 2 * np.pi * np.sort(rng.uniform(4e3, 60e3, layout.modes))])
    z = np.linspace(-1, 1, layout.slices) if layout.slices > 1 else np.zeros(1)
    pairs = [
        rng.uniform(-1, 1, layout.modes) + np.outer(z, 0.3 * rng.uniform(-1, 1, layout.modes))
        for _ in range(layout.pairs)
    ]
    elastic = np.vstack(pairs) / np.sqrt(mass)
    return omega, np.hstack([np.full((len(elastic), 1), 1 / np.sqrt(mass)), elastic])


def _pair_compliance(layout: Layout) -> np.ndarray:
    """(slices, slices): neighbours share the tooth's bending; the mean under uniform load is PAIR_COMPLIANCE."""
    n, r = layout.slices, layout.coupling
    distance = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) / max(n, 2)
    shape = r ** (1 + distance) / r ** (1 / max(n, 2))
    np.fill_diagonal(shape, 1 + LOCAL_COMPLIANCE)
    return PAIR_COMPLIANCE * n**2 / shape.sum() * shape
