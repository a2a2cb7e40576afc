"""What is off costs nothing: at most 5 % more instructions than a kernel compiled without it, and the same bits."""

from __future__ import annotations

import importlib
import math
import shutil
from pathlib import Path
from types import ModuleType

import pytest

from gearfmu.stage.effects import EFFECTS, costs

MOST = 0.05


def test_every_effect_has_its_measured_cost() -> None:
    """The table in the package, which the documentation shows."""
    found = costs()
    assert list(found) == [effect.name for effect in EFFECTS]
    for cost in found.values():
        assert math.isfinite(cost.share) and -MOST < cost.price_of_off <= MOST, cost


@pytest.fixture(scope="module")
def benchmark_() -> ModuleType:
    """evidence/price/effects_cost.py as a module."""
    return importlib.import_module("evidence.price.effects_cost")


@pytest.mark.full
@pytest.mark.skipif(not (shutil.which("valgrind") and shutil.which("cc")), reason="needs valgrind and a C compiler")
def test_off_costs_as_much_as_not_being_there(benchmark_: ModuleType, tmp_path: Path) -> None:
    """Those of sets are left to the benchmark, which says the same: a set takes minutes under valgrind to begin."""
    bench = benchmark_.Bench(tmp_path)
    for effect in (one for one in EFFECTS if not one.carried):
        cost, same = bench.measure(effect)
        print(f"{effect.name}: {cost.off:.0f} instructions a step off, {cost.without:.0f} in a kernel without it")
        assert same, f"{effect.name}: off is not the same as not being there"
        assert abs(cost.price_of_off) <= MOST, effect.name
