"""What judges the scenes of sets: overlap of the flanks from places in two kinds of axes, and complaints."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from evidence.stability.case import Case
from evidence.stability.motion import Constant, Step
from evidence.stability.planetary import CENTRALS, MESHES, SPEED, PlanetSet, set_overlap, sun_torque
from evidence.stability.record import Record

APPROACH = {"sun": (7.0e-9, 8.8e-9), "ring": (12e-9, 15.5e-9)}  # m/N under 600 N·m


def short(bench: PlanetSet, speed: float, duration: float) -> Record:
    return bench.loaded(Case("fast"), Constant(speed), bench.nominal, duration)


@pytest.fixture(scope="module")
def turning() -> Record:
    """A sixth of a turn of the carrier, so that axes that stand and axes that turn differ."""
    return short(PlanetSet(), SPEED, math.pi / 3 / SPEED)


def approach(variant: PlanetSet, record: Record, central: str) -> np.ndarray:
    """(N, n) overlap over force, m/N."""
    rows = []
    for number, mesh in enumerate(MESHES[central]):
        force = record[f"{mesh}.force_drive"] + record[f"{mesh}.force_coast"]
        rows.append(set_overlap(variant, record, central, number) / force)
    return np.array(rows)


@pytest.mark.parametrize("central", CENTRALS)
def test_overlap_under_load_is_the_elastic_approach(turning: Record, central: str) -> None:
    """Of all planets, at rest and in the mean of a run over a sixth of a turn, though pins stand out of place."""
    low, high = APPROACH[central]
    found = approach(PlanetSet(), turning, central)
    assert np.all((low < found[:, 0]) & (found[:, 0] < high)), found[:, 0]
    late = found[:, turning.time > 0.006].mean(axis=1)
    assert np.all((low < late) & (late < high)), late


def test_overlap_does_not_know_how_far_planets_give_way() -> None:
    """Pins of 1e7 N/m, which give way by 0.33 mm: the carrier's axes turn on by two fifths of it."""
    soft = PlanetSet(pin=1e7)
    record = short(soft, 0.0, 2e-5)
    for central, (low, high) in APPROACH.items():
        found = approach(soft, record, central)[:, 0]
        assert np.all((low < found) & (found < high)), found


def test_judges_hear_what_is_wrong(turning: Record) -> None:
    assert not PlanetSet().finding(turning).complaints
    assert 4 * sun_torque(turning, 0.006) == pytest.approx(600.0, rel=0.02)
    values = dict(turning.values)
    values["sun_planet2.te"] = values["sun_planet2.te"] - np.where(turning.time > 0.011, 30e-6, 0.0)
    sunk = PlanetSet().finding(replace(turning, values=values)).complaints
    assert len(sunk) == 1 and "flanks of sun_planet2 overlap" in sunk[0]
    leak = 1e-3 * turning.throughput[-1] * turning.time / turning.time[-1]
    leaking = dict(turning.values) | {"energy.stored": turning["energy.stored"] + leak}
    assert "energy" in PlanetSet().finding(replace(turning, values=leaking)).complaints[0]


@pytest.mark.parametrize("level", ["standard", pytest.param("full", marks=pytest.mark.full)])
def test_a_set_without_load_leaves_no_step_unsolved(level: str) -> None:
    """Meshes in the middle of their backlash: of a port that carries 2e-5 N m a pass reads rounding, which was taken
    for a change that does not settle (one step of these, at both levels)."""
    bench, nothing = PlanetSet(), Step(0.0, 1.0, 0.0, 0.0)
    record = bench.run(Case(level), bench.turning(Constant(SPEED), (nothing,)), 0.002)
    assert record["solver.retried_steps"][-1] == 0 and record["solver.steps"][-1] > 150
