"""Golden runs: a refactoring leaves every bit of them where it was (golden.py shows what moved, and how far)."""

from __future__ import annotations

from pathlib import Path

import pytest
from golden import REALS, moved, results, stored
from golden_stages import ADOPTIONS, RUNS, STATICS
from probes import build, compilers

from gearfmu.kernel import library_path

FLAGS = ("-O1", "-O3")
LEFT = 0.05  # J, energy that no golden run leaves in 3 ms: a run beyond sense would be kept to the last bit unseen


def test_runs_have_not_moved_by_a_bit() -> None:
    assert not moved(stored("float"), results(library_path()))


@pytest.mark.full
def test_runs_in_double_have_not_moved_by_a_bit(double_library: Path) -> None:
    assert not moved(stored("double"), results(double_library))


@pytest.mark.parametrize("real", REALS)
def test_every_run_makes_sense(real: str) -> None:
    runs = stored(real)
    assert runs.keys() == RUNS.keys() | ADOPTIONS.keys() | STATICS.keys()
    assert not [name for name, run in runs.items() if abs(run.get("energy_left", 0.0)) > LEFT]


@pytest.mark.full
@pytest.mark.parametrize("flag", FLAGS)
@pytest.mark.parametrize("compiler", compilers())
@pytest.mark.parametrize("real", REALS)
def test_runs_of_every_build_have_not_moved_by_a_bit(real: str, compiler: str, flag: str, tmp_path: Path) -> None:
    assert not moved(stored(real), results(build(tmp_path, compilers()[compiler], (flag,), real=real)))
