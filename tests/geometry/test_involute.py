"""Involute functions against 50-digit arithmetic, and their own inverses and derivatives."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearfmu.geometry import involute

R_B, PSI_B = 33.8e-3, 0.12
rolls = st.floats(1e-4, 40e-3)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1e-4, 0.01, 0.0499999, 0.05, 0.0500001, 0.2, 0.349065850398866, 0.9, 1.4])
def test_inv_is_accurate_to_the_last_digits(angle: float) -> None:
    with mpmath.workdps(50):
        exact = float(mpmath.tan(angle) - mpmath.mpf(angle))
    # tan(a) - a cancels: one ulp of tan is 3/a² ulps of inv, 1200 at the switch to the series
    assert involute.inv(angle) == pytest.approx(exact, rel=3e-13, abs=0)


@given(st.floats(1e-9, 1.5))
def test_inverse_inv_undoes_inv(angle: float) -> None:
    assert involute.inverse_inv(float(involute.inv(angle))) == pytest.approx(angle, rel=1e-12)


def test_inverse_inv_at_its_ends() -> None:
    assert involute.inverse_inv(0.0) == 0.0
    for bad in (-1e-9, math.inf, math.nan):
        with pytest.raises(ValueError):
            involute.inverse_inv(bad)


@given(rolls)
def test_roll_radius_and_arc_length_are_inverses(roll: float) -> None:
    assert involute.roll_at_radius(involute.radius_at_roll(roll, R_B), R_B) == pytest.approx(roll, rel=1e-9)
    assert involute.roll_at_arc_length(involute.arc_length(roll, R_B), R_B) == pytest.approx(roll, rel=1e-12)


@given(rolls, st.sampled_from([1, -1]))
def test_point_lies_on_radius_and_angle_of_the_involute(roll: float, sg: int) -> None:
    x, y = involute.flank_point(roll, R_B, PSI_B, sg)
    assert math.hypot(x, y) == pytest.approx(float(involute.radius_at_roll(roll, R_B)), rel=1e-14)
    assert sg * math.atan2(y, x) == pytest.approx(float(involute.flank_angle(roll, R_B, PSI_B)), abs=1e-14)


@given(rolls, st.sampled_from([1, -1]))
def test_normal_and_arc_length_by_differences(roll: float, sg: int) -> None:
    step = 1e-7 * max(roll, 1e-3)
    tangent = involute.flank_point(roll + step, R_B, PSI_B, sg) - involute.flank_point(roll - step, R_B, PSI_B, sg)
    length = involute.arc_length(roll + step, R_B) - involute.arc_length(roll - step, R_B)
    assert np.linalg.norm(tangent) == pytest.approx(float(length), rel=1e-5)
    normal = involute.flank_normal(roll, R_B, PSI_B, sg)
    assert np.linalg.norm(normal) == pytest.approx(1, rel=1e-15)
    assert abs(normal @ tangent) < 1e-5 * np.linalg.norm(tangent)
    assert normal[1] * sg > 0, "the normal of the leading flank points to larger angles"


def test_normal_meets_the_base_circle_after_the_roll() -> None:
    """The defining property: going back from the flank along the normal by s touches the base circle."""
    roll = np.linspace(1e-3, 30e-3, 7)
    foot = involute.flank_point(roll, R_B, PSI_B) - roll[:, None] * involute.flank_normal(roll, R_B, PSI_B)
    assert np.linalg.norm(foot, axis=1) == pytest.approx(R_B, rel=1e-14)
