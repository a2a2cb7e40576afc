"""Loads and tables of gears and rings, spur and helical: resultants against closed forms, opposite hands, the limit of
no helix, and flanks that touch along a line."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import small_gear
import small_ring
from small_gear import BETA, FINER, GEAR, WIDTH, flank, gear

from gearfmu.fem.coupling import rigid_modes
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import GearGeometry, PairGeometry
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.geometry.mesh import RingMesh
from gearfmu.reduction.cyclic.flank import Points, ToothFlank, flank_loads
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.stagefile.tables.bodies import MeshSpec

Shape = GearGeometry | InternalGearGeometry
SHAPES: dict[str, Callable[[float], Shape]] = {"gear": gear, "ring": small_ring.geometry}
MAKERS: dict[str, Callable[..., SectorBody]] = {"gear": small_gear.body, "ring": small_ring.body}
FINE = MeshSpec(flank=16, thickness=2, root=4, rim=2, width=8)
KINDS = pytest.mark.parametrize("kind", MAKERS)


@KINDS
def test_a_body_of_the_other_hand_is_the_mirror_image(kind: str) -> None:
    """Mirrored at z = 0: odd width functions change their sign, flanks, normals and profile directions go on."""
    right, left = (static_tables(MAKERS[kind](sign * BETA), []) for sign in (1, -1))
    sign = (-1.0) ** np.arange(3)
    both, scale = sign[:, None] * sign, np.abs(right.static_ff).max()
    for name in ("static_ff", "static_nt", "static_tt"):
        assert np.abs(getattr(left, name) - getattr(right, name) * both).max() < 1e-10 * scale
    assert np.abs(right.static_ff[..., 0, 1]).max() > 1e-3 * scale, "even and odd functions see each other"
    loads = np.array([1, 1, -1, -1, -1, 1])  # force and moment in the mirror
    mirrored = right.static_fb * sign[:, None] * loads
    assert np.abs(left.static_fb - mirrored).max() < 1e-10 * np.abs(mirrored).max()


@KINDS
def test_a_vanishing_helix_is_the_spur_body(kind: str) -> None:
    """β = 1e-6°, reduced without mirror symmetry: tables, rows and frequencies of the spur body to 1e-6."""
    nearly, spur = MAKERS[kind](math.radians(1e-6)), MAKERS[kind](0.0)
    assert len(nearly.spaces) == 1 and len(spur.spaces) == 2
    tables, expected = static_tables(nearly, []), static_tables(spur, [])
    of_ring = ("static_fp", "static_pp") if spur.internal else ()
    for name in ("static_ff", "static_nt", "static_tt", "static_fb", "static_bb", *of_ring):
        limit = 1e-6 * np.abs(getattr(expected, name)).max()
        assert np.abs(getattr(tables, name) - getattr(expected, name)).max() < limit, name
    assert abs(nearly.load_matrix - spur.load_matrix).max() < 1e-6 * abs(spur.load_matrix).max()
    modes, same = elastic_modes(nearly, 40), elastic_modes(spur, 40)
    assert np.allclose(modes.frequency, same.frequency, rtol=1e-6)
    kept = 2 * np.pi * modes.frequency[:36]
    sums = [(m.flank_rows[:, :36] / kept**2) @ m.flank_rows[:, :36].T for m in (modes, same)]
    assert np.abs(sums[0] - sums[1]).max() < 1e-5 * np.abs(sums[1]).max()


def closed_form(body: SectorBody, shape: Shape, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Resultants (R, A, 6) of the unit loads along normal and profile by dense quadrature over strip and width of the
    closed forms of n, e_p and r. Out of a ring's material the normal points inwards; the profile outwards in both."""
    roll, functions = body.points.rolls, body.points.functions
    first, last = body.flank.strip(roll)
    u, w = np.polynomial.legendre.leggauss(60)
    sg, out = 1 - 2 * side, -1.0 if body.internal else 1.0
    results = np.zeros((2, len(roll), functions, 6))
    for k, (low, high) in enumerate(zip(first, last, strict=True)):
        s = np.sqrt(2 * shape.r_b * (0.5 * (low + high) + 0.5 * (high - low) * u))[:, None]
        z = 0.5 * WIDTH * u[None, :]
        d = sg * (shape.psi_b - s / shape.r_b) + shape.twist * z
        e_r, e_t = (np.stack([a, b, 0 * d], axis=-1) for a, b in ((np.cos(d), np.sin(d)), (-np.sin(d), np.cos(d))))
        n = sg * e_t * np.cos(shape.beta_b) - sg * np.sin(shape.beta_b) * np.array([0, 0, 1])
        r = shape.r_b * e_r + sg * s[..., None] * e_t + z[..., None] * np.array([0, 0, 1])
        for a in range(functions):
            weight = 0.25 * w[:, None] * w * np.polynomial.legendre.legval(u, np.eye(functions)[a])
            for result, unit in zip(results, (out * n, e_r), strict=True):
                both = np.concatenate([unit, np.cross(r, unit)], axis=-1)
                result[k, a] = (weight[..., None] * both).sum(axis=(0, 1))
    return results[0], results[1]


