"""The kernel's flat engagement on coaxial bars: step by step as the independent reference,
and the exact impact (double and product build)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from exact_bars import Bar, impact
from reference_dg4 import Problem, Reference, Scheme
from small_model import bar_bodies, bars_blob

from gearfmu.kernel import Kernel

STEPS_PER_CELL = 5
INTEGRATORS = {"dg4": 0, "em": 1}
GAMMA = {"dg4": 1.0, "em": 0.0}


@dataclass(frozen=True)
class Case:
    """Bars of length one and two (mm), n modes of the shorter, initial gap (m), local law's 2 (1 − ν²)/(πE) (1/Pa)."""

    one: int
    two: int
    n: int
    gap: float = 1e-9
    local: float = 1e-20

    @property
    def bars(self) -> tuple[Bar, Bar]:
        return Bar(self.one / 1000), Bar(self.two / 1000)

    @property
    def modes(self) -> tuple[int, int]:
        shorter = min(self.one, self.two)
        return round(self.n * self.one / shorter), round(self.n * self.two / shorter)

    @property
    def h(self) -> float:
        """ωh = π/5 for the highest mode."""
        return min(self.one, self.two) / 1000 / self.bars[0].speed / (STEPS_PER_CELL * self.n)

    @property
    def local_compliance(self) -> float:
        """Secant at 100 N (LOAD of evidence.study.flat) of the line contact law of both bars, m/N:
        Σ local [ln(4w/b) − 1]."""
        half_width = np.sqrt(2 * 2 * self.local * 100.0)
        return 2 * self.local * (np.log(4 * 1e-3 / half_width) - 1)

    @property
    def steps(self) -> int:
        return int(6 * max(self.one, self.two) / min(self.one, self.two) * STEPS_PER_CELL * self.n)


COMPARED = [Case(100, 100, 8, local=2.8e-12), Case(100, 300, 5, gap=2e-6, local=1e-12), Case(200, 100, 20, local=4e-12)]


def kernel_forces(case: Case, library: Path, integrator: str, output: str = "mesh.force") -> np.ndarray:
    """Contact force at the end of every internal step (or its mean); bar 1 starts with 1 m/s."""
    parameters = {
        "left.w_start": 1.0,
        "h": case.h,
        "integrator": INTEGRATORS[integrator],
        "level": 3,
        "effect.hertz": 0,
    }
    kernel = Kernel(bars_blob(case.bars, case.modes, case.gap, case.local), parameters, library)
    kernel.initialize()
    forces = np.empty(case.steps)
    for i in range(case.steps):
        kernel.step(i * case.h, case.h)
        forces[i] = kernel.get(output)
    assert kernel.get("solver.retried_steps") == 0
    return forces


def reference_forces(case: Case, integrator: str) -> np.ndarray:
    """The same from tests/kernel/reference_dg4.py."""
    (bar1, bar2), (n1, n2) = case.bars, case.modes
    bodies = bar_bodies(case.bars, case.modes)
    omega = np.concatenate([[0.0], bar1.frequencies(n1), [0.0], bar2.frequencies(n2)])
    elastic = [body.rows[0] for body in bodies]  # as a model stores them
    rows = np.concatenate([-bar1.end_row(n1)[:1], -elastic[0], bar2.end_row(n2)[:1], elastic[1]])
    compliance = sum(body.residual for body in bodies) + case.local_compliance
    problem = Problem(omega, np.zeros(len(omega)), rows[None, :], compliance, np.array([case.gap]))
    reference = Reference(problem, Scheme(case.h, GAMMA[integrator]))
    v, none = np.zeros(len(omega)), np.zeros(len(omega))
    v[0] = np.sqrt(bar1.mass)
    state, forces = reference.start(none, v, none), np.empty(case.steps)
    for i in range(case.steps):
        state = reference.step(state, none)
        forces[i] = state.sampled[0]
    return forces


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("case", COMPARED, ids=str)
def test_kernel_and_reference_step_by_step(double_library: Path, case: Case, integrator: str) -> None:
    got, expected = kernel_forces(case, double_library, integrator), reference_forces(case, integrator)
    assert np.array_equal(got > 0, expected > 0) and expected.max() > 100
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9 * expected.max())


@pytest.mark.parametrize("case", [Case(100, 100, 20), Case(100, 200, 10), Case(200, 100, 5)], ids=str)
def test_product_build_differs_by_single_precision_only(system_library: Path, case: Case) -> None:
    got, expected = kernel_forces(case, system_library, "dg4"), reference_forces(case, "dg4")
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-3 * expected.max())


@pytest.mark.parametrize("n", [5, 20, 40])
@pytest.mark.parametrize(("one", "two"), [(100, 100), (100, 200), (100, 300), (200, 100)])
def test_exact_impact(system_library: Path, one: int, two: int, n: int) -> None:
    """End of contact within 5 % for n ≥ 20, velocities within 2 % of the approach for n ≥ 5,
    one or two intervals of contact."""
    case, exact = Case(one, two, n), impact(one, two)
    force = kernel_forces(case, system_library, "dg4")
    bar1, bar2 = case.bars
    impulse = kernel_forces(case, system_library, "dg4", "mesh.force_mean").sum() * case.h
    assert 1 - impulse / bar1.mass == pytest.approx(exact.v1, abs=0.02)
    assert impulse / bar2.mass == pytest.approx(exact.v2, abs=0.02)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], force > 0, [0]]).astype(int)))
    assert len(edges) in (2, 4)
    if n >= 20:
        assert edges[-1] * case.h * bar1.speed / bar1.length == pytest.approx(exact.force_end, rel=0.05)
