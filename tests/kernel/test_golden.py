"""Golden runs: a refactoring leaves every bit of them where it was (golden.py shows what moved, and how far)."""

from __future__ import annotations

import pytest
from golden import REALS, moved, results, stored
from golden_stages import ADOPTIONS, RUNS, STATICS

from gearfmu.kernel import library_path

LEFT = 0.05  # J, energy that no golden run leaves in 3 ms: a run beyond sense would be kept to the last bit unseen


def test_runs_have_not_moved_by_a_bit() -> None:
    assert not moved(stored("float"), results(library_path()))


@pytest.mark.parametrize("real", REALS)
def test_every_run_makes_sense(real: str) -> None:
    runs = stored(real)
    assert runs.keys() == RUNS.keys() | ADOPTIONS.keys() | STATICS.keys()
    assert not [name for name, run in runs.items() if abs(run.get("energy_left", 0.0)) > LEFT]
