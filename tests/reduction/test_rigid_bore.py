"""A bore that moves as one rigid body: one sector against the whole gear with its bore's nodes eliminated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spl
import small_gear
import small_ring
from small_gear import BETA, whole

from gearfmu.fem.lanczos import lowest_modes
from gearfmu.reduction.couplings import Coupling, full_order
from gearfmu.reduction.cyclic.frf import FrfCase, frf_error
from gearfmu.reduction.cyclic.modal import Modes, elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import Statics, static_tables
from gearfmu.reduction.elastic import Elastic

MODES = 20


@dataclass(frozen=True)
class Case:
    """The two methods: sector with a rigid bore and with an averaged one, whole gear with a rigid coupling; rows (m, n)
    of the loads of tooth 0 and of the bore on the whole gear."""

    rigid: SectorBody
    averaged: SectorBody
    whole: Elastic
    rows: np.ndarray
    modes: Modes
    statics: Statics


def case_of(averaged: SectorBody, bore: str) -> Case:
    rigid = SectorBody(averaged.mesh, averaged.material, averaged.flank, averaged.points, rigid_bore=True)
    coupling = Coupling("bore", "rigid", averaged.mesh.full().sets[bore], np.zeros(3))
    order = full_order("gear", whole(averaged).elements, [coupling], ("bore",), 0.02)
    loads = whole(averaged).loads(0)
    loads = loads.reshape(len(loads), -1, 3)
    kept = np.setdiff1d(np.arange(loads.shape[1]), coupling.nodes)
    rows = np.zeros((len(loads) + 6, order.size))
    rows[: len(loads), : 3 * len(kept)] = loads[:, kept].reshape(len(loads), -1)
    rows[len(loads) :] = sp.csr_array(order.interfaces[0].rows).toarray()
    return Case(rigid, averaged, Elastic(order), rows, elastic_modes(rigid, MODES), static_tables(rigid, []))


@pytest.fixture(
    scope="module",
    params=[(small_gear.coarse, 0.0, "bore"), (small_gear.coarse, BETA, "bore"), (small_ring.coarse, 0.0, "rim")],
    ids=["spur", "helical", "ring"],
)
def case(request: pytest.FixtureRequest) -> Case:
    make, beta, bore = request.param
    return case_of(make(beta), bore)


def test_frequencies_are_those_of_the_whole_gear(case: Case) -> None:
    squared, _ = lowest_modes(case.whole, len(case.modes.frequency) + 3, block=12)
    assert np.allclose(case.modes.frequency, (np.sqrt(squared) / (2 * np.pi))[: len(case.modes.frequency)], rtol=1e-8)


def test_static_tables_are_those_of_the_whole_gear(case: Case) -> None:
    full = case.rows @ case.whole.flexibility(case.rows.T)
    points, every = case.rigid.flank_count, case.rigid.load_matrix.shape[0]
    mine = case.statics.static_ff[:, :, 0].transpose(0, 2, 4, 1, 3, 5).reshape(points, points)
    assert np.abs(mine - full[:points, :points]).max() < 1e-9 * np.abs(mine).max()
    bore = case.statics.static_fb.reshape(points, 6)
    assert np.abs(bore - full[:points, every:]).max() < 1e-9 * np.abs(bore).max()
    assert np.abs(case.statics.static_bb - full[every:, every:]).max() < 1e-9 * np.abs(case.statics.static_bb).max()


def test_a_held_bore_is_a_clamped_bore(case: Case) -> None:
    """With the reaction that balances the load, statics of the free gear answer as the finite elements with all nodes
    of the bore clamped; the averaged bore is softer."""
    points, motions = case.rigid.flank_count, case.rigid.rigid_rows()

    def held(statics: Statics, row: int) -> float:
        ff = statics.static_ff[:, :, 0].transpose(0, 2, 4, 1, 3, 5).reshape(points, points)[row, row]
        fb, lever = statics.static_fb.reshape(points, 6)[row], motions[row]
        return float(ff - 2 * fb @ lever + lever @ statics.static_bb @ lever)

    clamped = case.rows[:points, : case.whole.size - 6]
    stiffness = sp.csc_array(case.whole.stiffness[: case.whole.size - 6, : case.whole.size - 6])
    factor = spl.splu(stiffness, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    softer, rows = static_tables(case.averaged, []), (0, points // 3, points - 3)
    exact = np.array([clamped[row] @ factor.solve(clamped[row]) for row in rows])
    assert np.allclose([held(case.statics, row) for row in rows], exact, rtol=1e-8, atol=0)
    more = np.array([held(softer, row) for row in rows]) / exact - 1
    assert np.all(more > 0) and more[0] > 1e-3


def test_the_response_in_frequency_follows_the_finite_elements(case: Case) -> None:
    found = frf_error(case.rigid, case.modes, case.statics, FrfCase(0.01, case.modes.frequency[-1], 0.02))
    assert found.max_error < 0.05 and np.all(np.isfinite(found.error))
