"""What the modes of a gear feel when it spins (`fem/spinning.py`): Coriolis coupling, centrifugal load, stiffening; all
per power of the speed, so that they are numbers of the body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.fem.spinning import leave_axial, turn_quarter
from gearfmu.reduction.cyclic.sector import SectorBody


@dataclass(frozen=True)
class Spin:
    """Terms of the turning axes, n real modes.

    coupling (n, n), skew: ∫ρ φ_k · (e_z × φ_l), so that Ω turns the pair of a mode by 2Ω coupling; tilt (2, n),
    kg^½·m: ∫ρ z (φ_x, φ_y), the same coupling with rigid tilt about x and y; load (n,), kg^½·m: centrifugal load per
    Ω²; stiffening (n,): B of ω² = ω₀² + B Ω², stresses less softening; growth (2, R, A), m·s²: outward normal
    displacement of tooth 0 under centrifugal load per Ω²; inertia (), kg·m²·s²: what that adds to the polar moment of
    inertia per Ω².
    """

    coupling: np.ndarray
    tilt: np.ndarray
    load: np.ndarray
    stiffening: np.ndarray
    growth: np.ndarray
    inertia: float


@dataclass(frozen=True)
class FamilySpin:
    """The same of the k sector modes of one family, complex where they are pairs (weight 2): coupling (k, k), tilt (k,)
    of the x component (that of y is i times it), load, stiffening (k,)."""

    coupling: np.ndarray
    tilt: np.ndarray
    load: np.ndarray
    stiffening: np.ndarray


def family_spin(body: SectorBody, diameter: int, weight: int, shapes: np.ndarray) -> FamilySpin:
    """shapes (3N, k) of the sector, of unit mass over the whole body."""
    scale, nodes = body.teeth / weight, body.mesh.nodes
    mass = body.mass_matrix @ shapes
    own = mass.conj().T
    high = np.zeros_like(nodes)
    high[:, 0] = nodes[:, 2]
    along_x = high.ravel() @ mass
    along_y = turn_quarter(high.ravel()) @ mass
    stress = (body.stress_stiffness @ shapes.reshape(len(nodes), -1)).reshape(shapes.shape)
    square = (shapes.conj() * (stress - body.mass_matrix @ leave_axial(shapes))).sum(axis=0).real
    radial = leave_axial(nodes.ravel()) @ mass
    return FamilySpin(
        coupling=scale * (own @ turn_quarter(shapes)),
        tilt=scale * (along_x - 1j * along_y) * (diameter == 1),
        load=scale * radial.real * (diameter == 0),
        stiffening=scale * square,
    )


def join_spin(body: SectorBody, entries: Sequence[tuple[FamilySpin, int, int]]) -> Spin:
    """entries: of every real mode its family, its number there, and its part (0 single, 1 and 2 of a pair)."""
    n = len(entries)
    coupling, tilt, load, stiffening = np.zeros((n, n)), np.zeros((2, n)), np.zeros(n), np.zeros(n)
    for i, (family, k, part) in enumerate(entries):
        rotated = family.tilt[k] * (-1j if part == 2 else 1)
        tilt[:, i] = rotated.real, (1j * rotated).real
        load[i], stiffening[i] = family.load[k], family.stiffening[k]
        for j, (other, m, there) in enumerate(entries):
            if other is family:
                turned = family.coupling[k, m] * (1j if part == 2 else 1) * (-1j if there == 2 else 1)
                coupling[i, j] = turned.real
    rows = body.load_matrix[: body.flank_count] @ body.growth
    shape = (2, len(body.points.rolls), body.points.functions)
    radial = leave_axial(body.mesh.nodes.ravel()) @ (body.mass_matrix @ body.growth)
    return Spin(
        0.5 * (coupling - coupling.T), tilt, load, stiffening, rows.reshape(shape), float(2 * body.teeth * radial)
    )
