"""Involute functions against 50-digit arithmetic, and their own inverses and derivatives."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearfmu.geometry import involute
from gearfmu.geometry.involute_fit import FitError, FlankPoints, fit_involute, flank_faces

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


# ---- fit of measured flanks ------------------------------------------------------------------------------------------
TEETH, PHASE = 17, 0.1


def points(teeth: range = range(TEETH), noise: float = 0.0) -> tuple[FlankPoints, np.ndarray]:
    """Flank points 14 mm wide and their normals, axis tilted by 0.3° and off by a few tenths of a millimetre."""
    rng = np.random.default_rng(3)
    roll, z = (a.ravel() for a in np.meshgrid(np.linspace(0.006, 0.022, 6), np.linspace(-0.007, 0.007, 4)))
    place, normals, tooth, side = [], [], [], []
    for k in teeth:
        angle = PHASE + 2 * np.pi * k / TEETH
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        for sg in (1, -1):
            normal = np.column_stack([involute.flank_normal(roll, R_B, PSI_B, sg) @ turn.T, 0 * z])
            flat = np.column_stack([involute.flank_point(roll, R_B, PSI_B, sg) @ turn.T, z])
            place.append(flat + noise * rng.standard_normal((len(z), 1)) * normal)
            normals.append(normal)
            tooth += [k] * len(z)
            side += [sg] * len(z)
    tilt = np.radians(0.3)
    lean = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    moved = np.concatenate(place) @ lean.T + [2e-4, -3e-4, 5e-3]
    return FlankPoints(moved, np.array(tooth), np.array(side)), np.concatenate(normals) @ lean.T


@pytest.mark.parametrize("noise", [1e-6, 2e-5])
def test_noise_shows_as_residual_and_hardly_moves_the_gear(noise: float) -> None:
    given, _ = points(noise=noise)
    fit = fit_involute(given, TEETH, R_B)
    assert fit.rms == pytest.approx(noise, rel=0.1)
    assert abs(fit.r_b - R_B) < 0.5 * noise and abs(fit.psi_b - PSI_B) * R_B < 0.5 * noise


def test_what_is_no_gear_is_refused() -> None:
    given, normals = points()
    with pytest.raises(FitError, match="no face has a normal that touches"):
        flank_faces(given.points, normals, TEETH, 3 * R_B)
    with pytest.raises(FitError, match="only one side"):
        flank_faces(given.points[given.side > 0], normals[given.side > 0], TEETH, R_B)
    with pytest.raises(FitError, match="fewer than six points"):
        fit_involute(given.of(given.side > 0), TEETH, R_B)
    axial = np.tile([0.0, 0.0, 1.0], (len(normals), 1))
    with pytest.raises(FitError, match="is the gear's axis z"):
        flank_faces(given.points, axial, TEETH)
    wrong = fit_involute(given, TEETH + 1, R_B)
    assert wrong.worst > 1e-4
