"""A sweep that goes on: which points are computed again, and which are taken as they were written. No kernel runs: a
runner of ours counts what it is asked for."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfmu.stage import Trace
from gearfmu.stage.run.trace import Channel
from gearfmu.sweeps import run
from gearfmu.sweeps.plan import plan
from gearfmu.sweeps.points import LOST, OK, Outcome, Task
from gearfmu.sweeps.run import JOURNAL, TRACES, Journal, sweep
from gearfmu.sweeps.runners import Lost
from gearfmu.sweeps.table import SweepTable

STAGE = "fzg_c/stage_relief"
TORQUES = [50.0, 100.0, 150.0]


class Runner:
    """Answers points by `becomes`, in the order asked; asked: torques of all points so far."""

    def __init__(self, becomes: Callable[[float], Any]) -> None:
        self.becomes, self.asked = becomes, list[float]()

    def __call__(self, function: Any, tasks: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        for number, task in enumerate(tasks):
            assert isinstance(task, Task), "the bodies are there"
            self.asked.append(task.values["torque"])
            yield number, self.becomes(task.values["torque"])


def good(torque: float) -> Outcome:
    return Outcome(OK, "", {"twice": 2 * torque})


def swept(
    out: Path, becomes: Callable[[float], Any] = good, over: dict[str, Any] | None = None, **options: Any
) -> tuple[SweepTable, list[float]]:
    """The table, and the torques that were computed for it."""
    runner = Runner(becomes)
    table = sweep(plan(STAGE, {"torque": TORQUES, "positions": 4} | (over or {})), out, runner, **options)
    return table, runner.asked


@pytest.mark.parametrize("bad", [Outcome("divergence", "teeth overlap"), Lost("the worker died")])
def test_points_that_failed_are_computed_again(tmp_path: Path, bad: Any) -> None:
    """Red where whatever the journal has is taken for known: a worker that was lost would be lost for ever."""
    table, _ = swept(tmp_path, lambda torque: bad if torque == 100.0 else good(torque))
    assert table["outcome"].tolist() == [OK, LOST if isinstance(bad, Lost) else bad.name, OK]
    assert math.isnan(table["twice"][1]) and table["message"][1] == bad.message
    healed, asked = swept(tmp_path)
    assert asked == [100.0] and healed["outcome"].tolist() == [OK] * 3 and healed["twice"][1] == 200.0


@pytest.mark.parametrize(
    "changed",
    [("program", lambda: "another version"), ("FORMAT", run.FORMAT + 1)],
    ids=["program", "format"],
)
def test_points_of_another_program_are_computed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: tuple[str, Any]
) -> None:
    """Red where the fingerprint of a point leaves out the version of package and kernel. Back at the former version its
    points are known again."""
    swept(tmp_path)
    name, value = changed
    with monkeypatch.context() as patch:
        patch.setattr(run, name, value)
        table, asked = swept(tmp_path, lambda torque: Outcome(OK, "", {"twice": -torque}))
        assert asked == TORQUES and table["twice"].tolist() == [-50.0, -100.0, -150.0]
    table, asked = swept(tmp_path)
    assert asked == [] and table["twice"].tolist() == [100.0, 200.0, 300.0]
    for other in ({"stage.gears.pinion.tip_relief.amount": "10 um"}, {"positions": 5}):
        assert swept(tmp_path, over=other)[1] == TORQUES, "points of other numbers are others"


def test_points_without_the_trace_that_is_asked_for_are_computed_again(tmp_path: Path) -> None:
    """And only those: one of three traces was deleted."""
    with_trace = Trace(np.arange(3.0), {"x": Channel(np.arange(3.0))})

    def traced(torque: float) -> Outcome:
        return Outcome(OK, "", {"twice": 2 * torque}, trace=with_trace)

    swept(tmp_path)
    table, asked = swept(tmp_path, traced, traces=True)
    assert asked == TORQUES and all(table["trace"])
    (tmp_path / table["trace"][1]).unlink()
    table, asked = swept(tmp_path, traced, traces=True)
    assert asked == [100.0] and len(list((tmp_path / TRACES).iterdir())) == 3
    assert swept(tmp_path, traced)[1] == []


def test_numbers_that_are_none_come_back_as_nan(tmp_path: Path) -> None:
    """In rows and in curves; the file is strict JSON."""
    row, curve = {"a": 1.0, "b": math.nan}, {"position": [0.0, 0.5], "te_um": [math.nan, 3.0]}
    outcome = Outcome(OK, "", row, curve)
    table, _ = swept(tmp_path, lambda torque: outcome)
    text = (tmp_path / JOURNAL).read_text(encoding="utf-8")
    for line in text.splitlines():
        json.loads(line, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    known = Journal(tmp_path / JOURNAL).get(json.loads(line)["identity"])
    assert known is not None and math.isnan(known.row["b"])
    assert np.array_equal(known.curve["te_um"], curve["te_um"], equal_nan=True), "null is no number"
    again, asked = swept(tmp_path)
    assert asked == []
    for found in (table, again):
        assert found["a"].tolist() == [1.0] * 3 and np.isnan(found["b"]).all()
        assert np.isnan(found.curves["te_um"][::2]).all() and found.curves["te_um"][1::2].tolist() == [3.0] * 3
        assert found.curves["point"].tolist() == [0, 0, 1, 1, 2, 2]


def test_the_last_line_of_a_point_counts_and_broken_lines_do_not(tmp_path: Path) -> None:
    """What a killed process, an editor and another program leave."""
    path = tmp_path / JOURNAL
    path.write_text('[1, 2]\n{"identity": "a", "name": "ok"}\n{"identity": "b"\n', encoding="utf-8")
    journal = Journal(path)
    assert journal.get("a") is None and journal.get("b") is None
    journal.add("a", Outcome("failed", "first"))
    journal.add("a", Outcome(OK, "then"))
    assert Journal(path).get("a") == journal.get("a") == Outcome(OK, "then")
