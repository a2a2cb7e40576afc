"""Methods side by side: the same answers in one process and in two, each method charged for what it uses."""

from __future__ import annotations

import numpy as np
import pytest
from small_body import small

from gearfmu.errors import BodyError
from gearfmu.reduction.basis import Size
from gearfmu.reduction.comparison import Contest, compare
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.transfer import Judging

LINES = Judging.over(lines=12)
ENTRIES = tuple((method, Size(40)) for method in ("modal", "craig_bampton", "rubin", "krylov", "static"))


def test_lanes_in_processes_of_their_own_give_what_one_process_gives():
    contest, seen = Contest(ENTRIES, LINES), []
    alone = compare(small().grounded(), contest)
    together = compare(small().grounded(), contest, lambda what, share: seen.append(share), processes=2)
    assert [t.method for t in together.trials] == [t.method for t in alone.trials] == [m for m, _ in ENTRIES]
    for own, other in zip(alone.trials, together.trials, strict=True):
        assert np.allclose(own.error, other.error, rtol=1e-6, atol=1e-9)
    assert np.allclose(alone.reference.matrix, together.reference.matrix, rtol=1e-9, atol=0)
    assert seen == sorted(seen) and seen[-1] == 1


@pytest.mark.parametrize("processes", [1, 2])
def test_a_method_is_charged_for_what_another_made_for_it(processes: int):
    found = compare(small().grounded(), Contest((("modal", Size(40)), ("rubin", Size(40))), LINES), processes=processes)
    modal, rubin = found.trials
    assert rubin.seconds > 0.5 * modal.seconds > 0
    assert found.seconds > found.reference_seconds > 0


@pytest.mark.parametrize("processes", [1, 2])
def test_a_method_that_cannot_do_its_task_says_so(processes: int):
    with pytest.raises(BodyError, match="Rubin's method needs one attachment mode"):
        compare(small().grounded(), Contest((("modal", Size(5)), ("rubin", Size(5))), LINES), processes=processes)


def test_a_shift_between_two_eigenvalues_stays_and_one_at_an_eigenvalue_moves():
    """The distance to the nearest eigenvalue does not cancel between neighbours on either side of the shift."""
    space = Elastic(small().grounded())
    squared = space.modes(8)[0]
    middle = 0.5 * (squared[2] + squared[3])
    assert space.shifted(middle).shift == middle
    assert space.shifted(middle).distance() == pytest.approx(squared[3] - middle, rel=0.05)
    moved = space.shifted(squared[5]).shift
    assert moved != squared[5] and abs(moved / squared[5] - 1) < 0.02
    assert space.shifted(1.001 * middle, near=np.array([1.001 * middle])).shift != 1.001 * middle
