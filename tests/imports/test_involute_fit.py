"""The involute fit finds the gear it was given, with noise as large as the noise, and refuses what is no gear."""

from __future__ import annotations

import numpy as np
import pytest

from gearfmu.geometry import involute
from gearfmu.geometry.involute_fit import FitError, FlankPoints, fit_involute, flank_faces

R_B, PSI, TEETH, PHASE = 0.033, 0.12, 17, 0.1


def points(teeth: range = range(TEETH), noise: float = 0.0) -> tuple[FlankPoints, np.ndarray]:
    """Flank points 14 mm wide and their normals, axis tilted by 0.3° and off by a few tenths of a millimetre."""
    rng = np.random.default_rng(3)
    roll, z = (a.ravel() for a in np.meshgrid(np.linspace(0.006, 0.022, 6), np.linspace(-0.007, 0.007, 4)))
    place, normals, tooth, side = [], [], [], []
    for k in teeth:
        angle = PHASE + 2 * np.pi * k / TEETH
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        for sg in (1, -1):
            normal = np.column_stack([involute.flank_normal(roll, R_B, PSI, sg) @ turn.T, 0 * z])
            flat = np.column_stack([involute.flank_point(roll, R_B, PSI, sg) @ turn.T, z])
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
    assert abs(fit.r_b - R_B) < 0.5 * noise and abs(fit.psi_b - PSI) * R_B < 0.5 * noise


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
