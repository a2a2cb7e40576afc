"""Transfer matrices: two methods to the full model, ground held by constraint or by elimination, and the error norm."""

from __future__ import annotations

import numpy as np
import pytest
from small_body import direct, mounted, small

from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import Size
from gearfmu.reduction.oscillators import oscillators
from gearfmu.reduction.transfer import Judging, reference, relative_error, transfer

LINES = Judging.over(lines=30)


@pytest.mark.parametrize("body", [small(), small().grounded(), mounted()], ids=["free", "held", "mounted"])
def test_reference_on_moments_is_the_full_model_solved_line_by_line(body):
    full = reference(body, LINES)
    assert full.change < 1e-9
    for line in (0, 10, 20, 29):
        exact = direct(body, LINES.frequency[line], LINES.damping_ratio)
        assert np.linalg.norm(full.matrix[line] - exact) < 1e-9 * np.linalg.norm(exact)


def test_ground_by_elimination_is_ground_by_constraint():
    free, held = small(), small().grounded()
    eliminated, constrained = reference(free, LINES), reference(held, LINES)
    assert eliminated.labels == constrained.labels
    assert relative_error(constrained.matrix, eliminated.matrix).max() < 1e-9


def test_static_residual_removes_the_static_error_of_modal_truncation():
    """Error falls as (f/f_n)² with the residual and stays with it left out."""
    body = small().grounded()
    lines = Judging(np.array([50.0, 100.0, 200.0]))
    full = reference(body, Judging.over((50.0, 400.0), 40))
    model = oscillators(body, METHODS["modal"](body, Size(30)), 0.01)
    exact = np.stack([direct(body, f, 0.01) for f in lines.frequency])
    plain = relative_error(exact, transfer(model, lines))
    mended = relative_error(exact, transfer(model, lines, residual=True))
    assert plain.min() > 1e-2 and full.change < 1e-9
    assert mended[2] / mended[1] == pytest.approx(4, rel=0.02) and mended[2] < 1e-4
