"""FMUs of shipped stages are not larger than evidence/price/sizes.csv says, and that is within the aim of issue 28."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

import gearfmu
from gearfmu.fmu import export

TABLE = Path(__file__).resolve().parents[2] / "evidence" / "price" / "sizes.csv"
MARGIN = 1.02  # the binary differs from compiler to compiler
AIMS = {"fzg_c": 3.0, "helical_demo": 5.0, "two_stage": 8.0, "planetary54": 8.0, "helical_set": 8.0}  # MB


def rows() -> dict[str, dict[str, str]]:
    with TABLE.open(encoding="utf-8") as file:
        return {row["stage"]: row for row in csv.DictReader(file)}


QUICK = ("fzg_c", "helical_set")  # the least and the most tables of a stage


@pytest.mark.parametrize(
    "stage", [stage if stage in QUICK else pytest.param(stage, marks=pytest.mark.full) for stage in sorted(AIMS)]
)
def test_an_fmu_is_not_larger_than_its_row(stage: str, tmp_path: Path) -> None:
    row = rows()[stage]
    size = export(gearfmu.assemble(stage), tmp_path / "stage.fmu").stat().st_size / 1e6
    print(f"{stage}: {size:.2f} MB, row {row['fmu_mb']}, aim {AIMS[stage]}")
    assert size < MARGIN * float(row["fmu_mb"]), "larger than its row: mend it, or python -m evidence.price.sizes"
    assert size < AIMS[stage]
