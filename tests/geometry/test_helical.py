"""Helical gears in the transverse section: ISO 21771 identities, an independent computation, the generated root."""

from __future__ import annotations

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from fzg import PAIR, without_backlash
from hypothesis import given
from hypothesis import strategies as st
from sections import half_outline

from gearfmu.geometry import GearGeometry, PairGeometry

MODULE, ALPHA, BETA = 8e-3, math.radians(20), math.radians(15.8)


def gear(teeth: int, shift: float, beta: float, tip: float | None = None, alpha: float = ALPHA) -> GearGeometry:
    """A gear of the rack 1.0/1.4/0.39, m_n = 8 mm; its tip circle where the rack leaves it unless `tip` (m) is
    given."""
    own = GearGeometry(
        z=teeth, m=MODULE, alpha=alpha, x=shift, r_a=1.0, r_bore=20e-3, tip_edge=2e-4,
        h_fp=1.4 * MODULE, rho_fp=0.39 * MODULE, beta=beta,
    )  # fmt: skip
    return replace(own, r_a=own.r + (1 + shift) * MODULE if tip is None else tip / 2)


# worked example 1 of ISO/TR 6336-30: z = 17/103, m_n = 8 mm, β = 15.8°, a = 500 mm, x = 0.145/0, b = 100 mm
FIRST, SECOND = gear(17, 0.145, BETA, 159.66e-3), gear(103, 0.0, -BETA, 872.35e-3)
EXAMPLE = PairGeometry((FIRST, SECOND), 0.5, 0.0)

teeth = st.integers(12, 120)
angles = st.floats(-35, 35).map(math.radians)
normal_angles = st.floats(14.5, 25).map(math.radians)


def test_reference_diameters_and_overlap_as_published() -> None:
    """ISO/TR 6336-30 states d = 141.340 and 856.354 mm and ε_β = 1.083."""
    assert 2e3 * FIRST.r == pytest.approx(141.340, abs=6e-4)
    assert 2e3 * SECOND.r == pytest.approx(856.354, abs=1e-3)
    assert EXAMPLE.gears[0].overlap_ratio(0.1) == pytest.approx(1.083, abs=6e-4)
    assert without_backlash(EXAMPLE) == pytest.approx(0.5, abs=5e-6)


@pytest.mark.parametrize(
    ("pair", "module", "beta", "distance", "tips", "shifts"),
    [
        (EXAMPLE, "8", "15.8", "500", ("159.66", "872.35"), ("0.145", "0")),
        (PAIR, "4.5", "0", "91.5", ("82.46", "118.36"), ("0.1817", "0.1715")),
    ],
    ids=["ISO/TR 6336-30", "FZG type C"],
)
def test_pair_in_50_digits(
    pair: PairGeometry, module: str, beta: str, distance: str, tips: tuple[str, str], shifts: tuple[str, str]
) -> None:
    """Written down again with mpmath, by way of tooth thickness on the working circle instead of ψ_b; mm."""
    first, second = pair.gears
    with mpmath.workdps(50):
        m, a, z = mpmath.mpf(module), mpmath.mpf(distance), (first.z, second.z)
        alpha, helix = mpmath.radians(20), mpmath.radians(mpmath.mpf(beta))
        alpha_t = mpmath.atan(mpmath.tan(alpha) / mpmath.cos(helix))
        m_t = m / mpmath.cos(helix)
        r_b = [m_t * k / 2 * mpmath.cos(alpha_t) for k in z]
        alpha_wt = mpmath.acos(sum(r_b) / a)
        length = a * mpmath.sin(alpha_wt)
        rolls = [mpmath.sqrt((mpmath.mpf(d) / 2) ** 2 - r**2) for d, r in zip(tips, r_b, strict=True)]
        pitch = mpmath.pi * m_t * mpmath.cos(alpha_t)
        inv = [mpmath.tan(angle) - angle for angle in (alpha_t, alpha_wt)]
        s_t = [m_t * (mpmath.pi / 2 + 2 * mpmath.mpf(x) * mpmath.tan(alpha)) for x in shifts]
        half_b = s_t[0] / (m_t * z[0]) + inv[0]
        working = [r / mpmath.cos(alpha_wt) for r in r_b]
        thick = [2 * rw * (s / (m_t * k) + inv[0] - inv[1]) for rw, s, k in zip(working, s_t, z, strict=True)]
        backlash = 2 * mpmath.pi * working[0] / z[0] - sum(thick)
    assert first.alpha_t == pytest.approx(float(alpha_t), rel=1e-14)
    assert (first.r_b, second.r_b) == pytest.approx([float(r) / 1e3 for r in r_b], rel=1e-14)
    assert first.psi_b == pytest.approx(float(half_b), rel=1e-14)
    assert pair.alpha_wt == pytest.approx(float(alpha_wt), rel=1e-14)
    assert pair.length == pytest.approx(float(length) / 1e3, rel=1e-13)
    assert pair.base_pitch == pytest.approx(float(pitch) / 1e3, rel=1e-14)
    assert pair.tip_circle_contact_ratio == pytest.approx(float((sum(rolls) - length) / pitch), rel=1e-12)
    assert pair.nominal_backlash == pytest.approx(float(backlash) / 1e3, abs=1e-15 * pair.a)


