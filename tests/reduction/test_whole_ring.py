"""An internal gear by one sector against the whole ring, and on its mounts: two methods, one answer."""

from __future__ import annotations

import numpy as np
import pytest
from blocks import COUNT, modes_of
from sections import section
from small_ring import (
    GEOMETRY,
    STEEL,
    coarse,
    mounted_stiffness,
    set_spec,
    whole,
    whole_rows,
)
from turned_rows import on_tooth

from gearfmu.fem.coupling import rigid_modes
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.reduction.toothed import ring_full_order

Z, POINTS = GEOMETRY.z, 2 * 4 * 3


@pytest.fixture(scope="module")
def modes():
    return elastic_modes(coarse(), COUNT)


@pytest.fixture(scope="module")
def statics():
    return static_tables(coarse(), [])


def test_flank_loads_are_one_newton_and_turn_the_ring_by_its_base_radius():
    """Uniform unit loads (function 0): force 1 on the normal, moment −sg r_b about the axis: into the material."""
    fields = rigid_modes(coarse().mesh.nodes)
    resultant = (coarse().flank_rows @ fields).reshape(2, 4, 3, 6)[:, :, 0]
    for side, sg in ((0, 1), (1, -1)):
        assert resultant[side, :, 5] == pytest.approx(-sg * GEOMETRY.r_b, rel=1e-5)
        assert np.linalg.norm(resultant[side, :, :2], axis=1) == pytest.approx(1.0, rel=1e-3)
        normal = GEOMETRY.flank_normal(coarse().points.rolls, sg)
        assert (normal * resultant[side, :, :2]).sum(axis=1).min() > 0.99


def test_loads_of_the_sector_are_those_of_the_whole_ring():
    assert np.abs(whole().flank_rows[0] - whole().space_0).max() < 1e-12


def test_frequencies_of_one_sector_are_those_of_the_whole_ring(modes):
    squared, _ = modes_of(whole().free)
    assert np.allclose(modes.frequency, (np.sqrt(squared) / (2 * np.pi))[: len(modes.frequency)], rtol=1e-8)


def test_rows_of_flanks_and_patches_are_those_of_the_whole_ring(modes):
    _, shapes = modes_of(whole().free)
    omega, mine_0 = 2 * np.pi * modes.frequency, np.vstack([modes.flank_rows, modes.patch_rows])
    full_0 = np.vstack([whole().flank_rows[0], whole_rows(coarse().patch_rows, 0)]) @ shapes
    ends = np.flatnonzero(np.diff(omega) / omega[:-1] > 1e-6) + 1
    for tooth in (0, 1, 5, 11):
        mine = on_tooth(modes, mine_0, tooth, Z)
        full = np.vstack([whole().flank_rows[tooth], whole_rows(coarse().patch_rows, tooth)]) @ shapes
        for cluster in np.split(np.arange(len(omega)), ends)[:-1]:
            difference = mine_0[:, cluster] @ mine[:, cluster].T - full_0[:, cluster] @ full[:, cluster].T
            assert np.abs(difference).max() < 1e-6 * np.abs(mine_0).max() ** 2


def test_static_tables_are_those_of_the_whole_ring(statics):
    patches = np.array([whole_rows(coarse().patch_rows, m) for m in range(Z)])
    loads = np.vstack([*whole().flank_rows, *patches])
    full = whole().free.flexibility(np.vstack([whole().flank_rows[0], patches[0]]).T).T @ loads.T
    flank, patch = full[:, : Z * POINTS].reshape(-1, Z, POINTS), full[:, Z * POINTS :].reshape(-1, Z, 3)
    scale = np.abs(full).max()
    for m in range(Z):
        mine = statics.static_ff[:, :, m].transpose(0, 2, 4, 1, 3, 5).reshape(POINTS, POINTS)
        assert np.abs(mine - flank[:POINTS, m]).max() < 1e-9 * scale
        assert np.abs(statics.static_fp[:, m].reshape(POINTS, 3) - patch[:POINTS, m]).max() < 1e-9 * scale
        assert np.abs(statics.static_pp[m] - patch[POINTS:, m]).max() < 1e-9 * scale


def test_inertia_is_the_analytic_one():
    area, moment = section(GEOMETRY)
    volume = Z * area * 8e-3
    assert coarse().inertia[0, 0] == pytest.approx(STEEL.density * volume, rel=1e-3)
    polar = STEEL.density * Z * moment * 8e-3
    assert coarse().inertia[5, 5] == pytest.approx(polar, rel=1e-3)


@pytest.fixture(scope="module")
def full():
    return ring_full_order(set_spec().by_file["ring"], set_spec().mounts, scale=1.0)


def test_full_order_of_the_mounted_ring_has_the_same_frequencies(full):
    assert full.size == 3 * len(whole().elements.nodes) and full.rigid.shape[1] == 0 and len(full.interfaces) == Z
    difference = abs(full.stiffness - mounted_stiffness()).max() / abs(full.stiffness).max()
    assert difference < 1e-14
    free = ring_full_order(set_spec().by_file["ring"], set_spec().mounts, scale=1.0, mounted=False)
    assert free.ground == tuple(f"mount{k}" for k in range(6)) and free.rigid.shape[1] == 6
    assert abs(free.stiffness @ free.rigid).max() < 1e-9 * abs(free.stiffness).max()


def test_input_nodes_lie_in_the_middle_of_their_flanks(full):
    points = np.array([i.point for i in full.interfaces])
    radius, angle = np.hypot(points[:, 0], points[:, 1]), np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert np.ptp(radius) < 1e-12 and np.diff(angle) == pytest.approx(2 * np.pi / Z) and np.all(points[:, 2] == 0)
    roll = np.sqrt(radius[0] ** 2 - GEOMETRY.r_b**2)
    assert roll**2 == pytest.approx(0.5 * (GEOMETRY.s_form**2 + GEOMETRY.s_tip**2), rel=1e-9)
    for interface in full.interfaces[:3]:
        assert interface.rows.toarray().sum() == 3 and interface.components == ("ux", "uy", "uz")
