"""Impact of coaxial bars: the exact wave solution against tabulated facts, modal data in closed form, and the kernel's
flat engagement against the exact impact."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from driven import stepped
from exact_bars import Bar, impact
from small_model import bars_blob

from gearfmu.kernel import Kernel

FACTS = json.loads((Path(__file__).parents[1] / "reference" / "bar_impact.json").read_text())
STEPS_PER_CELL = 5  # h = L/(5 n c) of the shorter bar: ω h = π/5 for its highest mode
CASES = [(100, 100), (100, 200), (100, 300), (200, 100)]  # mm


@pytest.mark.parametrize("case", FACTS)
def test_wave_solution_has_the_tabulated_facts(case: str) -> None:
    got, fact = impact(*map(int, case.split(":"))), FACTS[case]
    assert got.force == fact["F_over_rhocAv"]
    assert got.force_end == pytest.approx(fact["force_end_ct_over_L1"], abs=1e-12)
    assert got.first_separation == pytest.approx(fact["first_sep_ct_over_L1"], abs=1e-12)
    assert (got.v1, got.v2, got.e) == pytest.approx((fact["v1"], fact["v2"], fact["e"]), abs=1e-12)


@pytest.mark.parametrize("n", [5, 20, 40])
@pytest.mark.parametrize(("one", "two"), CASES)
def test_exact_impact(system_library: Path, one: int, two: int, n: int) -> None:
    """Bar 1 hits bar 2 with 1 m/s, n elastic modes of the shorter one: end of contact within 5 % for n ≥ 20, velocities
    within 2 % of the approach for n ≥ 5, one or two intervals of contact."""
    bars, exact, shorter = (Bar(one / 1000), Bar(two / 1000)), impact(one, two), min(one, two)
    h = shorter / 1000 / bars[0].speed / (STEPS_PER_CELL * n)
    blob = bars_blob(bars, (round(n * one / shorter), round(n * two / shorter)), gap=1e-9)
    parameters = {"left.w_start": 1.0, "h": h, "level": 3, "effect.hertz": 0}
    kernel = Kernel(blob, parameters, system_library)
    kernel.initialize()
    steps = int(6 * max(one, two) / shorter * STEPS_PER_CELL * n)
    force, mean = stepped(kernel, steps, h, "mesh.force", "mesh.force_mean").T
    assert kernel.get("solver.retried_steps") == 0
    impulse = mean.sum() * h
    assert 1 - impulse / bars[0].mass == pytest.approx(exact.v1, abs=0.02)
    assert impulse / bars[1].mass == pytest.approx(exact.v2, abs=0.02)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], force > 0, [0]]).astype(int)))
    assert len(edges) in (2, 4)
    if n >= 20:
        assert edges[-1] * h * bars[0].speed / bars[0].length == pytest.approx(exact.force_end, rel=0.05)