@given(z=teeth, beta=angles, alpha=normal_angles, x=st.floats(-0.5, 1))
def test_identities_of_iso_21771(z: int, beta: float, alpha: float, x: float) -> None:
    own = gear(z, x, beta, alpha=alpha)
    same = {"rel": 1e-12, "abs": 1e-15}
    assert math.sin(own.beta_b) == pytest.approx(math.sin(beta) * math.cos(alpha), **same)
    assert math.tan(own.beta_b) == pytest.approx(math.tan(beta) * math.cos(own.alpha_t), **same)
    assert math.tan(own.alpha_t) == pytest.approx(math.tan(alpha) / math.cos(beta), **same)
    assert math.cos(own.alpha_t) * math.cos(own.beta_b) == pytest.approx(math.cos(alpha) * math.cos(beta), **same)
    assert own.r_b * own.twist == pytest.approx(math.tan(own.beta_b), **same)
    # thickness on the reference circle and normal base pitch
    assert 2 * own.r * float(own.thickness_angle(own.r)) * math.cos(beta) == pytest.approx(
        MODULE * (math.pi / 2 + 2 * x * math.tan(alpha)), rel=1e-12
    )
    pitch = 2 * math.pi * own.r_b / z
    assert pitch * math.cos(own.beta_b) == pytest.approx(math.pi * MODULE * math.cos(alpha), rel=1e-13)
    assert own.z_virtual == pytest.approx(z / (math.cos(own.beta_b) ** 2 * math.cos(beta)), rel=1e-15)


@given(z=teeth, beta=angles, x=st.floats(-0.3, 0.8))
def test_the_hand_changes_nothing_in_the_section(z: int, beta: float, x: float) -> None:
    right, left = gear(z, x, beta), gear(z, x, -beta)
    assert np.array_equal(half_outline(right), half_outline(left))
    assert (right.beta_b, right.twist) == (-left.beta_b, -left.twist)


@given(z=teeth, x=st.floats(0, 0.8))
def test_a_vanishing_helix_angle_is_the_spur_gear(z: int, x: float) -> None:
    """β² and β⁴ terms only: 1e-6° moves the outline by less than rounding, and the crossing of trochoid and flank of an
    undercut tooth, which touch nearly, by less than a nanometre."""
    spur, nearly = gear(z, x, 0.0), gear(z, x, math.radians(1e-6))
    assert np.abs(half_outline(nearly) - half_outline(spur)).max() < (1e-13 if spur.rounding.form_roll > 0 else 1e-9)
    assert (spur.beta_b, spur.twist, spur.alpha_t, spur.m_t) == (0.0, 0.0, spur.alpha, spur.m)


