"""Beam shafts against beam theory: deflection, frequencies, and the sum of modes and residual."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from blocks import free_bending

from gearfmu.body.beam import Section, Shaft, Steel, reduce_shaft, rigid_mass

STEEL = Steel(206e9, 0.3, 7850.0)
STEPPED = Shaft([Section(0.06, 0.03), Section(0.10, 0.045, 0.012), Section(0.05, 0.035)], STEEL, [0.0, 0.11, 0.21])


def rotate_and_shift(body, node):
    rows = np.eye(6)
    z = body.points[node, 2]
    rows[0, 4], rows[1, 3] = z, -z
    return rows


def statics(body, held, force):
    """Motion (6K,) of the interfaces under `force` (6K,), the directions `held` at rest: modes, residual and rigid
    motion."""
    n = len(body.nodes)
    rows = body.rows
    c = rows / body.exact.omega**2 @ rows.T + body.exact.residual
    rigid = np.vstack([rotate_and_shift(body, k) for k in range(n)])
    size = 6 + len(held)
    system = np.zeros((size, size))
    system[:6, 6:], system[6:, :6], system[6:, 6:] = rigid[held].T, rigid[held], c[np.ix_(held, held)]
    found = np.linalg.solve(system, -np.concatenate([rigid.T @ force, c[held] @ force]))
    return rigid @ found[:6] + c @ force + c[:, held] @ found[6:]


def simply_supported(shaft, load_at, bending):
    """Deflection under a unit load between supports at both ends of the shaft, by the unit-load integral of bending and
    shear."""
    length, r = shaft.steps[-1], (shaft.steps[-1] - load_at) / shaft.steps[-1]
    total, start = 0.0, 0.0
    for section in shaft.sections:
        cuts = sorted({start, start + section.length, min(max(load_at, start), start + section.length)})
        for a, b in pairwise(cuts):
            x = a + (b - a) * (0.5 + 0.5 * np.polynomial.legendre.leggauss(4)[0])
            weight = 0.5 * (b - a) * np.polynomial.legendre.leggauss(4)[1]
            moment = np.where(x < load_at, r * x, (1 - r) * (length - x))
            force = np.where(x < load_at, r, r - 1)
            stiff = STEEL.shear_modulus * section.area * section.shear_factor(0.3)
            total += weight @ (moment**2 / (STEEL.youngs_modulus * section.second_moment) + force**2 / stiff)
        start += section.length
    return total


def test_sections_are_those_of_textbooks() -> None:
    """Moments by integration; the shear factor of a full shaft and of a thin tube (Cowper, J. Appl. Mech. 33 (1966)
    335)."""
    tube, nu = Section(0.1, 50e-3, 30e-3), 0.3
    r, dr = np.linspace(15e-3, 25e-3, 2001, retstep=True)
    middle = 0.5 * (r[1:] + r[:-1])
    assert tube.area == pytest.approx((2 * math.pi * middle * dr).sum())
    assert tube.second_moment == pytest.approx((math.pi * middle**3 * dr).sum(), rel=1e-6)
    assert Section(0.1, 50e-3).shear_factor(nu) == pytest.approx(6 * (1 + nu) / (7 + 6 * nu))
    assert Section(0.1, 50e-3, 49.999e-3).shear_factor(nu) == pytest.approx(2 * (1 + nu) / (4 + 3 * nu), rel=1e-6)


@pytest.mark.parametrize("cut", [5e3, 60e3, 1e9])
@pytest.mark.parametrize("direction", [0, 1])
def test_stepped_shaft_bends_as_beam_theory_says(cut, direction):
    body = reduce_shaft(STEPPED, cut)
    held = [0, 1, 2, 5, 12, 13]  # x, y, z, rz of the first end; x, y of the other
    force = np.zeros(18)
    force[6 + direction] = 1.0
    have = statics(body, held, force)[6 + direction]
    want = simply_supported(STEPPED, 0.11, direction)
    print(f"stepped shaft, cut {cut:g} Hz, {body.exact.omega.size} modes: deflection {have / want - 1:.1e}")
    assert have == pytest.approx(want, rel=1e-6)


@pytest.mark.parametrize("direction, stiffness", [(2, "youngs_modulus"), (5, "shear_modulus")])
def test_stepped_shaft_stretches_and_twists_as_rods_do(direction, stiffness):
    body = reduce_shaft(STEPPED, 20e3)
    force = np.zeros(18)
    force[12 + direction] = 1.0
    have = statics(body, [0, 1, 2, 3, 4, 5], force)[12 + direction]
    area = [2 * s.second_moment if direction == 5 else s.area for s in STEPPED.sections]
    want = sum(s.length / (getattr(STEEL, stiffness) * a) for s, a in zip(STEPPED.sections, area, strict=True))
    assert have == pytest.approx(want, rel=1e-8)


def exact_bending(section, length, near):
    """Free-free frequency (rad/s) of the uniform Timoshenko beam next to `near`."""
    shear = STEEL.shear_modulus * section.area * section.shear_factor(STEEL.poisson_ratio)
    mass, inertia = STEEL.density * section.area, STEEL.density * section.second_moment
    bending = STEEL.youngs_modulus * section.second_moment
    return free_bending(length, bending, shear, mass, inertia, (0.995 * near, 1.005 * near))


def test_uniform_shaft_has_the_frequencies_of_the_exact_beam():
    section, length = Section(0.3, 0.04, 0.01), 0.3
    body = reduce_shaft(Shaft([section], STEEL, [0.0]), 60e3)
    bending = body.exact.omega[np.abs(body.rows[0]) > 1e-6]
    errors = [omega / exact_bending(section, length, omega) - 1 for omega in bending[:8]]
    print(
        "bending frequencies",
        [f"{omega / 2 / math.pi:.0f} Hz {e:.1e}" for omega, e in zip(bending, errors, strict=False)],
    )
    assert np.abs(errors).max() < 1e-4
    for direction, speed in ((5, STEEL.shear_modulus), (2, STEEL.youngs_modulus)):
        own = body.exact.omega[np.abs(body.rows[direction]) > 1e-6][:4]
        exact = np.pi * np.arange(1, 1 + own.size) * np.sqrt(speed / STEEL.density) / length
        print(f"rod in direction {direction}:", np.abs(own / exact - 1).max())
        assert np.abs(own / exact - 1).max() < 1e-5


def test_frequencies_converge_with_the_eighth_power_of_the_element():
    section, length = Section(0.3, 0.04), 0.3
    errors = []
    for count in (5, 10):
        body = reduce_shaft(Shaft([section], STEEL, [0.0]), 30e3, length / count)
        third = body.exact.omega[np.abs(body.rows[0]) > 1e-6][2]
        errors.append(third / exact_bending(section, length, third) - 1)
    rate = math.log2(errors[0] / errors[1])
    print("rate", rate)
    assert 7.3 < rate < 8.7


def test_rigid_mass_is_that_of_the_mass_matrix():
    centre, mass = rigid_mass(STEPPED)
    body = reduce_shaft(STEPPED, 1e4)
    assert body.points[:, 2] == pytest.approx(np.array(STEPPED.places) - centre)
    assert mass[0, 0] == pytest.approx(sum(7850 * s.area * s.length for s in STEPPED.sections))
    # elastic modes leave centre of mass and mean axis at rest, so a free shaft answers a force by its mass alone
    assert np.array_equal(np.diag(np.diag(mass)), mass)
