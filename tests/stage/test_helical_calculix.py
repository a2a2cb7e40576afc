"""The helical pair beside an independent finite-element program: the table of benchmarks/calculix/helical.py."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

TABLE = Path(__file__).parents[2] / "benchmarks" / "calculix" / "helical.csv"
LAYERS = 5


@pytest.fixture(scope="module")
def rows() -> list[dict[str, str]]:
    with open(TABLE, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_mean_transmission_error_within_four_per_cent(rows: list[dict[str, str]]) -> None:
    loads = sorted({(row["case"], row["torque_Nm"]) for row in rows})
    assert {"parallel", "tilted"} == {case for case, _ in loads}
    for load in loads:
        here = [row for row in rows if (row["case"], row["torque_Nm"]) == load]
        theirs, ours = (np.mean([float(row[name]) for row in here]) for name in ("te_um", "gearfmu_te_um"))
        print(f"{load}, {len(here)} positions: {theirs:.3f} and {ours:.3f} µm")
        assert ours == pytest.approx(theirs, rel=0.04)


def test_load_over_the_width_within_five_per_cent_of_the_largest(rows: list[dict[str, str]]) -> None:
    """Where all lines of contact cross the whole width. Where the line ends at the pinion's tip edge on the way, within
    8 %; at the wheel's tip edge, position 0, CalculiX needs finer layers (next test)."""
    for row in rows:
        share = np.array([[float(row[f"{who}share_{k + 1}"]) for k in range(LAYERS)] for who in ("", "gearfmu_")])
        off = np.abs(share[1] - share[0]).max() / share[0].max()
        print(row["case"], row["torque_Nm"], row["position"], f"{100 * off:.1f} %")
        assert off < {0.0: 0.3, 0.25: 0.03, 0.5: 0.08, 0.75: 0.09}[float(row["position"])]


def test_load_over_the_width_where_lines_end_and_layers_are_fine() -> None:
    """Elements of 0.6 mm there instead of 2.4 mm bring CalculiX's shares up to 0.2 of the largest nearer to ours."""
    with open(TABLE.with_stem("helical_fine"), newline="", encoding="utf-8") as file:
        fine = list(csv.DictReader(file))
    assert {(row["torque_Nm"], row["position"]) for row in fine} >= {("40", "0.000000"), ("110", "0.500000")}
    for row in fine:
        share = np.array([[float(row[f"{who}share_{k + 1}"]) for k in range(LAYERS)] for who in ("", "gearfmu_")])
        off = np.abs(share[1] - share[0]).max() / share[0].max()
        te = float(row["gearfmu_te_um"]) / float(row["te_um"]) - 1
        print(row["torque_Nm"], row["position"], f"{100 * off:.1f} %, te {100 * te:.2f} %")
        assert off < 0.12 and abs(te) < 0.02
