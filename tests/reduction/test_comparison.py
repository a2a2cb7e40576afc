"""Methods side by side: each charged for all it uses, whoever came first; and where an expansion may lie."""

from __future__ import annotations

import numpy as np
import pytest
from small_body import small

from evidence.reduction.methods.comparison import Contest, compare
from gearfmu.errors import BodyError
from gearfmu.reduction.basis import Size
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.transfer import Judging

LINES = Judging.over(lines=12)


def test_a_method_is_charged_for_all_that_it_uses():
    """Modes that another method has just made too."""
    found = compare(small().grounded(), Contest((("modal", Size(40)), ("rubin", Size(40))), LINES))
    modal, rubin = found.trials
    assert rubin.seconds > 0.5 * modal.seconds > 0 and found.seconds > rubin.seconds


def test_a_method_that_cannot_do_its_task_says_so():
    with pytest.raises(BodyError, match="Rubin's method needs one attachment mode"):
        compare(small().grounded(), Contest((("modal", Size(5)), ("rubin", Size(5))), LINES))


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
