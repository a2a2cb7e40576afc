"""Helical gears: one sector against the whole gear, hands, the limit of no helix, resultants of the loads."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
import small_gear
from blocks import COUNT, modes_of
from sections import section
from small_gear import GEAR, WIDTH
from small_helical import BETA, COARSE, body, coarse, flank, gear, turned, whole
from turned_rows import on_tooth

from gearfmu.fem.coupling import rigid_modes
from gearfmu.femesh.quality import scaled_jacobian
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import PairGeometry
from gearfmu.reduction.cyclic.flank import Points, flank_loads
from gearfmu.reduction.cyclic.modal import Modes, elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import Statics, static_tables
from gearfmu.stagefile.tables.bodies import MeshSpec

FLANK_ROWS = 2 * 4 * 3


@pytest.fixture(scope="module")
def modes() -> Modes:
    return elastic_modes(coarse(), COUNT)


@pytest.fixture(scope="module")
def statics() -> Statics:
    return static_tables(coarse(), [0, 5])


def block(table: np.ndarray) -> np.ndarray:
    """Own-tooth table (2, 2, R, R, A, A) as a matrix."""
    return table.transpose(0, 2, 4, 1, 3, 5).reshape(FLANK_ROWS, FLANK_ROWS)


def test_frequencies_of_one_sector_are_those_of_the_whole_gear(modes: Modes) -> None:
    squared, _ = modes_of(whole().free)
    assert np.allclose(modes.frequency, (np.sqrt(squared) / (2 * np.pi))[: len(modes.frequency)], rtol=1e-8)
    assert np.all(modes.parity == 0)


def test_rows_along_normal_and_profile_and_of_the_bore_are_those_of_the_whole_gear(modes: Modes) -> None:
    """Sums of N Nᵀ over each frequency cluster do not depend on how pairs are turned."""
    _, shapes = modes_of(whole().free)
    flanks = np.vstack([modes.flank_rows, modes.tangent_rows])
    reduced_0 = np.vstack([flanks, modes.bore_rows])
    full_0 = np.vstack([whole().rows[0], whole().bore_rows]) @ shapes
    omega = 2 * np.pi * modes.frequency
    ends = np.flatnonzero(np.diff(omega) / omega[:-1] > 1e-6) + 1
    for tooth in (0, 1, 5, 11):
        reduced = np.vstack([on_tooth(modes, flanks, tooth, GEAR.z), modes.bore_rows])
        full = np.vstack([whole().rows[tooth], whole().bore_rows]) @ shapes
        for cluster in np.split(np.arange(len(omega)), ends)[:-1]:
            mine, theirs = reduced_0[:, cluster] @ reduced[:, cluster].T, full_0[:, cluster] @ full[:, cluster].T
            assert np.abs(mine - theirs).max() < 1e-6 * np.abs(reduced_0).max() ** 2


def test_static_tables_are_those_of_the_whole_gear(statics: Statics) -> None:
    """All tooth offsets along the normal, the own tooth along the profile, bore with all six loads."""
    loads, own = np.vstack([*whole().rows, whole().bore_rows]), [whole().rows[0], whole().bore_rows]
    full = whole().free.flexibility(np.vstack(own).T).T @ loads.T
    scale, every = np.abs(statics.static_ff).max(), 2 * FLANK_ROWS
    for tooth in range(GEAR.z):
        mine = statics.static_ff[:, :, tooth].transpose(0, 2, 4, 1, 3, 5).reshape(FLANK_ROWS, FLANK_ROWS)
        theirs = full[:FLANK_ROWS, tooth * every : tooth * every + FLANK_ROWS]
        assert np.abs(mine - theirs).max() < 1e-9 * scale
    assert np.abs(block(statics.static_nt) - full[:FLANK_ROWS, FLANK_ROWS:every]).max() < 1e-9 * scale
    assert np.abs(block(statics.static_tt) - full[FLANK_ROWS:every, FLANK_ROWS:every]).max() < 1e-9 * scale
    bore = statics.static_fb.reshape(FLANK_ROWS, 6)
    assert np.abs(bore - full[:FLANK_ROWS, -6:]).max() < 1e-9 * np.abs(bore).max()
    assert np.abs(bore).max(axis=0).min() > 0
    assert np.abs(statics.static_bb - full[-6:, -6:]).max() < 1e-9 * np.abs(statics.static_bb).max()


def test_even_and_odd_width_functions_see_each_other(statics: Statics) -> None:
    assert np.abs(statics.static_ff[0, 0, 0, :, :, 0, 1]).max() > 0.02 * np.abs(statics.static_ff[0, 0, 0]).max()


def test_half_a_turn_about_the_middle_line_changes_the_flanks(statics: Statics) -> None:
    """Half a turn about x brings a helical gear with symmetric teeth onto itself: flank 1, −z, −m for flank 0, z, m."""
    sign = (-1.0) ** np.arange(3)
    back = (-np.arange(GEAR.z)) % GEAR.z
    turned_over = statics.static_ff[::-1, ::-1, back] * sign[:, None] * sign
    assert np.abs(turned_over - statics.static_ff).max() < 1e-10 * np.abs(statics.static_ff).max()


def test_a_gear_of_the_other_hand_is_the_mirror_image() -> None:
    """Mirrored at z = 0: odd width functions change their sign, flanks, normals and profile directions go on."""
    right, left = static_tables(coarse(1), []), static_tables(coarse(-1), [])
    sign = (-1.0) ** np.arange(3)
    both = sign[:, None] * sign
    scale = np.abs(right.static_ff).max()
    for name in ("static_ff", "static_nt", "static_tt"):
        assert np.abs(getattr(left, name) - getattr(right, name) * both).max() < 1e-10 * scale
    loads = np.array([1, 1, -1, -1, -1, 1])  # force and moment in the mirror
    mirrored = right.static_fb * sign[:, None] * loads
    assert np.abs(left.static_fb - mirrored).max() < 1e-10 * np.abs(mirrored).max()
    here, there = elastic_modes(coarse(1), 40), elastic_modes(coarse(-1), 40)
    assert np.allclose(here.frequency, there.frequency, rtol=1e-9)
    rows = there.flank_rows.reshape(8, 3, -1) * sign[:, None]
    single = here.part == 0
    mine, theirs = here.flank_rows[:, single], rows.reshape(FLANK_ROWS, -1)[:, single]
    same = np.sign((mine * theirs).sum(axis=0))
    assert np.abs(mine - theirs * same).max() < 1e-6 * np.abs(mine).max()


def test_a_vanishing_helix_is_the_spur_gear() -> None:
    """β = 1e-6°, reduced without mirror symmetry: tables, rows and frequencies of the spur gear to 1e-6."""
    nearly, spur = body(math.radians(1e-6)), small_gear.coarse()
    assert len(nearly.spaces) == 1 and len(spur.spaces) == 2
    tables, expected = static_tables(nearly, []), static_tables(spur, [])
    for name in ("static_ff", "static_nt", "static_tt", "static_fb", "static_bb"):
        limit = 1e-6 * np.abs(getattr(expected, name)).max()
        assert np.abs(getattr(tables, name) - getattr(expected, name)).max() < limit
    assert abs(nearly.load_matrix - spur.load_matrix).max() < 1e-6 * abs(spur.load_matrix).max()
    modes, same = elastic_modes(nearly, 40), elastic_modes(spur, 40)
    assert np.allclose(modes.frequency, same.frequency, rtol=1e-6)
    kept = 2 * np.pi * modes.frequency[:36]
    sums = [(m.flank_rows[:, :36] / kept**2) @ m.flank_rows[:, :36].T for m in (modes, same)]
    assert np.abs(sums[0] - sums[1]).max() < 1e-5 * np.abs(sums[1]).max()


def closed_form(own: SimpleNamespace, side: int, roll: np.ndarray, functions: int) -> np.ndarray:
    """Resultant (R, A, 6) of the unit loads by dense quadrature over strip and width of the closed forms of n and r."""
    first, last = own.flank.strip(roll)
    u, w = np.polynomial.legendre.leggauss(24)
    sg, result = 1 - 2 * side, np.zeros((len(roll), functions, 6))
    for k, (low, high) in enumerate(zip(first, last, strict=True)):
        s = np.sqrt(2 * own.flank.r_b * (0.5 * (low + high) + 0.5 * (high - low) * u))[:, None]
        z = 0.5 * WIDTH * u[None, :]
        d = sg * (own.flank.psi_b - s / own.flank.r_b) + own.shape.twist * z
        n = np.stack(np.broadcast_arrays(-sg * np.sin(d), sg * np.cos(d), 0 * d), axis=-1) * np.cos(own.shape.beta_b)
        n[..., 2] = -sg * np.sin(own.shape.beta_b)
        e_r, e_t = (np.stack([a, b, 0 * d], axis=-1) for a, b in ((np.cos(d), np.sin(d)), (-np.sin(d), np.cos(d))))
        r = own.flank.r_b * e_r + sg * s[..., None] * e_t + z[..., None] * np.array([0, 0, 1])
        for a in range(functions):
            weight = 0.25 * w[:, None] * w * np.polynomial.legendre.legval(u, np.eye(functions)[a])
            both = np.concatenate([n, np.cross(r, n)], axis=-1)
            result[k, a] = (weight[..., None] * both).sum(axis=(0, 1))
    return result


@pytest.mark.parametrize("beta", [BETA, -BETA, math.radians(35)])
def test_resultants_are_the_closed_forms(beta: float) -> None:
    """Forces to 1e-10: sum 1 N along n, axial part −sg sin β_b exactly; moments to the mesh's interpolation of r. In
    the
    closed form F_t tan β = F_a with F_t = M_z / r."""
    shape = gear(beta)
    own = SimpleNamespace(shape=shape, flank=flank(shape))
    mesh = gear_sector(shape, WIDTH, MeshSpec(flank=16, thickness=2, root=4, rim=2, width=8))
    points = Points(own.flank.chebyshev_rolls(5), 4)
    for side, sg in ((0, 1), (1, -1)):
        loads = flank_loads(mesh.nodes, mesh.flank[side].quads, own.flank, side, points)
        resultant, expected = loads @ rigid_modes(mesh.nodes), closed_form(own, side, points.rolls, 4)
        assert np.abs(resultant[..., :3] - expected[..., :3]).max() < 1e-10
        assert np.abs(resultant[:, 0, 2] + sg * math.sin(shape.beta_b)).max() < 1e-13
        assert np.abs(resultant[..., 3:] - expected[..., 3:]).max() < 1e-6 * shape.r_b
        assert expected[:, 0, 5] == pytest.approx(sg * shape.r_b * math.cos(shape.beta_b), rel=1e-12)
        assert expected[:, 0, 5] / shape.r * math.tan(beta) == pytest.approx(-expected[:, 0, 2], rel=1e-12)


def test_the_profile_direction_lies_in_the_flank_and_in_the_transverse_plane() -> None:
    own, shape = flank(gear(BETA)), gear(BETA)
    roll, z, step = np.linspace(shape.s_form, shape.s_tip, 7)[:, None], np.linspace(-1, 1, 5) * WIDTH / 2, 1e-7
    for side, sg in ((0, 1), (1, -1)):
        n, p = own.normal(roll, side, z), own.tangent(roll, side, z)
        assert np.abs((n * p).sum(axis=-1)).max() < 1e-14 and np.abs(p[..., 2]).max() == 0
        assert np.abs(np.linalg.norm(n, axis=-1) - 1).max() < 1e-14

        def point(s: np.ndarray, at: np.ndarray, sg: int = sg) -> np.ndarray:
            flat, angle = shape.flank_point(np.broadcast_to(s, (7, 5)), sg), shape.twist * at
            x, y = flat[..., 0], flat[..., 1]
            return np.stack(
                [
                    np.cos(angle) * x - np.sin(angle) * y,
                    np.sin(angle) * x + np.cos(angle) * y,
                    np.broadcast_to(at, (7, 5)),
                ],
                axis=-1,
            )

        along = (point(roll + step, z) - point(roll - step, z)) / (2 * step)
        across = (point(roll, z + step) - point(roll, z - step)) / (2 * step)
        assert np.abs((n * along).sum(axis=-1)).max() < 1e-8 and np.abs((n * across).sum(axis=-1)).max() < 1e-8
        assert np.allclose(along / np.linalg.norm(along, axis=-1, keepdims=True), p, atol=1e-6)


def test_flanks_of_opposite_hand_touch_along_a_line_with_opposite_normals() -> None:
    """Pinion at 0, wheel at its phase: in every section the points at the local rolls s ± z tan β_b coincide, the
    normals
    are opposite, and the profile directions too."""
    pair = PairGeometry((gear(BETA), gear(-BETA)), gear(BETA).r * 2 + 1.2e-3, 0.0)
    first, second = pair.gears
    t = -pair.alpha_wt
    for z in np.linspace(-WIDTH / 2, WIDTH / 2, 5):
        rolls = []
        points, normals, profiles = [], [], []
        for shape, phase, towards in ((first, 0.0, t), (second, pair.wheel_phase, t + math.pi)):
            roll = shape.r_b * (phase + shape.psi_b - towards) + z * math.tan(shape.beta_b)
            own, turn = flank(shape), _turn(phase)
            flat = np.append(shape.flank_point(roll), z)
            points.append(turn @ _turn(shape.twist * z) @ flat)
            normals.append(turn @ own.normal(np.array(roll), 0, z))
            profiles.append(turn @ own.tangent(np.array(roll), 0, z))
            rolls.append(roll)
        assert sum(rolls) == pytest.approx(pair.length, rel=1e-12)
        assert points[0] == pytest.approx(points[1] + [pair.a, 0, 0], abs=1e-15)
        assert normals[0] == pytest.approx(-normals[1], abs=1e-14)
        assert profiles[0] == pytest.approx(-profiles[1], abs=1e-14)


def _turn(angle: float) -> np.ndarray:
    return np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])


@pytest.mark.parametrize("degrees", [-35, -20, 8, 35])
def test_twisted_sectors_are_sound(degrees: float) -> None:
    """Positive Jacobians, cuts one pitch apart, flank nodes on the involute of their section, no mirror parity."""
    shape = gear(math.radians(degrees))
    mesh = gear_sector(shape, 4 * WIDTH, COARSE)
    assert scaled_jacobian(mesh).min() > 0.25
    assert np.abs(mesh.nodes[mesh.cut_minus] @ turned(1).T - mesh.nodes[mesh.cut_plus]).max() < 1e-15
    for side, sg in ((0, 1), (1, -1)):
        grid = mesh.flank[side]
        points, angle = mesh.nodes[grid.quads], -shape.twist * grid.z
        x, y = points[..., 0], points[..., 1]
        back = np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y], axis=-1)
        assert np.abs(back - shape.flank_point(grid.roll, sg)).max() < 1e-15
        corners = points[:, :4]
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        outward = flank(shape).normal(grid.roll.mean(axis=1), side, grid.z.mean(axis=1))
        assert (normal * outward).sum(axis=1) == pytest.approx(np.linalg.norm(normal, axis=1), rel=0.05)


def test_mass_is_that_of_the_section_times_the_width() -> None:
    made: SectorBody = coarse()
    assert made.inertia[0, 0] == pytest.approx(7850 * GEAR.z * section(gear(BETA))[0] * WIDTH, rel=2e-3)
    assert np.abs(made.inertia[2, [0, 1, 3, 4, 5]]).max() < 1e-12 * made.inertia[0, 0]
