"""Elements: shape functions, patch test, rigid motion, mass; surfaces and averaging couplings."""

from __future__ import annotations

import numpy as np
import pytest
from blocks import STEEL, box, ring
from hypothesis import given, settings
from hypothesis import strategies as st

from gearfmu.errors import MeshError
from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import averaging_rows, averaging_rows_uniform, rigid_modes
from gearfmu.reduction.couplings import Elements, averaging


def distorted_box(amount: float, seed: int = 0):
    """A 3 × 2 × 2 box with its inner corner nodes moved and mid nodes kept halfway."""
    nodes, elements = box((3, 2, 2), (3.0, 2.0, 2.0))
    moved = nodes + amount * np.random.default_rng(seed).uniform(-1, 1, nodes.shape)
    outside = np.unique(surface.boundary_faces(elements))
    moved[outside] = nodes[outside]
    for cell in elements:
        for slot, (a, b) in enumerate(hex20.EDGES, start=8):
            moved[cell[slot]] = 0.5 * (moved[cell[a]] + moved[cell[b]])
    return moved, elements, outside


@pytest.mark.parametrize(("module", "dimension"), [(hex20, 3), (surface, 2)])
def test_shape_functions_interpolate_and_their_gradients_are_derivatives(module, dimension):
    assert np.allclose(module.shape(module.NATURAL), np.eye(len(module.NATURAL)), atol=1e-14)
    xi = np.random.default_rng(1).uniform(-1, 1, (7, dimension))
    assert np.allclose(module.shape(xi).sum(axis=1), 1)
    for axis in range(dimension):
        step = 1e-6 * np.eye(dimension)[axis]
        slope = (module.shape(xi + step) - module.shape(xi - step)) / 2e-6
        assert np.allclose(module.shape_gradient(xi)[:, axis], slope, atol=1e-9)


@settings(max_examples=10)
@given(seed=st.integers(0, 1000))
def test_patch_linear_fields_are_exact_on_distorted_elements(seed):
    nodes, elements, outside = distorted_box(0.15, seed)
    k, _ = hex20.assemble(nodes, elements, STEEL)
    gradient = np.random.default_rng(seed).standard_normal((3, 3))
    field = nodes @ gradient.T
    forces = (k @ field.ravel()).reshape(-1, 3)
    inner = np.setdiff1d(np.arange(len(nodes)), outside)
    assert np.abs(forces[inner]).max() < 1e-9 * np.abs(forces).max()
    strain = np.array([gradient[0, 0], gradient[1, 1], gradient[2, 2], *_shear(gradient)])
    energy = 12.0 * strain @ hex20.elasticity(STEEL) @ strain
    assert field.ravel() @ (k @ field.ravel()) == pytest.approx(energy, rel=1e-11)


def _shear(g):
    return g[1, 2] + g[2, 1], g[0, 2] + g[2, 0], g[0, 1] + g[1, 0]


def test_rigid_motion_costs_no_energy_and_mass_is_the_body_s():
    nodes, elements, _ = distorted_box(0.1)
    k, m = hex20.assemble(nodes, elements, STEEL)
    modes = rigid_modes(nodes)
    assert np.abs(k @ modes).max() < 1e-12 * np.abs(k.data).max()
    inertia = modes.T @ (m @ modes)
    mass = STEEL.density * 12.0
    assert np.allclose(inertia[:3, :3], mass * np.eye(3), rtol=1e-11, atol=1e-8 * mass)
    assert np.allclose(inertia.diagonal()[3:], mass / 12 * np.array([8.0, 13.0, 13.0]), rtol=1e-4)
    assert abs(k - k.T).max() == 0
    assert abs(m - m.T).max() == 0


def test_a_folded_element_is_refused():
    nodes, elements = box((1, 1, 1), (1.0, 1.0, 1.0))
    with pytest.raises(MeshError, match="Jacobian"):
        hex20.assemble(nodes * [1, 1, -1], elements, STEEL)


@pytest.mark.parametrize("weighting", ["surface", "uniform"])
def test_averaging_node_follows_rigid_motion_and_spreads_its_loads(weighting):
    nodes, elements = ring((2, 8, 2), 0.02, 0.05, 0.02)
    bore = np.flatnonzero(np.abs(np.hypot(nodes[:, 0], nodes[:, 1]) - 0.02) < 1e-9)
    if weighting == "surface":
        rows = averaging_rows(nodes, surface.faces_within(elements, bore))
    else:
        rows = averaging_rows_uniform(nodes, bore)
    assert np.allclose(rows @ rigid_modes(nodes), np.eye(6), atol=1e-10)
    assert set(np.flatnonzero(np.abs(rows).max(axis=0)) // 3) <= set(bore)
    resultant = rigid_modes(nodes).T @ rows.T
    assert np.allclose(resultant, np.eye(6), atol=1e-10)


def test_averaging_node_does_not_depend_on_the_mesh():
    """∫ over the surface, not a sum over nodes: uneven elements do not pull the mean towards them."""
    even, graded = box((2, 2, 2), (1.0, 1.0, 1.0)), box((6, 2, 2), (1.0, 1.0, 1.0))
    uneven = graded[0].copy()
    uneven[:, 0] = 2 * (uneven[:, 0] + 0.5) ** 2 - (uneven[:, 0] + 0.5) ** 3 - 0.5
    means = []
    for nodes, elements in (even, (uneven, graded[1])):
        top = np.flatnonzero(nodes[:, 2] > 0.5 - 1e-9)
        rows = averaging(Elements(nodes, elements, *hex20.assemble(nodes, elements, STEEL)), top, np.zeros(3))
        means.append(rows @ np.stack([nodes[:, 1] ** 2, nodes[:, 0], nodes[:, 1] * 0], axis=1).ravel())
    assert np.allclose(means[0], means[1], atol=1e-12)
