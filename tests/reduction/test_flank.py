"""Flank loads: exactness of the strip integral, smoothness in the roll, width functions, refusals (resultants:
`test_helical_rows`)."""

from __future__ import annotations

import numpy as np
import pytest
from small_gear import FINER, GEAR, WIDTH, flank

from gearfmu.femesh.sector import gear_sector
from gearfmu.reduction.cyclic.flank import Points, flank_loads

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
