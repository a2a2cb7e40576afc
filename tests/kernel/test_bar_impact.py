"""Impact of coaxial bars: the exact wave solution against tabulated facts, closed-form modal data,
and the reference time step against both."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from exact_bars import Bar, impact
from reference_dg4 import Problem, Reference, Scheme

FACTS = json.loads((Path(__file__).parents[1] / "reference" / "bar_impact.json").read_text())
STEPS_PER_CELL = 5  # h = L/(5 n c) of the shorter bar: ω h = π/5 for its highest mode


@dataclass(frozen=True)
class Outcome:
    """intervals: (start, end) of contact in c t / L1 · v1, v2: velocities of the centres of mass · energy:
    relative drift."""

    intervals: list[tuple[float, float]]
    v1: float
    v2: float
    energy: float
    mu: float


@cache
def collide(bar1: Bar, bar2: Bar, n: int) -> Outcome:
    """Bar 1 hits bar 2 at rest with 1 m/s; n elastic modes of the shorter bar, the same cut frequency for the other."""
    shorter = min(bar1.length, bar2.length)
    n1, n2 = round(n * bar1.length / shorter), round(n * bar2.length / shorter)
    omega = np.concatenate([[0.0], bar1.frequencies(n1), [0.0], bar2.frequencies(n2)])
    rows = np.concatenate([-bar1.end_row(n1), bar2.end_row(n2)])[None, :]
    compliance = np.array([[bar1.residual(n1) + bar2.residual(n2)]])
    problem = Problem(omega, np.zeros(len(omega)), rows, compliance, np.array([1e-9]))
    reference = Reference(problem, Scheme(shorter / bar1.speed / (STEPS_PER_CELL * n)))
    v, none = np.zeros(len(omega)), np.zeros(len(omega))
    v[0] = np.sqrt(bar1.mass)
    state = reference.start(none, v, none)
    unit = bar1.length / bar1.speed / reference.scheme.h
    first, forces = reference.energy(state), [0.0]
    for _ in range(int(8 * max(bar1.length, bar2.length) / bar1.length * unit)):
        state = reference.step(state, none)
        forces.append(state.reported[0])
    change = np.diff((np.array(forces) > 0).astype(int))
    edges = zip(np.flatnonzero(change == 1), np.flatnonzero(change == -1), strict=True)
    intervals = [(float(a) / unit, float(b + 1) / unit) for a, b in edges]
    final = reference.velocity(state)
    return Outcome(
        intervals,
        final[0] / np.sqrt(bar1.mass),
        final[n1 + 1] / np.sqrt(bar2.mass),
        (reference.energy(state) - first) / first,
        reference.mu(),
    )


def lengths(case: str) -> tuple[int, int]:
    one, two = case.split(":")
    return int(one), int(two)


@pytest.mark.parametrize("case", FACTS)
def test_wave_solution_has_the_tabulated_facts(case: str) -> None:
    got, fact = impact(*lengths(case)), FACTS[case]
    assert got.force == fact["F_over_rhocAv"]
    assert got.force_end == pytest.approx(fact["force_end_ct_over_L1"], abs=1e-12)
    assert got.first_separation == pytest.approx(fact["first_sep_ct_over_L1"], abs=1e-12)
    assert (got.v1, got.v2, got.e) == pytest.approx((fact["v1"], fact["v2"], fact["e"]), abs=1e-12)


def test_modal_data_of_a_bar() -> None:
    bar = Bar(0.1)
    assert bar.speed == pytest.approx(5172.194153034851, rel=1e-14)
    x = (np.arange(2000) + 0.5) / 2000 * bar.length
    shapes = np.sqrt(2 / bar.mass) * np.cos(np.outer(np.arange(1, 7), np.pi * x / bar.length))
    shapes = np.vstack([np.full(len(x), 1 / np.sqrt(bar.mass)), shapes])
    np.testing.assert_allclose(shapes @ shapes.T * bar.mass / len(x), np.eye(7), atol=1e-12)
    np.testing.assert_allclose(bar.end_row(6)[1:], np.sqrt(2 / bar.mass))
    assert bar.residual(0) == pytest.approx(bar.length / (3 * bar.youngs_modulus * bar.area))
    summed = np.sum(2 / (bar.mass * bar.frequencies(200_000)[20:] ** 2))
    rest = 2 / (bar.mass * bar.frequencies(1)[0] ** 2) / 200_000  # Σ 1/k² beyond K is 1/K
    assert bar.residual(20) == pytest.approx(summed + rest, rel=1e-7)


@pytest.mark.parametrize("n", [5, 10, 20, pytest.param(40, marks=pytest.mark.full)])
@pytest.mark.parametrize("case", FACTS)
def test_reference_step_on_bars(case: str, n: int) -> None:
    one, two = lengths(case)
    exact, got = impact(one, two), collide(Bar(one / 1000), Bar(two / 1000), n)
    assert 1 <= len(got.intervals) <= 2
    assert got.v1 == pytest.approx(exact.v1, abs=0.02) and got.v2 == pytest.approx(exact.v2, abs=0.02)
    if n >= 20:
        assert got.intervals[-1][1] == pytest.approx(exact.force_end, rel=0.05)
    assert abs(got.energy) < 1e-12 and got.mu < 0.15


def test_error_of_the_impact_falls_with_the_number_of_modes() -> None:
    """Restitution error of equal bars, 1 − e, over n: the cut of the wave front; measured 7e-4, 5e-4, 3e-4, 2e-4."""
    errors = [1 - (out.v2 - out.v1) for out in (collide(Bar(0.1), Bar(0.1), n) for n in (5, 10, 20, 40))]
    assert all(later < earlier for earlier, later in zip(errors, errors[1:], strict=False))
    assert errors[-1] < 1e-3
