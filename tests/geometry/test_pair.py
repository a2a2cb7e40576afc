"""Pair geometry: FZG type C numbers, and contact of the real outlines."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from fzg import PAIR, PINION, WHEEL, gear, without_backlash

import gearfmu as gf
from gearfmu.geometry import PairGeometry, involute
from gearfmu.geometry.iso6336 import mesh_stiffness
from gearfmu.geometry.mesh import contact_modulus, half_width
from gearfmu.geometry.relief import relief_at

LOOSE = PairGeometry((PINION, WHEEL), 91.7e-3, 3e-4)
OTHER = PairGeometry((gear(21, 0.3, 106e-3, 30e-3), gear(34, -0.1, 160e-3, 40e-3)), 124.8e-3, 1e-4)


def test_fzg_type_c_as_published() -> None:
    assert PAIR.tip_circle_contact_ratio == pytest.approx(1.44, abs=0.005)
    assert PAIR.nominal_backlash == pytest.approx(-0.07e-6, abs=0.01e-6)
    assert without_backlash(PAIR) == pytest.approx(91.5e-3, abs=0.1e-6)
    assert PAIR.r_w == pytest.approx((36.6e-3, 54.9e-3))
    assert PAIR.contact_ratio == pytest.approx(1.412, abs=5e-4)


def test_path_of_contact_is_in_order_and_both_gears_agree() -> None:
    for pair in (PAIR, OTHER):
        path = pair.path
        assert list(path.values()) == sorted(path.values())
        assert path["E"] - path["B"] == pytest.approx(pair.base_pitch, rel=1e-14)
        assert pair.outer_single_contact(0) == path["D"]
        assert pair.outer_single_contact(1) == pytest.approx(pair.opposite(path["B"]), rel=1e-13)
        assert pair.inner_single_contact(1) == pytest.approx(pair.opposite(path["D"]), rel=1e-13)
        # at the pitch point both radii add up to the centre distance
        radii = [
            involute.radius_at_roll(roll, shape.r_b)
            for roll, shape in zip((path["C"], pair.opposite(path["C"])), pair.gears, strict=True)
        ]
        assert sum(radii) == pytest.approx(pair.a, rel=1e-14)


def clearance(pair: PairGeometry, sg: int, turn: float) -> float:
    """Smallest gap (m, along the line of action) between flank sg of any pinion tooth and the wheel, by search.

    The pinion is turned by `turn`, the wheel accordingly from its phase; nothing of the gap formula is used.
    """
    pinion, wheel = pair.gears
    smallest = math.inf
    phase = pair.wheel_phase - turn * pinion.z / wheel.z
    for tooth in range(-3, 4):
        points = pinion.flank_point(np.linspace(pinion.s_form, pinion.s_tip, 20_001), sg)
        c, s = math.cos(turn + 2 * tooth * pinion.half_pitch), math.sin(turn + 2 * tooth * pinion.half_pitch)
        points = points @ np.array([[c, s], [-s, c]]) - [pair.a, 0]
        radius = np.linalg.norm(points, axis=1)
        inside = (radius < involute.radius_at_roll(wheel.s_tip, wheel.r_b)) & (radius > wheel.r_b)
        if not inside.any():
            continue
        angle = np.arctan2(points[inside, 1], points[inside, 0]) - phase
        pitch = 2 * wheel.half_pitch
        angle = angle - pitch * np.round(angle / pitch)
        facing = sg * angle > 0
        gap = (sg * angle - wheel.thickness_angle(radius[inside]))[facing] * wheel.r_b
        smallest = min(smallest, gap.min(initial=math.inf))
    return smallest


@pytest.mark.parametrize("pair", [PAIR, LOOSE, OTHER])
@pytest.mark.parametrize("turn", [0.0, 0.05, -0.11, 0.2])
def test_outlines_touch_at_the_wheel_phase_and_leave_the_backlash(pair: PairGeometry, turn: float) -> None:
    assert clearance(pair, 1, turn) == pytest.approx(0, abs=1e-9)
    coast = pair.nominal_backlash * math.cos(pair.alpha_wt)
    assert clearance(pair, -1, turn) == pytest.approx(coast, abs=1e-9)


def test_a_centre_distance_below_the_base_circles_is_refused() -> None:
    with pytest.raises(ValueError, match="base radii"):
        PairGeometry((PINION, WHEEL), PINION.r_b + WHEEL.r_b, 0.0)


def test_reliefs_of_all_kinds_reach_their_amount_at_the_tip() -> None:
    start, kinds = PAIR.outer_single_contact(0), ("linear", "parabolic", "arc")
    roll = np.linspace(start, PINION.s_a, 50)
    linear, parabolic, arc = (relief_at(roll, 15e-6, start, PINION.s_a, kind) for kind in kinds)
    for depth in (linear, parabolic, arc):
        assert (depth[0], depth[-1]) == (0, pytest.approx(15e-6, rel=1e-12))
    assert all(relief_at(1e-3, 15e-6, start, PINION.s_a, kind) == 0 for kind in kinds), "nothing before the start"
    assert linear**2 == pytest.approx(15e-6 * parabolic, abs=1e-24)
    radius = ((PINION.s_a - start) ** 2 + 15e-6**2) / (2 * 15e-6)  # tangent where it begins, its centre below
    assert (roll - start) ** 2 + (radius - arc) ** 2 == pytest.approx(np.full(50, radius**2), rel=1e-15)
    assert arc == pytest.approx(parabolic, abs=1e-9)


def test_hertz_half_width_is_consistent_with_its_peak_pressure() -> None:
    """Johnson 4.45: p0 = E* b/(2R), and the load is ∫ p = π b p0/2."""
    e_star = contact_modulus((206e9, 70e9), (0.3, 0.33))
    b = half_width(3e5, 9e-3, e_star)
    assert math.pi * b / 2 * e_star * b / (2 * 9e-3) == pytest.approx(3e5)
    assert contact_modulus((206e9, 206e9), (0.3, 0.3)) == pytest.approx(206e9 / 1.82)


def test_largest_relative_radius_lies_mid_path_or_at_its_end() -> None:
    slow = PairGeometry((gear(20, 0.0, 99e-3, 30e-3), gear(80, 0.0, 369e-3, 30e-3)), 225e-3, 0.0)
    fast = PairGeometry(slow.gears[::-1], slow.a, 0.0)
    for pair, place in ((PAIR, 0.5), (slow, slow.path["E"] / slow.length), (fast, fast.path["A"] / fast.length)):
        path = np.linspace(pair.path["A"], pair.path["E"], 2001) / pair.length
        assert pair.largest_relative_radius() == pytest.approx(pair.length * place * (1 - place))
        assert pair.largest_relative_radius() == pytest.approx(pair.length * np.max(path * (1 - path)), rel=1e-6)


# ---- mesh stiffness of ISO 6336-1 ------------------------------------------------------------------------------------
def test_a_spur_pair_by_hand() -> None:
    """FZG type C, z 16/24, x 0.1817/0.1715: q' = 0.04723 + 0.15551/16 + 0.25791/24 − 0.00635·0.1817
    − 0.11654·0.1817/16 − 0.00193·0.1715 − 0.24188·0.1715/24 + 0.00529·0.1817² + 0.00182·0.1715² = 0.063387 mm µm/N."""
    pair = gf.load("fzg_c").written.geometry
    single = 0.8 / 0.063387 * (1 + 0.5 * (1.2 - 1.25))
    assert mesh_stiffness(pair) == pytest.approx(1e9 * single * (0.75 * pair.contact_ratio + 0.25), rel=1e-3)
    assert mesh_stiffness(pair, modulus=103e9) == pytest.approx(0.5 * mesh_stiffness(pair))
    assert mesh_stiffness(pair, dedendum=1.2) == pytest.approx(mesh_stiffness(pair) / 0.975)


def test_te_shows_it_beside_its_own() -> None:
    result = gf.te("fzg_c", 302.0, 4)
    assert result.iso_stiffness == pytest.approx(14e-3 * mesh_stiffness(gf.load("fzg_c").written.geometry))
    assert "c_gamma times face width 225.5 N/µm" in repr(result), "teeth stiffer than ISO's need no reason"
    softer = replace(result, mesh_stiffness=0.5 * result.mesh_stiffness)
    assert "averaging bores lose their shape" in " ".join(repr(softer).split())
