"""Carriers whose bolts are alike: one bolt's part factorised for all gives the solutions of the whole body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearfmu.reduction.carrier import carrier_full_order
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.stagefile.stage import load_stage

SCALE = 0.2
SHIFTS = (-((2e4 * np.pi) ** 2), (2e4 * np.pi) ** 2)  # rad²/s², the second beyond the first elastic modes
SOFT = {name: "averaging" for name in ("bolt0", "bolt1", "bolt2", "bolt3", "bore")}


def carrier(stage: str, coupling: dict[str, str]) -> FullOrder:
    own = load_stage(stage).by_file["carrier"]
    return carrier_full_order(own.model_copy(update={"coupling": coupling or own.coupling}), SCALE)


@pytest.fixture(params=[("planetary54", {}), ("helical_set", {}), ("planetary54", SOFT)], scope="module")
def body(request: pytest.FixtureRequest) -> FullOrder:
    return carrier(*request.param)


def test_parts_are_all_unknowns_each_inner_one_once(body: FullOrder) -> None:
    assert body.parts is not None
    inner = body.parts.inner.ravel()
    assert len(np.unique(inner)) == len(inner)
    assert np.array_equal(np.union1d(inner, body.parts.border), np.arange(body.size))


def test_static_and_shifted_solutions_are_those_of_the_whole_body(body: FullOrder) -> None:
    loads = body.rows().T.toarray()
    parts, whole = Elastic(body), Elastic(replace(body, parts=None))
    pairs = [(parts.flexibility(loads), whole.flexibility(loads))]
    pairs += [(parts.shifted(shift).solve(loads), whole.shifted(shift).solve(loads)) for shift in SHIFTS]
    for own, other in pairs:
        assert np.abs(own - other).max() < 1e-9 * np.abs(other).max()


def test_a_body_held_at_its_bore_is_solved_by_its_parts_too(body: FullOrder) -> None:
    held = body.grounded()
    loads = held.rows().T.toarray()
    own, other = Elastic(held).flexibility(loads), Elastic(replace(held, parts=None)).flexibility(loads)
    assert np.abs(own - other).max() < 1e-9 * np.abs(other).max()


def test_bolts_that_are_coupled_differently_are_no_equal_parts() -> None:
    assert carrier("planetary54", {"bolt1": "averaging"}).parts is None
