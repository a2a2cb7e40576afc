"""The path that a contact's dashpot is parallel to (docs/theory.md, 2.5), and what a damping constant is worth on
it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial.legendre import Legendre

from gearfmu.body import ReducedBody
from gearfmu.geometry import PairGeometry
from gearfmu.spec.stage import StageSpec

PATH_SHARE = 0.95  # of the residual beyond all stored modes: what a contact's dashpot is parallel to (gk_system.c)


def strip_weights(slices: int, functions: int) -> np.ndarray:
    """(slices, functions): load of each slice on the width functions."""
    edges = np.linspace(-1, 1, slices + 1)
    integral = [Legendre.basis(a).integ() for a in range(functions)]
    return np.array(
        [
            [(2 * a + 1) * (p(high) - p(low)) / (high - low) for a, p in enumerate(integral)]
            for low, high in zip(edges[:-1], edges[1:], strict=True)
        ]
    )


def residual_path(body: ReducedBody, slices: int) -> float:
    """Path of a contact's dashpot in one tooth: its share of the deflection beyond all stored modes under 1 N shared
    evenly by the slices, mean over the roll, m/N."""
    weights = strip_weights(slices, body.flank_rows.shape[2]).mean(axis=0)
    omega2 = (2 * np.pi * body.frequency) ** 2
    rows = body.flank_rows[0]
    beyond = body.static_ff[0, 0, 0].diagonal(axis1=0, axis2=1).transpose(2, 0, 1)  # (rolls, functions, functions)
    beyond = beyond - np.einsum("ian,ibn->iab", rows / omega2, rows)
    return PATH_SHARE * float(np.einsum("a,iab,b->i", weights, beyond, weights).mean())


def local_path(spec: StageSpec, force: float) -> float:
    """Tangent of the local law (theory, eq. 7) for one tooth pair that carries `force`, both bodies, m/N."""
    pair = PairGeometry.of(spec)
    rolls = [np.sqrt(gear.r**2 - gear.r_b**2) for gear in pair.gears]
    width = min(gear.face_width for gear in spec.gears)
    local = [2 * (1 - g.material.poisson_ratio**2) / (np.pi * g.material.youngs_modulus) for g in spec.gears]
    half_width = np.sqrt(2 * sum(local) * force / width / sum(1 / roll for roll in rolls))
    terms = [
        c * (np.log(4 * g.body.strip_half_width / half_width) - 1.5) for c, g in zip(local, spec.gears, strict=True)
    ]
    return sum(terms) / width


def own_path(spec: StageSpec, bodies: Sequence[ReducedBody], force: float) -> float:
    """Path of a contact's dashpot through both teeth and the local law, for one tooth pair that carries `force` (N),
    m/N."""
    return sum(residual_path(body, spec.contact.slices) for body in bodies) + local_path(spec, force)


def same_loss(spec: StageSpec, bodies: Sequence[ReducedBody], others: Sequence[ReducedBody]) -> float:
    """Contact damping (N·s/m²) with which `others`, reductions of the same gears, lose what `bodies` lose with that of
    `spec`: the more modes are stored, the shorter is the path, and the loss goes with c times its square. Taken at half
    of the largest load."""
    force = 0.5 * spec.torque_max / PairGeometry.of(spec).gears[0].r_b
    ratio = own_path(spec, bodies, force) / own_path(spec, others, force)
    return float(spec.contact.damping * ratio**2)
