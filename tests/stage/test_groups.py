"""Ground groups against the same bodies put together another way: the pair, and an elastic gear on an elastic shaft.
Gyroscopic forces of shafts, discs and carried bodies, as the ground group has them, against exact solutions."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as sl
from dense import OnGear, answer, group_answer, relative
from handmade import on_axis

from gearfmu.body.beam import Section, Shaft, Steel, reduce_shaft
from gearfmu.stage.assembly.ground_part import GroundPart, Reading, ground_part, skew_pairs, whirl_rows
from gearfmu.stage.assembly.groups import Group, Layout, Support, mount
from gearfmu.stage.assembly.layout import stage_layout
from gearfmu.stage.assembly.teeth import ROLLS, resampling

# tooth, flank, roll, function
LOADS = [(0, 0, 5, 0), (0, 0, 30, 1), (1, 0, 40, 0), (-1, 0, 11, 2), (2, 1, 20, 0), (0, 1, 5, 0)]
IN_SPACE = [(0, 0, 3, 0), (0, 0, 8, 1), (1, 0, 9, 0), (-1, 1, 2, 2), (2, 1, 5, 1)]
ANISOTROPIC = np.array([[4.0e-9, 1.5e-9], [1.5e-9, 2.5e-9]])

STEEL = Steel(206e9, 0.3, 7850.0)
SHAFTS = [
    Shaft([Section(0.05, 0.03), Section(0.12, 0.04, 0.01), Section(0.03, 0.03)], STEEL, [0.01, 0.08, 0.19]),
    Shaft([Section(0.09, 0.035), Section(0.11, 0.045)], STEEL, [0.01, 0.05, 0.14, 0.19]),
]
DISCS = [(0, 1, 0.9, 4e-4, 7e-4), (1, 1, 1.6, 1.0e-3, 1.9e-3), (1, 2, 0.5, 2e-4, 3.5e-4)]  # shaft, node, mass, I, J
BEARINGS = [(0, 0), (0, 2), (1, 0), (1, 3)]
BEARING = np.array([3e8, 2e8, 1e8, 4e4, 6e4])
ALL = (0, 1, 2, 3, 4, 5)


@pytest.fixture(scope="module")
def layout(spec, bodies):
    return stage_layout(spec, bodies)


def with_compliance(layout, compliance):
    return replace(layout, supports=[replace(s, compliance=compliance) for s in layout.supports])


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize(
    "compliance", [np.eye(2) / 3e8, ANISOTROPIC, np.zeros((2, 2))], ids=["isotropic", "anisotropic", "held"]
)
def test_statics_are_those_of_free_body_and_springs(layout, bodies, pair, index, compliance):
    springs = with_compliance(layout, compliance)
    group, own = mount(springs), slice(2 * index, 2 * index + 2)
    for angle in (0.0, 0.77, 3.9):
        gear = OnGear(index, bodies[index], pair.gears[index], LOADS, angle, np.arange(0, 5, 2), ROLLS)
        want, want_force = answer(springs, gear.free(springs))
        have, have_force = group_answer(group, gear.read(group))
        assert relative(have, want) < 1e-8
        assert np.abs(have_force[own] - want_force[own]).max() < 1e-8 * np.abs(want_force).max()
        assert np.abs(np.delete(have_force, own, axis=0)).max() < 1e-12


# ---- in space: shafts, seats, bearings with tilt ---------------------------------------------------------------------
def disc(name, mass, across, polar):
    """A rigid body: no modes, no residual."""
    inertia = np.diag([mass, mass, mass, across, across, polar])
    return GroundPart(name, inertia, np.zeros(0), np.zeros(0), on_axis(0.0), np.zeros((1, 6, 0)), np.zeros((6, 6)))


def seat(name, first, second):
    return Support(name, first, second, ALL, np.zeros((6, 6)), np.zeros(6))


def bearing(name, first, stiffness=BEARING):
    return Support(name, first, None, (0, 1, 2, 3, 4), np.diag(1 / stiffness), np.full(5, 1.0))


def train(cut):
    bodies = [ground_part(reduce_shaft(shaft, cut, None, f"shaft{i}", 0.01)) for i, shaft in enumerate(SHAFTS)]
    bodies += [disc(f"disc{i}", *numbers) for i, (_, _, *numbers) in enumerate(DISCS)]
    supports = [seat(f"seat{i}", (2 + i, 0), (s, node)) for i, (s, node, *_) in enumerate(DISCS)]
    supports += [bearing(f"bearing{i}", end) for i, end in enumerate(BEARINGS)]
    return Layout(bodies, [(0, 2), (1, 3, 4)], supports, planar=False)


@pytest.mark.parametrize(("held", "angle"), [(False, 0.0), (False, 1.1), (True, 4.0)])
def test_an_elastic_gear_on_an_elastic_shaft_yields_as_the_parts_do(bodies, pair, held, angle):
    """Statics in space: gear of finite elements, rigid seat, stepped shaft, two bearings with tilt, disc on the same
    shaft."""
    body, shape, rolls = bodies[0], pair.gears[0], 12
    grid, degrees = resampling(body.flank.roll, shape.s_form, shape.s_tip, rolls), np.arange(5)
    gear = ground_part(body, Reading(np.arange(body.modes), degrees, grid))
    shaft = ground_part(reduce_shaft(SHAFTS[1], 60e3, damping_ratio=0.01))
    supports = [seat("seat.gear", (1, 0), (0, 1)), seat("seat.disc", (2, 0), (0, 2))]
    supports += [bearing("b1", (0, 0)), bearing("b2", (0, 3))]
    layout = Layout([shaft, gear, disc("disc", *DISCS[2][2:])], [(0, 1, 2)], supports, planar=False)
    if held:
        layout = Layout(layout.bodies, layout.rotors, [s.hold() for s in supports], planar=False)
    group, on_gear = mount(layout), OnGear(1, body, shape, IN_SPACE, angle, degrees, rolls)
    want, want_force = answer(layout, on_gear.free(layout))
    have, force = group_answer(group, on_gear.read(group))
    assert relative(have, want) < 1e-8
    assert np.abs(force - want_force).max() < 1e-8 * np.abs(want_force).max()


def test_supports_that_leave_a_motion_free_leave_it_at_zero_frequency():
    """Bearings without axial stiffness: one free mass a rotor, exactly at rest."""
    layout = train(60e3)
    radial = [
        s if s.second is not None else Support(s.name, s.first, None, (0, 1), np.eye(2) / 3e8, np.zeros(2))
        for s in layout.supports
    ]
    group = mount(Layout(layout.bodies, layout.rotors, radial, planar=False))
    floating = group.omega == 0
    assert floating.sum() == 2 and group.omega[2] > 2 * np.pi * 20
    assert all(a <= b for a, b in pairwise(group.omega))
    moved = group.rigid(0)[2, floating]
    mass = sum(layout.bodies[b].mass[2, 2] for b in layout.rotors[0])
    assert np.abs(moved).max() == pytest.approx(1 / np.sqrt(mass), rel=1e-6)


# ---- gyroscopic forces against exact solutions -----------------------------------------------------------------------
LENGTH, SECTION = 0.3, Section(0.3, 0.04, 0.01)


def coupling(group: Group, speeds: dict[int, float]) -> np.ndarray:
    """(n, n), rad/s: Σ Ω (y xᵀ − x yᵀ) of the rotors that turn."""
    total = np.zeros(2 * group.omega.shape)
    for rotor, (x, y) in zip(*whirl_rows(group), strict=True):
        total += speeds.get(int(rotor), 0.0) * (np.outer(y, x) - np.outer(x, y))
    return total


def whirling(group: Group, speeds: dict[int, float]) -> np.ndarray:
    """(n,) rad/s, ascending: v̇ = −2 A v − ω² q."""
    n, omega = group.omega.size, np.diag(group.omega)
    matrix = np.block([[np.zeros((n, n)), omega], [-omega, -2 * coupling(group, speeds)]])
    return np.sort(np.abs(sl.eigvals(matrix).imag))[::2]


def test_a_hinged_shaft_whirls_as_a_spinning_timoshenko_beam() -> None:
    """w = W sin kz, θ = Θ cos kz, in complex notation ρA Ẅ = −κGA k (kW − Θ), ρI Θ̈ − 2iΩρI Θ̇ = −EI k² Θ + κGA (kW − Θ):
    forward and backward whirl of the first three bending modes."""
    hinge = [Support(f"end{i}", (0, i), None, (0, 1), np.zeros((2, 2)), np.zeros(2)) for i in (0, 1)]
    held = Support("along", (0, 0), None, (2,), np.full((1, 1), 1e-9), np.zeros(1))
    shaft = ground_part(reduce_shaft(Shaft([SECTION], STEEL, [0.0, LENGTH]), 200e3))
    group = mount(Layout([shaft], [(0,)], [*hinge, held], planar=False))
    speed = 3000.0
    found = whirling(group, {0: speed})
    for n in (1, 2, 3):
        exact = hinged_whirl(n * math.pi / LENGTH, speed)
        nearest = np.array([found[np.abs(found - w).argmin()] for w in exact])
        assert nearest == pytest.approx(exact, rel=2e-5)
        assert np.diff(exact) > 0.005 * exact.mean()


def hinged_whirl(k: float, speed: float) -> np.ndarray:
    """(2,) rad/s: the lowest backward and forward whirl of wave number k."""
    rho, area, second = STEEL.density, SECTION.area, SECTION.second_moment
    shear, bend = SECTION.shear_factor(STEEL.poisson_ratio) * STEEL.shear_modulus * area, STEEL.youngs_modulus * second
    mass = rho * np.diag([area, second])
    stiffness = np.array([[shear * k**2, -shear * k], [-shear * k, bend * k**2 + shear]])
    turning = np.diag([0.0, -2j * rho * second * speed])
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)],
                       [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, turning)]])  # fmt: skip
    sigma = sl.eigvals(matrix).imag
    return np.sort([np.abs(sigma[sigma < 0]).min(), sigma[sigma > 0].min()])


def test_a_disc_in_tilting_bearings_whirls_by_its_gyroscopic_moment() -> None:
    """J_t σ² − J_p Ω σ − k = 0 (forward: σ > 0)."""
    across, polar, stiffness, speed = 4e-4, 7e-4, 6e4, 4000.0
    group = mount(Layout([disc("disc", 0.9, across, polar)], [(0,)], [bearing("bearing", (0, 0), TILTS)], planar=False))
    exact = np.abs(np.roots([across, -polar * speed, -stiffness]))
    found = whirling(group, {0: speed})
    assert all(np.abs(found / w - 1).min() < 1e-12 for w in exact)


TILTS = np.array([3e8, 3e8, 1e8, 6e4, 6e4])


def test_what_a_carrier_carries_tilts_by_both_speeds() -> None:
    """In axes that turn at Ω_f a disc of speed Ω has 2 (Ω_f J_t − ½ Ω J_p) between its tilts, the carrier Ω = Ω_f."""
    bodies = [disc("planet", 0.5, 2e-4, 3.5e-4), disc("carrier", 2.0, 3e-3, 5e-3)]
    pin = Support("pin", (0, 0), (1, 0), (0, 1, 2, 3, 4), np.diag(1 / TILTS), np.zeros(5))
    layout = Layout(bodies, [(0,), (1,)], [pin, bearing("bearing", (1, 0), TILTS)], False, carried={0: (1, 0.05, 0.0)})
    group, speeds = mount(layout), {0: -170.0, 1: 85.0}
    expected = np.zeros(2 * group.omega.shape)
    for body, spin in ((0, -170.0), (1, 85.0)):
        mass, (x, y) = bodies[body].mass, group.rigid(body)[3:5]
        expected += (85.0 * mass[3, 3] - 0.5 * spin * mass[5, 5]) * (np.outer(y, x) - np.outer(x, y))
    assert coupling(group, speeds) == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_rotors_of_a_train_have_their_own_speeds() -> None:
    """At rest the frequencies are those of the oscillators; turning, the sum of their squares grows by that of the
    forces. (These bearings are not alike in x and y: the speed enters by its square, 1e-3.)"""
    group = mount(train(60e3))
    assert whirling(group, {}) == pytest.approx(group.omega, rel=1e-9)
    matrix = coupling(group, {0: 500.0, 1: -300.0})
    found = whirling(group, {0: 500.0, 1: -300.0})
    assert np.abs(matrix + matrix.T).max() == 0.0
    assert (found**2).sum() == pytest.approx((group.omega**2).sum() + 2 * (matrix**2).sum(), rel=1e-9)
    assert np.abs(found / group.omega - 1).max() > 1e-4


def test_pairs_of_a_skew_matrix_add_up_to_it() -> None:
    matrix = np.random.default_rng(1).standard_normal((7, 7))
    matrix -= matrix.T
    total = sum(np.outer(y, x) - np.outer(x, y) for x, y in skew_pairs(matrix))
    assert total == pytest.approx(matrix, abs=1e-12)
    assert len(skew_pairs(matrix)) == 3 and len(skew_pairs(np.zeros((4, 4)))) == 0
