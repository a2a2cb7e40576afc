"""Golden hashes: a refactoring leaves every bit of every run where it was (golden.py writes them anew)."""

from __future__ import annotations

from pathlib import Path

import pytest
from golden import REALS, all_digests, stored
from probes import build, compilers

from gearfmu.kernel import library_path

FLAGS = ("-O1", "-O3")


def test_runs_have_not_moved_by_a_bit() -> None:
    assert all_digests(library_path()) == stored()["float"]


def test_runs_in_double_have_not_moved_by_a_bit(double_library: Path) -> None:
    assert all_digests(double_library) == stored()["double"]


@pytest.mark.full
@pytest.mark.parametrize("flag", FLAGS)
@pytest.mark.parametrize("compiler", compilers())
@pytest.mark.parametrize("real", REALS)
def test_runs_of_every_build_have_not_moved_by_a_bit(real: str, compiler: str, flag: str, tmp_path: Path) -> None:
    assert all_digests(build(tmp_path, compilers()[compiler], (flag,), real=real)) == stored()[real]
