"""Eigenmodes against exact and published frequencies; convergence rates; one sector = the whole body."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from blocks import STEEL, box, free_bending, free_body, grid_mesh, ring, ring_sector

from gearfmu.errors import MeshError
from gearfmu.fem import hex20
from gearfmu.fem.cyclic import Sector, sector_spaces
from gearfmu.fem.lanczos import ModesError, lowest_modes

REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "nafems_ring_test6.json").read_text())


def whole_body(nodes, elements, material=STEEL):
    return free_body(*hex20.assemble(nodes, elements, material), nodes, elements)


def frequencies(body, count: int) -> np.ndarray:
    return np.sqrt(lowest_modes(body, count)[0]) / (2 * np.pi)


def axial_eigenvalue(cells: int, length: float) -> float:
    """ω² of the first axial mode of a free bar, found by its shape."""
    nodes, elements = box((cells, 1, 1), (length, 0.3, 0.3))
    body = whole_body(nodes, elements, SimpleNamespace(youngs_modulus=4.0, poisson_ratio=0.0, density=1.0))
    squared, shapes = lowest_modes(body, 12)
    axial = np.zeros((len(nodes), 3))
    axial[:, 0] = np.sin(np.pi * nodes[:, 0] / length)
    return squared[np.abs(shapes.T @ body.mass(axial.ravel())).argmax()]


def test_eigenvalues_of_a_bar_converge_with_the_fourth_power_of_the_element_size():
    exact = 4.0 * (np.pi / 2.0) ** 2
    cells = np.array([2, 3, 4, 6])
    errors = np.array([axial_eigenvalue(n, 2.0) for n in cells]) / exact - 1
    assert np.all(errors > 0)
    slope = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
    assert 3.7 < slope < 4.3


def timoshenko_free(length: float, side: float, material) -> float:
    """First bending frequency (Hz) of a free square beam (Timoshenko; shear coefficient of Cowper 1966)."""
    e, nu, rho = material.youngs_modulus, material.poisson_ratio, material.density
    area, second = side**2, side**4 / 12
    shear = 10 * (1 + nu) / (12 + 11 * nu) * e / (2 * (1 + nu)) * area
    euler = (4.730040744862704 / length) ** 2 * np.sqrt(e * second / (rho * area))
    bracket = (0.7 * euler, 1.0001 * euler)
    return free_bending(length, e * second, shear, rho * area, rho * second, bracket) / (2 * np.pi)


@pytest.mark.parametrize(("length", "cells", "tolerance"), [(0.1, 10, 2e-3), (0.6, 24, 5e-4)])
def test_free_beam_bends_as_timoshenko_says(length, cells, tolerance):
    body = whole_body(*box((cells, 2, 2), (length, 0.01, 0.01)))
    first = frequencies(body, 2)
    exact = timoshenko_free(length, 0.01, STEEL)
    assert np.allclose(first, exact, rtol=tolerance)


def nafems_ring(cells: int, sectors: int, across: int) -> Sector:
    """One sector of the ring of round section: radius 1 m, diameter 0.1 m."""

    def mapping(u: np.ndarray) -> np.ndarray:
        x, y = 2 * u[:, 0] - 1, 2 * u[:, 2] - 1
        radial = 1.0 + 0.05 * x * np.sqrt(1 - y**2 / 2)
        phi = 2 * np.pi / sectors * (u[:, 1] - 0.5)
        return np.stack([radial * np.cos(phi), radial * np.sin(phi), 0.05 * y * np.sqrt(1 - x**2 / 2)], axis=1)

    p = REFERENCE["params"]
    material = SimpleNamespace(youngs_modulus=p["E"], poisson_ratio=p["nu"], density=p["rho"])
    nodes, elements = grid_mesh((across, cells, across), mapping)
    phi, r = np.arctan2(nodes[:, 1], nodes[:, 0]), np.hypot(nodes[:, 0], nodes[:, 1])
    order = np.lexsort((np.round(nodes[:, 2], 9), np.round(r, 9)))
    minus, plus = (order[np.abs(phi[order] - s * np.pi / sectors) < 1e-9] for s in (-1, 1))
    return Sector(nodes, elements, *hex20.assemble(nodes, elements, material), sectors, minus, plus)


def test_nafems_ring_r0015_test_6():
    """In-plane and out-of-plane modes ν = 2, 3, 4 of the free ring: own converged 3-D values to 1e-3."""
    spaces = sector_spaces(nafems_ring(1, 96, 4))
    found = [[frequencies(space.harmonic(nu), 1)[0] for nu in (2, 3, 4)] for space in spaces]
    published = np.array(REFERENCE["own_3d"]).reshape(3, 2, 2)
    assert np.allclose(found[0], published[:, 1, 0], rtol=1e-3)
    assert np.allclose(found[1], published[:, 0, 0], rtol=1e-3)


def test_cuts_that_do_not_match_are_refused():
    s = ring_sector((1, 2, 1), 0.02, 0.06, 0.02, 6)
    matrices = hex20.assemble(s.nodes, s.elements, STEEL)
    with pytest.raises(MeshError, match="turn by 2π/6"):
        sector_spaces(Sector(s.nodes, s.elements, *matrices, 6, s.cut_minus, s.cut_plus[::-1]))
    with pytest.raises(MeshError, match="must match"):
        sector_spaces(Sector(s.nodes, s.elements, *matrices, 6, s.cut_minus, s.cut_plus[1:]))


def test_a_space_that_ends_before_its_modes_is_told():
    """Two oscillators of three are started: what is asked beyond them is in no vector of the space."""
    three = np.diag([4.0, 2.0, 1.0])
    body = SimpleNamespace(size=3, elastic=3, dtype=float, mass=lambda v: v, flexibility=lambda load: three @ load)
    start = np.array([[1.0], [1.0], [0.0]])
    assert lowest_modes(body, 2, start=start)[0] == pytest.approx([0.25, 0.5])
    with pytest.raises(ModesError, match="not all of 3 modes found: the Krylov space ends at 2 vectors"):
        lowest_modes(body, 3, start=start)


def test_inertia_relief_is_a_projection_and_leaves_no_rigid_motion():
    nodes, elements = ring((1, 8, 2), 0.02, 0.06, 0.02)
    body = whole_body(nodes, elements)
    assert np.allclose(body.rigid.T @ body.mass(body.rigid), np.eye(6), atol=1e-12)
    loads = np.random.default_rng(2).standard_normal((body.size, 4))
    once = body.balance(loads)
    assert np.allclose(body.balance(once), once, atol=1e-12)
    assert np.abs(body.rigid.T @ once).max() < 1e-10
    moved = body.flexibility(loads)
    assert np.abs(body.rigid.T @ body.mass(moved)).max() < 1e-13 * np.abs(moved).max() * np.sqrt(body.size)
    assert np.abs(body.flexibility(body.mass(body.rigid))).max() < 1e-9 * np.abs(moved).max()
    assert np.allclose(loads.T @ moved, (loads.T @ moved).T, rtol=1e-9, atol=0)
    assert np.abs(body.stiffness @ moved - once).max() < 1e-8
