"""The two questions of docs/howto-plan.md, asked on the command line; a plan that a cluster makes."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearfmu import cli
from gearfmu.planning.book import Plan

BAND = ("--band", "500 Hz", "5 kHz")


def planned(folder: Path, monkeypatch: pytest.MonkeyPatch, *words: str) -> Plan:
    monkeypatch.setenv("GEARFMU_CACHE", str(folder))
    path = folder / "plan.toml"
    with pytest.raises(SystemExit) as ended:
        cli.main(["plan", *words, *BAND, "--out", str(path)])
    assert not ended.value.code
    return Plan.load(path)


def test_may_i_leave_the_coast_flank_out_under_load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = ("--output", "te", "--output", "bearing.pinion.fx", "--budget", "1 dB", "--may-drop", "coast_flank")
    (part,) = planned(tmp_path, monkeypatch, "pair_loaded", *asked).segments
    (line,) = [line for line in part.lines if line.effect == "coast_flank"]
    assert part.kept and line.verdict == "off" and line.error < 1e-6


@pytest.mark.full
def test_may_i_leave_the_coast_flank_out_where_the_clutch_is_dumped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = ("--step", "20 us", "--output", "te", "--output", "bearing.pinion.fx", "--budget", "1 dB")
    plan = planned(tmp_path, monkeypatch, "clutch_dump", *asked, "--may-drop", "coast_flank")
    verdicts = [line.verdict for part in plan.segments for line in part.lines if line.effect == "coast_flank"]
    assert verdicts[0] == verdicts[-1] == "on" and "off" in verdicts


def test_which_level_for_a_fifth_of_a_decibel_at_the_bearing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (part,) = planned(
        tmp_path, monkeypatch, "pair_loaded", "--output", "bearing.pinion.fx", "--budget", "0.2 dB"
    ).segments
    assert part.kept and part.choice.level == "fast" and part.choice.slices == 1
    assert {line.effect: line.verdict for line in part.lines}["step"] == "10 µs"
    assert part.error_default < 1.0 < part.price_default / part.price
