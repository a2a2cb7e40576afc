"""Stiffness of one tooth pair at the pitch point, by finite elements with the bores clamped and by the transmission
error, against ISO 6336.

c'th of ISO 6336-1 is that of teeth on half planes (Weber and Banaschek) with a dedendum of 1.2 m. Ours sit on discs
with a bore, so the torsion of a plane disc between bore and root circle is put in series, and the standard's own
factor for the basic rack is used. The bare c'th (15.78 N/(mm µm) for FZG type C) lies some 20 % higher than a pair
with these bores.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import GearGeometry, PairGeometry
from gearfmu.reduction.cyclic.flank import Points, ToothFlank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.stage import StageModel
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.bodies import GearSpec

LINE_LOAD = 300e3  # N/m


def theoretical_stiffness(spec: Stage) -> float:
    """c'th of ISO 6336-1 for solid spur gears, N/m²."""
    (z1, x1), (z2, x2) = ((gear.teeth, gear.profile_shift) for gear in spec.gears)
    flexibility = (
        0.04723
        + 0.15551 / z1
        + 0.25791 / z2
        - 0.00635 * x1
        - 0.11654 * x1 / z1
        - 0.00193 * x2
        - 0.24188 * x2 / z2
        + 0.00529 * x1**2
        + 0.00182 * x2**2
    )
    return 1e9 / flexibility


def rack_factor(spec: Stage) -> float:
    """C_B of ISO 6336-1 for a dedendum other than 1.2 m."""
    return 1 + 0.5 * (1.2 - np.mean([gear.rack.dedendum for gear in spec.gears]))


def disc_torsion(spec: Stage, pair: PairGeometry) -> float:
    """Twist of plane discs between bore and root circle as displacement along the line of action, m per N/m (exact,
    plane shear)."""
    total = 0.0
    for gear, shape in zip(spec.gears, pair.gears, strict=True):
        shear = gear.material.youngs_modulus / (2 * (1 + gear.material.poisson_ratio))
        total += shape.r_b**2 / (4 * math.pi * shear) * ((gear.bore_diameter / 2) ** -2 - shape.r_f**-2)
    return total


def expected(spec: Stage, pair: PairGeometry) -> float:
    return 1 / (1 / (theoretical_stiffness(spec) * rack_factor(spec)) + disc_torsion(spec, pair))


def local_compliance(spec: Stage, pair: PairGeometry) -> float:
    """Secant of docs/theory eq. (7) for both bodies at the line load, m/N."""
    gear, roll = spec.gears[0], pair.path["C"]
    modulus = gear.material.youngs_modulus / (1 - gear.material.poisson_ratio**2)
    radius = roll * (pair.length - roll) / pair.length
    half_width = math.sqrt(4 * LINE_LOAD * radius / (math.pi * modulus / 2))
    return 2 * 2 / (math.pi * modulus * gear.face_width) * (math.log(4 * gear.body.strip_half_width / half_width) - 1)


def clamped_compliance(gear: GearSpec, shape: GearGeometry, roll: float, scale: float) -> float:
    """Displacement of the load strip at `roll` per uniform load on it, all nodes of the bore held, m/N: cyclic
    symmetry, one nodal diameter at a time."""
    flank = ToothFlank(shape.r_b, shape.psi_b, shape.s_form, shape.s_tip, gear.face_width, gear.body.strip_half_width)
    mesh = gear_sector(shape, gear.face_width, gear.body.mesh.model_copy(update={"scale": scale}))
    body = SectorBody(mesh, gear.material, flank, Points(np.array([roll]), 1))
    space = body.spaces[0]
    held = np.zeros(mesh.nodes.shape)
    held[mesh.sets["bore"]] = 1
    stiffness = space.from_nodes @ body.stiffness @ space.to_nodes
    size = space.interior + space.cut
    keep = np.flatnonzero((abs(space.to_nodes).T @ held.ravel())[:size] == 0)
    total = 0.0
    for diameter in body.diameters():
        harmonic = space.harmonic(diameter)
        cut = sp.hstack([sp.csr_array((space.cut, space.interior)), harmonic.phase * sp.eye_array(space.cut)])
        expand = sp.csc_array(sp.vstack([sp.eye_array(size), cut]))[:, keep]
        load = body.tooth_forces(harmonic, np.array([0]))[keep, 0]
        system = sp.csc_matrix(expand.conj().T @ stiffness @ expand)
        solution = sla.splu(
            system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        ).solve(load)
        total += harmonic.weight / mesh.teeth * (load.conj() @ solution).real
    return total


def test_formula_is_the_standards(spec: Stage) -> None:
    assert theoretical_stiffness(spec) == pytest.approx(15.78e9, rel=1e-3) and rack_factor(spec) == 0.975


def test_secant_from_the_transmission_error(plain: StageModel, spec: Stage, pair: PairGeometry) -> None:
    """One pair carries 300 N/mm at the pitch point, axes of the averaged bores held."""
    width = spec.gears[0].face_width
    kernel = plain.kernel(**{"level": 0.0, "effect.bearings": 0.0, "effect.tip_contact": 0.0})
    kernel.prepare()
    turn = (
        pair.path["C"] / pair.gears[0].r_b - pair.gears[0].psi_b - pair.alpha_wt
    )  # of the pinion, to bring tooth 0 to the pitch point
    torque = LINE_LOAD * width * pair.gears[0].r_b
    state = kernel.transmission(-turn * pair.gears[0].r_b / pair.gears[1].r_b, torque)
    assert [tooth for tooth, forces in state.forces.items() if sum(forces) > 0] == [(0, 0)]
    secant = LINE_LOAD / state.te
    print(
        f"c' = {1e-9 * secant:.2f} N/(mm µm); "
        f"c'th {1e-9 * theoretical_stiffness(spec):.2f}, with rack and discs {1e-9 * expected(spec, pair):.2f}"
    )
    assert secant == pytest.approx(expected(spec, pair), rel=0.10)


@pytest.mark.full
def test_secant_from_finite_elements_with_clamped_bores(spec: Stage, pair: PairGeometry) -> None:
    rolls = (pair.path["C"], pair.length - pair.path["C"])
    bodies = [clamped_compliance(*parts, scale=0.6) for parts in zip(spec.gears, pair.gears, rolls, strict=True)]
    secant = 1 / (spec.gears[0].face_width * (sum(bodies) + local_compliance(spec, pair)))
    print(
        f"c' = {1e-9 * secant:.2f} N/(mm µm), bores clamped; c'th {1e-9 * theoretical_stiffness(spec):.2f}, "
        f"with rack and discs {1e-9 * expected(spec, pair):.2f}"
    )
    assert secant == pytest.approx(expected(spec, pair), rel=0.06)
