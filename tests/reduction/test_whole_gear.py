"""Two methods, one answer: the reduction on one sector against the whole gear without any symmetry."""

from __future__ import annotations

import numpy as np
import pytest
from blocks import COUNT, modes_of
from sections import section
from small_gear import GEAR, coarse, whole
from turned_rows import on_tooth

from gearfmu.fem.coupling import rigid_modes
from gearfmu.reduction.cyclic.frf import FrfCase, frf_error
from gearfmu.reduction.cyclic.modal import Modes, elastic_modes
from gearfmu.reduction.cyclic.statics import Statics, static_tables

TEETH = range(GEAR.z)


@pytest.fixture(scope="module")
def modes() -> Modes:
    return elastic_modes(coarse(), COUNT)


@pytest.fixture(scope="module")
def statics() -> Statics:
    return static_tables(coarse(), [0, 5])


def test_frequencies_of_one_sector_are_those_of_the_whole_gear(modes):
    squared, _ = modes_of(whole().free)
    assert np.allclose(modes.frequency, (np.sqrt(squared) / (2 * np.pi))[: len(modes.frequency)], rtol=1e-8)


def test_rows_of_flanks_and_bore_are_those_of_the_whole_gear(modes):
    """Sums of N Nᵀ over each frequency cluster do not depend on how pairs are turned: tooth 0, bore, and teeth by
    formula."""
    _, shapes = modes_of(whole().free)
    reduced_0 = np.vstack([modes.flank_rows, modes.bore_rows])
    full_0 = np.vstack([whole().flank_rows[0], whole().bore_rows]) @ shapes
    omega = 2 * np.pi * modes.frequency
    ends = np.flatnonzero(np.diff(omega) / omega[:-1] > 1e-6) + 1
    for tooth in (0, 1, 5, 11):
        reduced = np.vstack([on_tooth(modes, modes.flank_rows, tooth, GEAR.z), modes.bore_rows])
        full = np.vstack([whole().flank_rows[tooth], whole().bore_rows]) @ shapes
        for cluster in np.split(np.arange(len(omega)), ends)[:-1]:
            mine, theirs = reduced_0[:, cluster] @ reduced[:, cluster].T, full_0[:, cluster] @ full[:, cluster].T
            assert np.abs(mine - theirs).max() < 1e-6 * np.abs(reduced_0).max() ** 2


def test_modes_are_in_pairs_sorted_and_of_the_parity_their_rows_show(modes):
    assert np.all(np.diff(modes.frequency) >= 0)
    first = np.flatnonzero(modes.part == 1)
    assert np.array_equal(modes.part[first + 1], np.full(len(first), 2))
    assert np.array_equal(modes.frequency[first], modes.frequency[first + 1])
    single = modes.part == 0
    assert np.all((modes.nodal_diameter[single] == 0) | (2 * modes.nodal_diameter[single] == GEAR.z))
    rows = np.abs(modes.flank_rows.reshape(2, 4, 3, -1)).max(axis=(0, 1))
    assert np.all(rows[1, modes.parity == 1] == 0)
    assert np.all(rows[0, modes.parity == -1] == 0)
    assert np.all(rows[2, modes.parity == -1] == 0)


def test_static_tables_are_those_of_the_whole_gear(statics):
    loads, own = np.vstack([*whole().flank_rows, whole().bore_rows]), [whole().flank_rows[0], whole().bore_rows]
    full = whole().free.flexibility(np.vstack(own).T).T @ loads.T
    points = len(coarse().flank_rows)
    flank, scale = full[:points], np.abs(statics.static_ff).max()
    for tooth in TEETH:
        mine = statics.static_ff[:, :, tooth].transpose(0, 2, 4, 1, 3, 5).reshape(points, points)
        assert np.abs(mine - flank[:, tooth * points : (tooth + 1) * points]).max() < 1e-9 * scale
    bore = statics.static_fb.reshape(points, 6)
    assert np.abs(bore - flank[:, -6:]).max() < 1e-9 * np.abs(bore).max()
    assert np.abs(statics.static_bb - full[-6:, -6:]).max() < 1e-9 * np.abs(statics.static_bb).max()


def test_pictures_are_the_static_displacement_of_every_sector(statics):
    full = whole().free.flexibility(whole().flank_rows[0][[0, 5]].T)
    mesh = coarse().mesh
    for tooth in (0, 3, 11):
        angle = 2 * np.pi * tooth / GEAR.z
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        index = mesh.sector_nodes(tooth)
        for load in (0, 1):
            mine = statics.pictures[load, tooth].reshape(-1, 3) @ turn.T
            theirs = full[:, load].reshape(-1, 3)[index]
            assert np.abs(mine - theirs).max() < 1e-9 * np.abs(full).max()


