"""Pair geometry: FZG type C numbers, and contact of the real outlines."""

from __future__ import annotations

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from fzg import PAIR, PINION, WHEEL, gear, tip_circle_contact_ratio, without_backlash

from gearfmu.geometry import PairGeometry, involute
from gearfmu.geometry.mesh import contact_modulus, half_width
from gearfmu.geometry.relief import relief_at

LOOSE = PairGeometry((PINION, WHEEL), 91.7e-3, 3e-4)
OTHER = PairGeometry((gear(21, 0.3, 106e-3, 30e-3), gear(34, -0.1, 160e-3, 40e-3)), 124.8e-3, 1e-4)


def test_fzg_type_c_in_50_digits() -> None:
    with mpmath.workdps(50):
        m, a, z, alpha = mpmath.mpf("4.5"), mpmath.mpf("91.5"), (16, 24), mpmath.mpf(20) * mpmath.pi / 180
        r_b = [m * k / 2 * mpmath.cos(alpha) for k in z]
        alpha_wt = mpmath.acos(sum(r_b) / a)
        length = a * mpmath.sin(alpha_wt)
        rolls = [mpmath.sqrt((mpmath.mpf(d) / 2) ** 2 - r**2) for d, r in zip(("82.46", "118.36"), r_b, strict=True)]
        ratio = (sum(rolls) - length) / (mpmath.pi * m * mpmath.cos(alpha))
        inv = [mpmath.tan(angle) - angle for angle in (alpha, alpha_wt)]
        shifts = mpmath.mpf("0.1817") + mpmath.mpf("0.1715")
        thickness = 2 * shifts * m * mpmath.tan(alpha) + (z[0] + z[1]) * m * inv[0]
        backlash = ((z[0] + z[1]) * m * inv[1] - thickness) * mpmath.cos(alpha) / mpmath.cos(alpha_wt)
    assert math.degrees(PAIR.alpha_wt) == pytest.approx(float(alpha_wt * 180 / mpmath.pi), rel=1e-14)
    assert PAIR.length == pytest.approx(float(length) / 1e3, rel=1e-13)
    assert tip_circle_contact_ratio(PAIR) == pytest.approx(float(ratio), rel=1e-12)
    assert PAIR.nominal_backlash == pytest.approx(float(backlash) / 1e3, abs=1e-16)


def test_fzg_type_c_as_published() -> None:
    assert tip_circle_contact_ratio(PAIR) == pytest.approx(1.44, abs=0.005)
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


def test_nominal_backlash_grows_with_the_centre_distance() -> None:
    """dj_wt/da = 2 tan α_wt at constant rotation ratio (working pitch circle grows too: below 1 %)."""
    step = 1e-6
    wide = replace(PAIR, a=PAIR.a + step)
    assert (wide.nominal_backlash - PAIR.nominal_backlash) / step == pytest.approx(
        2 * math.tan(PAIR.alpha_wt), rel=0.01
    )
    assert replace(PAIR, a=without_backlash(LOOSE)).nominal_backlash == pytest.approx(0, abs=1e-15)


def test_backlash_angles_and_normal_backlash() -> None:
    free = [PAIR.backlash / r_w for r_w in PAIR.r_w]
    assert free[0] * PINION.r_b == pytest.approx(PAIR.normal_backlash, rel=1e-14)
    assert free[1] * WHEEL.r_b == pytest.approx(PAIR.normal_backlash, rel=1e-14)


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
