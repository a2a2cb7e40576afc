"""Bodies reduced at parameter values and interpolated: exact at the samples, convergent between them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from small_body import ring_body, web_body

from evidence.reduction.methods import METHODS
from evidence.reduction.methods.interpolation import Sample, interpolate
from gearfmu.errors import BodyError
from gearfmu.reduction.basis import Size
from gearfmu.reduction.oscillators import oscillators
from gearfmu.reduction.transfer import Judging, relative_error, transfer

LINES = Judging.over((500.0, 9e3), 25)
COUNT = 36


@lru_cache(maxsize=16)
def sample(outer: float, count: int = COUNT) -> Sample:
    body = ring_body(outer=outer)
    return Sample(outer, body, METHODS["rubin"](body, Size(count)))


@lru_cache(maxsize=32)
def web(thickness: float, method: str, count: int) -> Sample:
    body = web_body(thickness)
    return Sample(thickness, body, METHODS[method](body, Size(count)))


def error(parametric, value: float, made=sample) -> float:
    """Largest error against the body reduced at that very value."""
    own = made(value)
    exact = transfer(oscillators(own.body, own.basis, 0.01), LINES, own.body.ground)
    return float(relative_error(exact, transfer(parametric.at(value), LINES, own.body.ground)).max())


def test_samples_are_met_exactly():
    parametric = interpolate([sample(r) for r in (0.050, 0.047, 0.053)], 0.01)
    assert max(error(parametric, r) for r in (0.047, 0.050, 0.053)) < 1e-8


def test_between_samples_the_error_falls_with_their_number():
    middle = 0.0488
    errors = []
    for count in (2, 3, 5):
        errors.append(error(interpolate([sample(r) for r in np.linspace(0.047, 0.053, count)], 0.01), middle))
    assert errors[2] < 1e-2 * errors[1] and errors[1] < 0.2 * errors[0] and errors[2] < 1e-4


@pytest.mark.parametrize(("method", "count"), [("krylov", 36), ("modal", 36), ("rubin", 38)])
def test_the_thickness_of_a_web_converges_between_4_and_6_mm(method: str, count: int):
    """The paper's own example. A web's bending stiffness follows its thickness cubed, so that two wheels err by a
    tenth, three by half a percent."""

    def made(value: float) -> Sample:
        return web(value, method, count)

    errors = []
    for number in (2, 3, 5):
        wheels = interpolate([made(t) for t in np.linspace(0.004, 0.006, number)], 0.01)
        assert max(error(wheels, t, made) for t in (0.004, 0.006)) < 1e-8
        errors.append(error(wheels, 0.0046, made))
    assert errors[0] < 0.2 and errors[1] < 0.1 * errors[0] and errors[2] < 0.02 * errors[1], errors


def test_modes_that_change_places_at_the_cut_are_refused():
    """18 free modes end where in-plane and bending modes of the wheel cross between 4 and 6 mm."""
    with pytest.raises(BodyError, match="too different spaces"):
        interpolate([web(t, "rubin", 36) for t in (0.004, 0.006)], 0.01)


def test_what_cannot_be_interpolated_is_refused():
    with pytest.raises(BodyError, match="two samples or more"):
        interpolate([sample(0.05)], 0.01)
    with pytest.raises(BodyError, match="same parameter value"):
        interpolate([sample(0.05), sample(0.05)], 0.01)
    other = ring_body((2, 10, 1))
    with pytest.raises(BodyError, match="one topology"):
        interpolate([sample(0.05), Sample(0.06, other, METHODS["rubin"](other, Size(COUNT)))], 0.01)
    with pytest.raises(BodyError, match="reduce to one number"):
        interpolate([sample(0.05), sample(0.053, COUNT + 4)], 0.01)
    with pytest.raises(BodyError, match="too different spaces"):  # 42 modes end inside a pair
        interpolate([sample(r, 42) for r in np.linspace(0.047, 0.053, 5)], 0.01)
    with pytest.raises(BodyError, match="outside the samples"):
        interpolate([sample(0.05), sample(0.053)], 0.01).at(0.06)
