"""A helical ring: its twisted sector against the whole ring, its rows against closed forms, both hands, the spur ring
as its limit, and a planet of its hand in it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from blocks import COUNT, modes_of
from sections import section
from small_ring import STEEL, coarse, geometry, turn, whole, whole_rows

from gearfmu.femesh.quality import scaled_jacobian
from gearfmu.geometry import GearGeometry
from gearfmu.geometry.mesh import RingMesh
from gearfmu.reduction.cyclic.flank import ToothFlank
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.statics import static_tables

BETA = math.radians(20)
Z, POINTS, WIDTH = 24, 2 * 4 * 3, 8e-3


@pytest.mark.parametrize("degrees", [-35, -20, 8, 35])
def test_twisted_sectors_are_sound(degrees: float) -> None:
    """Positive Jacobians, cuts one pitch apart, flank nodes on the involute of their section, normals out of the ring,
    the mass of the section times the width."""
    shape, made = geometry(math.radians(degrees)), coarse(math.radians(degrees))
    mesh = made.mesh
    assert mesh.twist == pytest.approx(math.tan(shape.beta) / shape.r) and len(made.spaces) == 1
    assert scaled_jacobian(mesh).min() > 0.2
    assert np.abs(mesh.nodes[mesh.cut_minus] @ turn(1).T - mesh.nodes[mesh.cut_plus]).max() < 1e-15
    for side, sg in ((0, 1), (1, -1)):
        grid = mesh.flank[side]
        points = mesh.nodes[grid.quads]
        back = np.einsum("qnij,qnj->qni", _turns(-shape.twist * grid.z), points)[..., :2]
        assert np.abs(back - shape.flank_point(grid.roll, sg)).max() < 1e-15
        corners = points[:, :4]
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        outward = made.flank.normal(grid.roll.mean(axis=1), side, grid.z.mean(axis=1))
        assert (normal * outward).sum(axis=1) == pytest.approx(np.linalg.norm(normal, axis=1), rel=0.05)
    assert made.inertia[0, 0] == pytest.approx(STEEL.density * Z * section(shape)[0] * WIDTH, rel=2e-3)


@pytest.mark.parametrize("beta", [BETA, -BETA])
def test_a_unit_load_pushes_along_the_axis_by_sin_beta_b(beta: float) -> None:
    """1 N along n = −(cos β_b n_t − sg sin β_b e_z): axial force sg sin β_b, moment −sg r_b cos β_b, and so
    F_t tan β = F_a."""
    shape, made = geometry(beta), coarse(beta)
    resultant = made.rigid_rows().reshape(2, 4, 3, 6)[:, :, 0]
    for side, sg in ((0, 1), (1, -1)):
        assert resultant[side, :, 2] == pytest.approx(sg * math.sin(shape.beta_b), abs=1e-13)
        assert resultant[side, :, 5] == pytest.approx(-sg * shape.r_b * math.cos(shape.beta_b), rel=1e-4)
        assert resultant[side, :, 5] / shape.r * math.tan(beta) == pytest.approx(-resultant[side, :, 2], rel=1e-4)


def test_frequencies_of_one_sector_are_those_of_the_whole_ring() -> None:
    modes = elastic_modes(coarse(BETA), COUNT)
    squared, _ = modes_of(whole(BETA).free)
    assert np.allclose(modes.frequency, (np.sqrt(squared) / (2 * np.pi))[: len(modes.frequency)], rtol=1e-8)


@pytest.mark.full
def test_static_tables_are_those_of_the_whole_ring() -> None:
    made, full = coarse(BETA), whole(BETA)
    statics = static_tables(made, [])
    assert np.abs(full.flank_rows[0] - full.space_0).max() < 1e-12
    patches = np.array([whole_rows(made.patch_rows, m) for m in range(Z)])
    loads = np.vstack([*full.flank_rows, *patches])
    exact = full.free.flexibility(np.vstack([full.flank_rows[0], patches[0]]).T).T @ loads.T
    flank, patch = exact[:, : Z * POINTS].reshape(-1, Z, POINTS), exact[:, Z * POINTS :].reshape(-1, Z, 3)
    scale = np.abs(exact).max()
    for m in range(Z):
        mine = statics.static_ff[:, :, m].transpose(0, 2, 4, 1, 3, 5).reshape(POINTS, POINTS)
        assert np.abs(mine - flank[:POINTS, m]).max() < 1e-9 * scale
        assert np.abs(statics.static_fp[:, m].reshape(POINTS, 3) - patch[:POINTS, m]).max() < 1e-9 * scale
        assert np.abs(statics.static_pp[m] - patch[POINTS:, m]).max() < 1e-9 * scale


def test_a_vanishing_helix_is_the_spur_ring() -> None:
    """β = 1e-6°, reduced without mirror symmetry."""
    nearly, spur = coarse(math.radians(1e-6)), coarse()
    assert len(nearly.spaces) == 1 and len(spur.spaces) == 2
    tables, expected = static_tables(nearly, []), static_tables(spur, [])
    for name in ("static_ff", "static_fb", "static_bb", "static_fp", "static_pp", "static_nt", "static_tt"):
        difference = np.abs(getattr(tables, name) - getattr(expected, name)).max()
        assert difference < 1e-6 * np.abs(getattr(expected, name)).max(), name
    assert abs(nearly.load_matrix - spur.load_matrix).max() < 1e-6 * abs(spur.load_matrix).max()


def test_a_ring_of_the_other_hand_is_the_mirror_image() -> None:
    """About mid-width: odd width functions change their sign."""
    right, left = (static_tables(coarse(sign * BETA), []).static_ff for sign in (1, -1))
    sign = (-1.0) ** np.arange(3)
    assert np.abs(left - right * sign[:, None] * sign).max() < 1e-9 * np.abs(right).max()
    assert np.abs(right[..., 0, 1]).max() > 1e-3 * np.abs(right).max()


def test_a_planet_of_the_rings_hand_touches_it_along_a_line_with_opposite_normals() -> None:
    """In every section the points at the local rolls s + sg z tan β_b coincide; the profile directions are the same:
    both rolls grow outwards."""
    ring = geometry(BETA)
    planet = GearGeometry(
        z=10, m=ring.m, alpha=ring.alpha, x=0.0, beta=BETA, r_a=0.015, r_bore=0.004, tip_edge=1e-4,
        h_fp=1.25 * ring.m, rho_fp=0.3 * ring.m,
    )  # fmt: skip
    mesh = RingMesh((planet, ring), ring.r - planet.r + 1e-4, 0.0)
    phase = {planet: 0.0, ring: mesh.ring_phase(0.0, 0.0)}
    for z in np.linspace(-WIDTH / 2, WIDTH / 2, 5):
        rolls, points, normals, profiles = [], [], [], []
        for shape in (planet, ring):
            own = ToothFlank(
                shape.r_b, shape.psi_b, shape.s_form, shape.s_tip, WIDTH, 3e-4, shape is ring, shape.beta_b
            )
            turned = _turns(np.array(phase[shape]))
            roll = shape.r_b * (phase[shape] + shape.psi_b + mesh.alpha_wt) + z * math.tan(shape.beta_b)
            points.append(turned @ _turns(np.array(shape.twist * z)) @ np.append(shape.flank_point(roll), z))
            normals.append(turned @ own.normal(np.array(roll), 0, z))
            profiles.append(turned @ own.tangent(np.array(roll), 0, z))
            rolls.append(roll)
        assert rolls[1] - rolls[0] == pytest.approx(mesh.length, rel=1e-12)
        assert points[0] + [mesh.a, 0, 0] == pytest.approx(points[1], abs=1e-15)
        assert normals[0] == pytest.approx(-normals[1], abs=1e-14)
        assert profiles[0] == pytest.approx(profiles[1], abs=1e-14)


def _turns(angle: np.ndarray) -> np.ndarray:
    """(…, 3, 3): turns about z."""
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([np.stack(row, -1) for row in ((c, -s, zero), (s, c, zero), (zero, zero, one))], -2)