@pytest.mark.parametrize("beta", [0.0, BETA, -BETA, math.radians(35)])
@KINDS
def test_resultants_are_the_closed_forms(kind: str, beta: float) -> None:
    """Forces to 1e-10: 1 N along n, axial part sin β_b; moments to the mesh's interpolation of r, worst near the base
    circle (6e-7, along the profile 5e-6). In the closed form F_t tan β = F_a with F_t = M_z / r."""
    body, shape = MAKERS[kind](beta, FINE), SHAPES[kind](beta)
    loads = body.load_matrix[: body.flank_count], body.load_matrix[body.profile_loads :]
    normal, tangent = (rows.toarray().reshape(2, 4, 3, -1) for rows in loads)
    for side, sg in ((0, 1), (1, -1)):
        along_normal, along_profile = closed_form(body, shape, side)
        for loads, expected, most in ((normal, along_normal, 1e-6), (tangent, along_profile, 1e-5)):
            resultant = loads[side] @ rigid_modes(body.mesh.nodes)
            assert np.abs(resultant[..., :3] - expected[..., :3]).max() < 1e-10
            assert np.abs(resultant[..., 3:] - expected[..., 3:]).max() < most * shape.r_b
        turn = (-sg if body.internal else sg) * shape.r_b * math.cos(shape.beta_b)
        assert along_normal[:, 0, 5] == pytest.approx(turn, rel=1e-12)
        assert turn / shape.r * math.tan(beta) == pytest.approx(-along_normal[:, 0, 2], abs=1e-14)


def planet_in_ring() -> tuple[tuple[Shape, Shape], tuple[float, float], RingMesh]:
    """A planet of the ring's hand, and the ring: shapes, phases, and how they mesh."""
    ring = small_ring.geometry(BETA)
    planet = GearGeometry(
        z=10, m=ring.m, alpha=ring.alpha, x=0.0, beta=BETA, r_a=0.015, r_bore=0.004, tip_edge=1e-4,
        h_fp=1.25 * ring.m, rho_fp=0.3 * ring.m,
    )  # fmt: skip
    mesh = RingMesh((planet, ring), ring.r - planet.r + 1e-4, 0.0)
    return (planet, ring), (0.0, mesh.ring_phase(0.0, 0.0)), mesh


def external_pair() -> tuple[tuple[Shape, Shape], tuple[float, float], PairGeometry]:
    pair = PairGeometry((gear(BETA), gear(-BETA)), gear(BETA).r * 2 + 1.2e-3, 0.0)
    return pair.gears, (0.0, pair.wheel_phase), pair