def test_compliance_is_reciprocal_and_positive_semidefinite(statics):
    ff, points = statics.static_ff, len(coarse().flank_rows)
    back = ff[:, :, (-np.arange(GEAR.z)) % GEAR.z].transpose(1, 0, 2, 4, 3, 6, 5)
    assert np.array_equal(ff, back)
    blocks = ff.transpose(2, 0, 3, 5, 1, 4, 6).reshape(GEAR.z, points, points)
    flank = np.block([[blocks[(n - m) % GEAR.z] for n in TEETH] for m in TEETH])
    bore = np.vstack([_turned(statics.static_fb.reshape(points, 6), m) for m in TEETH])
    whole_matrix = np.block([[flank, bore], [bore.T, statics.static_bb]])
    scale = np.sqrt(whole_matrix.diagonal())
    values = np.linalg.eigvalsh(whole_matrix / np.outer(scale, scale))
    assert values.min() > -1e-11 * values.max()


def _turned(flank_bore: np.ndarray, tooth: int) -> np.ndarray:
    """Rows of tooth m per load on the bore: the load seen from that tooth is turned back."""
    angle = 2 * np.pi * tooth / GEAR.z
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    return flank_bore @ np.kron(np.eye(2), turn.T)


def test_even_and_odd_width_functions_do_not_see_each_other(statics):
    odd = np.arange(3) % 2 == 1
    assert np.all(statics.static_ff[..., odd, :][..., ~odd] == 0)
    assert np.all(statics.static_ff[..., ~odd, :][..., odd] == 0)


@pytest.mark.full
def test_all_modes_together_are_the_static_compliance(statics):
    """Modes + residual = static compliance: with every mode of the model the residual vanishes."""
    everything = elastic_modes(coarse(), 10**6)
    assert len(everything.frequency) == whole().free.elastic
    squared = (2 * np.pi * everything.frequency) ** 2
    points = len(coarse().flank_rows)
    for tooth in (0, 1, 7):
        table = statics.static_ff[:, :, tooth].transpose(0, 2, 4, 1, 3, 5).reshape(points, points)
        total = (everything.flank_rows / squared) @ on_tooth(everything, everything.flank_rows, tooth, GEAR.z).T
        assert np.abs(total - table).max() < 1e-8 * np.abs(statics.static_ff).max()
    bore = (everything.bore_rows / squared) @ everything.bore_rows.T
    assert np.abs(bore - statics.static_bb).max() < 1e-8 * np.abs(statics.static_bb).max()


def test_inertia_is_that_of_the_whole_gear():
    fields = rigid_modes(coarse().mesh.full().nodes)
    inertia = fields.T @ whole().free.mass(fields)
    assert np.allclose(coarse().inertia, inertia, rtol=1e-10, atol=1e-10 * np.abs(inertia).max())
    expected = 7850 * GEAR.z * section(GEAR)[0] * 8e-3
    assert coarse().inertia[0, 0] == pytest.approx(expected, rel=2e-3)


def test_frf_error_is_that_of_a_direct_solution_of_the_whole_gear(modes, statics):
    """Reference by Taylor series = reference by a direct solution of all equations, at the end of the band and
    beyond."""
    import scipy.sparse as sp
    import scipy.sparse.linalg as spl

    case = FrfCase(damping_ratio=0.01, cut=150e3, length=GEAR.r)
    found = frf_error(coarse(), modes, statics, case)
    free, points = whole().free, coarse().points
    flat = np.arange(2 * 4 * 3).reshape(2, 4, 3)[:, [0, 2, 3], :2].ravel()
    rows = np.vstack([whole().flank_rows[0][flat], whole().bore_rows])
    rows[-3:] *= case.length
    kept = modes.frequency < found.cut
    near = np.vstack([modes.flank_rows[flat], modes.bore_rows])[:, kept]
    near[-3:] *= case.length
    static = rows @ free.flexibility(rows.T)
    rigid = rows @ free.rigid
    assert found.size == kept.sum() and len(points.rolls) == 4
    for line in (60, -1):
        squared = (2 * np.pi * found.frequency[line]) ** 2
        s = squared / (1 + 2j * case.damping_ratio)
        pencil = sp.csc_matrix(free.stiffness * (1 + 2j * case.damping_ratio) - squared * free.mass_matrix)
        elastic = rows @ free.gauge(spl.splu(pencil, "MMD_AT_PLUS_A").solve(free.balance(rows.T).astype(complex)))
        full = elastic - rigid @ rigid.T / squared
        w2 = (2 * np.pi * modes.frequency[kept]) ** 2
        reduced = ((near / (w2 - s)) @ near.T + static - (near / w2) @ near.T) * s / squared - rigid @ rigid.T / squared
        held = [h[:-6, :-6] - h[:-6, -6:] @ np.linalg.solve(h[-6:, -6:], h[-6:, :-6]) for h in (full, reduced)]
        exact = np.linalg.norm(held[0] - held[1]) / np.linalg.norm(held[0])
        assert found.error[line] == pytest.approx(exact, rel=2e-3, abs=1e-9)
    assert np.all(np.diff(found.error[:50]) > 0)
