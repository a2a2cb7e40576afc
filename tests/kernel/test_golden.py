"""Golden hashes: a refactoring leaves every bit of every run where it was (golden.py writes them anew)."""

from __future__ import annotations

from pathlib import Path

import pytest
from golden import REALS, all_digests, stored
from probes import build, compilers

FLAGS = ("-O1", "-O3")
VARIANTS = [
    pytest.param(real, compiler, flag, marks=[] if (compiler, flag) == ("gcc", "-O3") else [pytest.mark.full])
    for real in REALS
    for compiler in compilers()
    for flag in FLAGS
]


@pytest.mark.parametrize(("real", "compiler", "flag"), VARIANTS)
def test_runs_have_not_moved_by_a_bit(real: str, compiler: str, flag: str, tmp_path: Path) -> None:
    assert all_digests(build(tmp_path, compilers()[compiler], (flag,), real=real)) == stored()[real]
