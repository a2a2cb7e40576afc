"""Free frequencies of gear, ring and carrier against CalculiX: the same mesh, and the mesh of the stage file.

The goldens come from CalculiX's own elements (C3D20) and eigensolver on all teeth (benchmarks/calculix/frequencies.py);
ours from one sector.
"""

from __future__ import annotations

import csv
import importlib
import json
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
TABLES = ROOT / "benchmarks" / "calculix"
GOLDEN = json.loads((ROOT / "tests" / "reference" / "calculix_fzg_c.json").read_text(encoding="utf-8"))["frequencies_Hz"]
PRINTED = 2e-6  # CalculiX prints seven digits; its own two frequencies of a pair differ by up to 7e-7


@pytest.fixture
def benchmark_module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(TABLES))
    return importlib.import_module("frequencies")


@pytest.mark.parametrize("name", [name for name in GOLDEN if name.endswith("_coarse")])
def test_the_same_mesh_has_the_same_frequencies(benchmark_module: ModuleType, name: str) -> None:
    ours, theirs = benchmark_module.ours(benchmark_module.CASES[name]), np.array(GOLDEN[name])
    print(f"{name}: {np.abs(ours / theirs - 1).max():.1e}")
    assert len(theirs) == 20 and np.allclose(ours, theirs, rtol=PRINTED)


@pytest.mark.full
@pytest.mark.parametrize("name", [name for name in GOLDEN if not name.endswith("_coarse")])
def test_finer_meshes(benchmark_module: ModuleType, name: str) -> None:
    assert np.allclose(benchmark_module.ours(benchmark_module.CASES[name]), np.array(GOLDEN[name]), rtol=PRINTED)


@pytest.mark.full
def test_the_shipped_pinion_lies_within_what_refinement_moves(benchmark_module: ModuleType) -> None:
    """The mesh of the stage file against CalculiX on 0.7 of its element counts: at most 0.3 %, and below it."""
    shipped = benchmark_module.ours(replace(benchmark_module.CASES["pinion"], scale=1.0))
    difference = shipped / np.array(GOLDEN["pinion"]) - 1
    print(f"{100 * difference.min():+.3f} … {100 * difference.max():+.3f} %")
    assert np.all((difference < 0) & (difference > -3e-3))


def test_goldens_are_those_of_the_table() -> None:
    with open(TABLES / "frequencies.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["case"] for row in rows} == set(GOLDEN) and len(rows) == 20 * len(GOLDEN)
    for row in rows:
        assert GOLDEN[row["case"]][int(row["mode"]) - 1] == float(row["frequency_Hz"])
