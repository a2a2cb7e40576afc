"""Gear geometry: FZG type C numbers, the root as envelope of the rack, cross-section against polygons."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fzg import ALPHA, MODULE, PINION, WHEEL

from gearfmu.geometry import GearGeometry, involute


def test_fzg_diameters_by_hand() -> None:
    assert 2 * PINION.r == pytest.approx(72e-3)
    assert 2 * PINION.r_b == pytest.approx(67.65787e-3, abs=1e-8)  # 72 cos 20°
    assert 2 * PINION.r_f == pytest.approx((72 - 11.25 + 2 * 0.1817 * 4.5) * 1e-3, abs=1e-12)
    assert 2 * WHEEL.r_f == pytest.approx((108 - 11.25 + 2 * 0.1715 * 4.5) * 1e-3, abs=1e-12)
    # tooth thickness on the reference circle m (π/2 + 2 x tan α): 7.663784 mm
    assert 2 * PINION.thickness_angle(PINION.r) * PINION.r == pytest.approx(7.663784e-3, abs=1e-8)


def test_tip_edge_rounding_touches_flank_and_tip_circle() -> None:
    for sg in (1, -1):
        centre = PINION.flank_point(PINION.s_tip, sg) - PINION.tip_edge * PINION.flank_normal(PINION.s_tip, sg)
        assert np.linalg.norm(centre) + PINION.tip_edge == pytest.approx(PINION.r_a, rel=1e-14)
        assert sg * math.atan2(centre[1], centre[0]) == pytest.approx(PINION.tip_land_half_angle, abs=1e-14)


def left_by_the_rack(shape: GearGeometry, radius: np.ndarray) -> np.ndarray:
    """Half angle (rad) of the tooth that a rack leaves at these radii (m), from nothing but its outline: the tooth of
    the tool is `half` wide at a depth below its datum, and is rolled through in steps of the angle `turn`."""
    m, r, turn = shape.m, shape.r, np.linspace(-0.9, 0.9, 40_001)
    depth = r + shape.x * m - radius[:, None] * np.cos(turn)
    straight, rho = shape.h_fp - shape.rho_fp * (1 - math.sin(ALPHA)), shape.rho_fp
    half = m * math.pi / 4 - depth * math.tan(ALPHA)
    below = depth - (shape.h_fp - rho)
    round_end = m * math.pi / 4 - straight * math.tan(ALPHA) - rho * math.cos(ALPHA)
    half = np.where(depth > straight, round_end + np.sqrt(np.maximum(rho**2 - below**2, 0)), half)
    cut = np.where(depth < shape.h_fp, (radius[:, None] * np.sin(turn) + half) / r - turn, -np.inf)
    return shape.half_pitch - cut.max(axis=1)


@pytest.mark.parametrize(
    ("z", "x", "fillet"), [(17, 0.0, 0.25), (17, 0.0, 0.38), (14, 0.0, 0.38), (10, 0.39, 0.25), (24, 0.17, 0.38)]
)
def test_a_tooth_is_what_the_rack_leaves_of_it(z: int, x: float, fillet: float) -> None:
    """Undercut or not: involute down to the form circle, trochoid below. The tooth of an undercut gear had its flank
    on the involute's other branch."""
    shape = GearGeometry(
        z=z, m=MODULE, alpha=ALPHA, x=x, r_a=MODULE * (z / 2 + 1 + x), r_bore=0.01, tip_edge=2e-4,
        h_fp=1.25 * MODULE, rho_fp=fillet * MODULE,
    )  # fmt: skip
    form = math.hypot(shape.r_b, shape.s_form)
    above = np.linspace(form + 1e-6, shape.r_a, 12)
    involutes = involute.flank_angle(involute.roll_at_radius(above, shape.r_b), shape.r_b, shape.psi_b)
    assert left_by_the_rack(shape, above) == pytest.approx(involutes, abs=1e-8)
    radius, angle = shape.rounding.polar(np.linspace(shape.form_angle + 1e-3, math.pi / 2 - 0.2, 12))
    assert left_by_the_rack(shape, radius) == pytest.approx(angle, abs=1e-8)