@pytest.mark.parametrize("own", [FIRST, SECOND, gear(23, 0.2, math.radians(35)), gear(12, 0.6, math.radians(-30))])
class TestRoot:
    def test_meets_the_involute_with_a_common_tangent(self, own: GearGeometry) -> None:
        start, after = own.rounding.point(own.alpha_t + np.array([0.0, 1e-7]))
        assert start == pytest.approx(own.flank_point(own.s_form), abs=1e-15)
        step = (after - start) / np.linalg.norm(after - start)
        assert abs(step @ own.flank_normal(own.s_form)) < 1e-4

    def test_ends_on_the_root_circle(self, own: GearGeometry) -> None:
        radius, angle = own.rounding.polar(np.array([math.pi / 2]))
        assert radius[0] == pytest.approx(own.r_f, rel=1e-14)
        assert angle[0] == pytest.approx(own.half_pitch - own.rounding.land_angle, abs=1e-14)

    def test_is_the_envelope_of_the_rolling_ellipse(self, own: GearGeometry) -> None:
        """The rack's rounding in the transverse section, by points, rolled along: none cuts the curve, one touches
        each of its points. The ellipse is the circle of the normal section over cos β, nothing of the formula used."""
        rack, beta = own.rounding, own.beta
        around = np.linspace(0, math.pi / 2, 1501)
        circle = own.rho_fp * np.stack([np.cos(around) / math.cos(beta), -np.sin(around)], axis=1)
        turn = np.linspace(-0.6, 0.6, 4001)
        for point in rack.point(np.linspace(own.alpha_t, math.pi / 2, 7)):
            radius, angle = np.hypot(*point), own.half_pitch - math.atan2(point[1], point[0])
            # the point in the frame of the rack, whose pitch line is at y = 0, for every turn of the gear
            across = radius * np.sin(angle - turn) + rack.r * turn - rack.centre_offset
            depth = radius * np.cos(angle - turn) - rack.r + rack.centre_depth
            level = np.hypot(across * math.cos(beta), depth) / own.rho_fp
            assert level.min() == pytest.approx(1, abs=2e-6)
            best = int(level.argmin())
            assert np.hypot(*(circle - [across[best], depth[best]]).T).min() < 2e-3 * own.rho_fp


def test_undercut_limit_in_the_transverse_section() -> None:
    """Sharp rack: x_min = h_f − z sin² α_t / (2 cos β), ISO 21771, with the straight dedendum."""
    straight = 1.4 - 0.39 * (1 - math.sin(ALPHA))
    for beta in (0.0, BETA, math.radians(32)):
        limit = straight - 14 * math.sin(gear(14, 0.0, beta).alpha_t) ** 2 / (2 * math.cos(beta))
        assert gear(14, limit, beta).s_form == pytest.approx(0, abs=1e-14)
        assert gear(14, 0.5, beta).least_shift(straight) == pytest.approx(limit, abs=1e-15)
        for shift, cut in ((limit - 0.01, True), (limit + 0.01, False)):
            shape = gear(14, shift, beta)
            assert bool(shape.rounding.form_roll < 0) is cut and shape.s_form > 0


def test_normal_backlash_and_wheel_phase() -> None:
    """j_bn = j_wt cos α_wt cos β_b; at the wheel's phase the rolls of the mid-width sections add up to L."""
    pair = replace(EXAMPLE, backlash=1e-4)
    expected = 1e-4 * math.cos(pair.alpha_wt) * math.cos(FIRST.beta_b)
    assert pair.normal_backlash == pytest.approx(expected, rel=1e-14)
    t = -pair.alpha_wt
    rolls = FIRST.r_b * (FIRST.psi_b - t), SECOND.r_b * (pair.wheel_phase + SECOND.psi_b - t - math.pi)
    assert sum(rolls) == pytest.approx(pair.length, rel=1e-13)
    for z in (-0.05, 0.03):  # and so in every other section, since both turn by the same arc on the base circles
        moved = rolls[0] + FIRST.r_b * FIRST.twist * z + rolls[1] + SECOND.r_b * SECOND.twist * z
        assert moved == pytest.approx(pair.length, rel=1e-13)