@pytest.mark.parametrize("make", [external_pair, planet_in_ring])
def test_flanks_that_mesh_touch_along_a_line_with_opposite_normals(make: Callable) -> None:
    """In every section the points at the local rolls s ± z tan β_b coincide and the normals are opposite. Profile
    directions are opposite in a pair; in a ring both rolls grow outwards."""
    shapes, phases, mesh = make()
    internal = isinstance(mesh, RingMesh)
    for z in np.linspace(-WIDTH / 2, WIDTH / 2, 5):
        rolls, points, normals, profiles = [], [], [], []
        for k, (shape, phase) in enumerate(zip(shapes, phases, strict=True)):
            towards = 0.0 if internal or k == 0 else math.pi
            roll = shape.r_b * (phase + shape.psi_b + mesh.alpha_wt - towards) + z * math.tan(shape.beta_b)
            ring = internal and k == 1
            own = ToothFlank(shape.r_b, shape.psi_b, shape.s_form, shape.s_tip, WIDTH, 3e-4, ring, shape.beta_b)
            turned = turns(np.array(phase))
            points.append(turned @ turns(np.array(shape.twist * z)) @ np.append(shape.flank_point(roll), z))
            normals.append(turned @ own.normal(np.array(roll), 0, z))
            profiles.append(turned @ own.tangent(np.array(roll), 0, z))
            rolls.append(roll)
        assert (rolls[1] - rolls[0] if internal else sum(rolls)) == pytest.approx(mesh.length, rel=1e-12)
        centre = [-mesh.a, 0, 0] if internal else [mesh.a, 0, 0]
        assert points[0] == pytest.approx(points[1] + centre, abs=1e-15)
        assert normals[0] == pytest.approx(-normals[1], abs=1e-14)
        assert profiles[0] == pytest.approx(profiles[1] if internal else -profiles[1], abs=1e-14)


def turns(angle: np.ndarray) -> np.ndarray:
    """(…, 3, 3): turns about z."""
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([np.stack(row, -1) for row in ((c, -s, zero), (s, c, zero), (zero, zero, one))], -2)


# ---- the strip integral --------------------------------------------------------------------------------------------
MESH = gear_sector(GEAR, WIDTH, FINER)


def rows(side: int, rolls, functions: int = 5, half_width: float = 3e-4) -> np.ndarray:
    points = Points(np.atleast_1d(rolls), functions)
    return flank_loads(MESH.nodes, MESH.flank[side].quads, flank(half_width), side, points)


def test_strip_mean_of_a_field_agrees_with_dense_sampling_of_the_flank():
    """A smooth field on the nodes, read back by the rows = its mean over the clipped strip along the analytic
    involute."""
    rolls = np.array([GEAR.s_form + 1e-5, 0.4 * GEAR.s_form + 0.6 * GEAR.s_tip, GEAR.s_tip - 1e-5])
    first, last = flank().strip(rolls)

    def field(points: np.ndarray) -> np.ndarray:
        return np.stack(
            [points[..., 0] ** 2 / 0.018, points[..., 1] * points[..., 0] / 0.018, 0 * points[..., 0]], axis=-1
        )

    read = rows(0, rolls, 1)[:, 0] @ field(MESH.nodes).ravel()
    for value, a, b in zip(read, first, last, strict=True):
        roll = np.sqrt(2 * GEAR.r_b * (a + (b - a) * (np.arange(4000) + 0.5) / 4000))
        exact = (field(GEAR.flank_point(roll))[:, :2] * GEAR.flank_normal(roll)).sum(axis=1).mean()
        assert value == pytest.approx(exact, rel=1e-4)


def test_rows_are_smooth_in_the_roll():
    """Moving the strip across element borders changes the rows continuously, with a continuous slope inside the
    flank."""
    rolls = np.linspace(0.6 * GEAR.s_form + 0.4 * GEAR.s_tip, 0.4 * GEAR.s_form + 0.6 * GEAR.s_tip, 401)
    values = rows(0, rolls, 1)[:, 0]
    slopes = np.diff(values, axis=0)
    assert np.abs(np.diff(slopes, axis=0)).max() < 0.06 * np.abs(slopes).max()


def test_width_functions_read_legendre_fields_back():
    loads = rows(1, [0.5 * (GEAR.s_form + GEAR.s_tip)], 5)[0]
    normal = GEAR.flank_normal(0.5 * (GEAR.s_form + GEAR.s_tip), -1)
    zeta = 2 * MESH.nodes[:, 2] / WIDTH
    for degree in range(3):
        field = np.zeros_like(MESH.nodes)
        field[:, :2] = np.polynomial.legendre.legval(zeta, np.eye(5)[degree])[:, None] * normal
        expected = np.zeros(5)
        expected[degree] = 1 / (2 * degree + 1)
        assert np.allclose(loads @ field.ravel(), expected, atol=1e-3)
