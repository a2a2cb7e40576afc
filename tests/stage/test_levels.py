"""Which modes are dynamic at which level: nested, pairs whole, below the cut, and only those that flanks feel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearfmu.stage import StageModel
from gearfmu.stage.assembly.levels import FAST, FELT, FULL, RIGID, SHARED_BELOW, STANDARD, WITHIN, lowest_levels
from gearfmu.stage.assembly.model import integrator_of
from gearfmu.stagefile.tables.connections import LevelSpec

CUTS = LevelSpec(fast_cut=60e3, standard_cut=120e3)
DEGREES = np.array([0, 2])


def levels(frequency: np.ndarray, member: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Of modes whose flanks yield in proportion to `size` squared."""
    omega = 2 * np.pi * frequency
    rows = np.broadcast_to(size * omega, (2, 3, DEGREES.size, omega.size))
    return lowest_levels(omega, member, rows, DEGREES, CUTS)


@given(
    st.lists(st.tuples(st.floats(1e3, 300e3), st.booleans(), st.floats(1e-4, 1.0)), min_size=1, max_size=40),
)
def test_levels_are_nested_and_pairs_whole(modes: list[tuple[float, bool, float]]) -> None:
    found: list[tuple[float, int, float]] = []
    for frequency, pair, size in sorted(modes):
        found += [(frequency, 1, size), (frequency, 2, size)] if pair else [(frequency, 0, size)]
    frequency, member, size = (np.array(column) for column in zip(*found, strict=True))
    level = levels(frequency, member, size)
    second = np.flatnonzero(member == 2)
    assert np.array_equal(level[second], level[second - 1])
    assert set(level) <= {RIGID, FAST, STANDARD, FULL}
    for most, cut in ((FAST, CUTS.fast_cut), (STANDARD, CUTS.standard_cut)):
        assert frequency[level <= most].max(initial=0.0) <= (1 + WITHIN) * cut
    assert np.all(level[frequency < (1 - WITHIN) * SHARED_BELOW * CUTS.fast_cut] == RIGID), "engagements share them"


def test_what_flanks_do_not_feel_is_static() -> None:
    frequency, member = np.array([5e3, 30e3, 40e3, 50e3, 90e3, 200e3]), np.zeros(6, int)
    share = np.array([0.1 * FELT, 0.4, 0.1 * FELT, 0.3, 0.2, 0.1])
    assert levels(frequency, member, np.sqrt(share)).tolist() == [RIGID, FAST, FULL, FAST, STANDARD, FULL]


def test_a_cut_goes_through_the_widest_gap_nearby() -> None:
    frequency, size = np.array([56e3, 59.9e3, 60.1e3, 61e3, 68e3]), np.ones(5)
    assert levels(frequency, np.zeros(5, int), size).tolist() == [FAST] * 4 + [STANDARD]


@pytest.mark.parametrize("level", ["paper", "explicit"])
def test_a_level_with_its_own_integrator_runs_what_is_said(plain: StageModel, level: str) -> None:
    said = integrator_of(level, "dg4", clutch=False)
    assert said != "dg4" and integrator_of(level, "dg4", clutch=True) == "dg4"
    forces = []
    for asked in ("dg4", said):
        kernel = plain.kernel()
        for name, item in {"level": level, "integrator": asked}.items():
            kernel.set(name, kernel.variables[name].items.index(item))
        kernel.initialize(0.0)
        kernel.set("pinion.tau" if kernel.variables["pinion.tau"].causality == "input" else "pinion.phi", 1e-4)
        kernel.step(0.0, 2e-5)
        forces.append([kernel.get("mesh.force"), kernel.get("solver.steps")])
    assert forces[0] == forces[1]


def test_level_full_takes_the_oscillators_that_its_step_follows(plain: StageModel) -> None:
    """All that standard takes, more with a shorter step, in the end all that are stored; explicit integrators all."""

    def taken(**parameters: float) -> int:
        kernel = plain.kernel(**parameters)
        kernel.prepare()
        kernel.initialize()
        return int(kernel.get("solver.n_dyn"))

    every, standard = taken(level=5.0), taken(level=2.0)
    by_step = [taken(level=3.0, h=h) for h in (20e-6, 0.0, 4e-6, 1e-7)]
    assert standard <= by_step[0] <= by_step[1] < by_step[2] < by_step[3] == every
