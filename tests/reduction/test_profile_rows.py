"""Loads and rows along the profile of spur gears and rings, spur and helical, against whole finite elements that are
loaded along e_p directly (those of helical external gears: `test_helical_rows`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import small_gear
import small_ring
from blocks import COUNT, modes_of
from turned_rows import on_tooth

from gearfmu.fem.coupling import rigid_modes
from gearfmu.reduction.cyclic.flank import flank_loads
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.reduction.elastic import Elastic

POINTS = 2 * 4 * 3


@dataclass(frozen=True)
class Case:
    """A body by one sector, and the same as whole finite elements with unit loads (4·R·A, 3N) of tooth 0, first along
    the normal, then along the profile, made on the mesh of the whole body."""

    sector: SectorBody
    free: Elastic
    loads: np.ndarray


def _case(sector: SectorBody, free: Elastic) -> Case:
    full, flank = sector.mesh.full(), sector.flank
    loads = [
        flank_loads(full.nodes, full.flank[side].quads, flank, side, sector.points, direction)
        for direction in (flank.normal, flank.tangent)
        for side in (0, 1)
    ]
    return Case(sector, free, np.concatenate(loads).reshape(2 * POINTS, -1))


BODIES: dict[str, Callable[[], Case]] = {
    "spur gear": lambda: _case(small_gear.coarse(), small_gear.whole().free),
    "spur ring": lambda: _case(small_ring.coarse(), small_ring.whole().free),
    "helical ring": lambda: _case(small_ring.coarse(math.radians(20)), small_ring.whole(math.radians(20)).free),
}


@pytest.fixture(scope="module", params=BODIES)
def case(request: pytest.FixtureRequest) -> Case:
    return BODIES[request.param]()


def test_a_unit_load_along_the_profile_is_one_newton_outwards_with_the_roll_as_its_arm(case: Case) -> None:
    """Uniform loads: mean e_p over the strip; away from the axis; moment −sg s about it; no axial force."""
    resultant = (case.sector.tangent_rows @ rigid_modes(case.sector.mesh.nodes)).reshape(2, 4, 3, 6)[:, :, 0]
    first, last = case.sector.flank.strip(case.sector.points.rolls)
    r_b = case.sector.flank.r_b
    ends = [np.sqrt(2 * r_b * arc) for arc in (first, last)]
    arm = (ends[1] ** 3 - ends[0] ** 3) / (3 * r_b * (last - first))  # mean of s over the strip's arc length
    for side, sg in ((0, 1), (1, -1)):
        assert np.linalg.norm(resultant[side, :, :2], axis=1) == pytest.approx(1.0, rel=2e-3)
        assert resultant[side, :, 0].min() > 0.7
        assert resultant[side, :, 5] == pytest.approx(-sg * arm, rel=3e-3)  # the coarse flank near the base circle
        assert np.abs(resultant[side, :, 2]).max() < 1e-13


def test_rows_along_the_profile_are_those_of_the_whole_body(case: Case) -> None:
    """Sums of N Nᵀ over each frequency cluster; on other teeth they follow from tooth 0 as those along the normal."""
    modes, own = elastic_modes(case.sector, COUNT), case.sector.mesh
    _, shapes = modes_of(case.free)
    rows = np.vstack([modes.flank_rows, modes.tangent_rows])
    omega = 2 * np.pi * modes.frequency
    ends = np.flatnonzero(np.diff(omega) / omega[:-1] > 1e-6) + 1
    for tooth in (0, 1, 5):
        moved = _turned_loads(case, tooth)
        there = on_tooth(modes, rows, tooth, own.teeth)
        for cluster in np.split(np.arange(len(omega)), ends)[:-1]:
            mine = rows[:, cluster] @ there[:, cluster].T
            theirs = (case.loads @ shapes[:, cluster]) @ (moved @ shapes[:, cluster]).T
            assert np.abs(mine - theirs).max() < 1e-5 * np.abs(rows).max() ** 2


def _turned_loads(case: Case, tooth: int) -> np.ndarray:
    """The loads of tooth 0 turned to another tooth of the whole body."""
    mesh = case.sector.mesh
    angle = 2 * np.pi * tooth / mesh.teeth
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    result = np.zeros((2 * POINTS, case.loads.shape[1] // 3, 3))
    sector_loads = np.concatenate([case.sector.flank_rows, case.sector.tangent_rows])
    local = sector_loads.reshape(2 * POINTS, -1, 3) @ turn.T
    np.add.at(result, (slice(None), mesh.sector_nodes(tooth)), local)
    return result.reshape(2 * POINTS, -1)


def test_tables_along_the_profile_are_a_direct_load_of_the_whole_body(case: Case) -> None:
    """Displacement of the own tooth along n and along e_p under loads along e_p, signs and all."""
    statics = static_tables(case.sector, [])
    assert statics.static_nt is not None and statics.static_tt is not None
    exact = case.loads @ case.free.flexibility(case.loads.T)
    nt, tt = (t.transpose(0, 2, 4, 1, 3, 5).reshape(POINTS, POINTS) for t in (statics.static_nt, statics.static_tt))
    scale = np.abs(exact).max()
    assert np.abs(nt - exact[:POINTS, POINTS:]).max() < 1e-9 * scale
    assert np.abs(tt - exact[POINTS:, POINTS:]).max() < 1e-9 * scale
    assert np.abs(nt - exact[POINTS:, :POINTS].T).max() < 1e-9 * scale  # reciprocity
    assert tt.diagonal().min() > 0 and np.abs(nt).max() > 0.01 * scale
