"""The verb bearings and the function of the same name."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

import gearfmu as gf
from gearfmu import cli

STAGE = "helical_demo/stage_bearings"


def test_the_verb_prints_the_table_of_the_function(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "bearings.csv"
    assert cli.outcome(["bearings", STAGE, "--torque", "80 N*m", "--csv", str(table)]) == 0
    printed, found = capsys.readouterr().out, gf.bearings(STAGE, "80 N*m")
    for state in found.states:
        assert (
            f"{state.support}: bearing {state.bearing}" in printed and f"{state.loaded} of {state.elements}" in printed
        )
    assert "proposed      balls 10, ball_diameter 11.10 mm" in printed
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [row["support"] for row in rows] == ["pinion", "wheel"]
    for row, state in zip(rows, found.states, strict=True):
        assert float(row["load_z"]) == pytest.approx(state.load[2], rel=1e-5)
        assert float(row["pressure_MPa"]) == pytest.approx(1e-6 * state.pressure, rel=1e-5)


def test_the_torque_of_the_file_is_the_default() -> None:
    assert gf.bearings(STAGE).torque == 100.0


@pytest.mark.parametrize(("arguments", "says"), [
    (["bearings", "fzg_c"], "has no rolling bearings"),
    (["bearings", STAGE, "--torque", "80"], "N*m"),
])  # fmt: skip
def test_what_cannot_be_is_refused(arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.outcome(arguments) in (1, cli.USAGE_ERROR)
    assert says in capsys.readouterr().err
