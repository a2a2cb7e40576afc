"""Workers of this machine and of a dask cluster: results of all arguments, whoever dies on the way; two hundred points
on two workers, one of which is killed."""

from __future__ import annotations

import json
import math
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gearfmu as gf
from gearfmu.stage import Trace
from gearfmu.stage.run.trace import Channel
from gearfmu.sweeps import run
from gearfmu.sweeps.plan import plan
from gearfmu.sweeps.points import LOST, OK, Outcome, Task
from gearfmu.sweeps.run import JOURNAL, TRACES, Journal, sweep
from gearfmu.sweeps.runners import TRIES, Lost, on_cluster, on_this_machine
from gearfmu.sweeps.table import SweepTable

POINTS, KILL_AFTER = 200, 0.2
TORQUES = np.linspace(10.0, 600.0, POINTS)


def test_a_worker_that_dies_is_replaced_and_only_its_argument_is_tried_again(tmp_path: Path) -> None:
    """The second argument ends its worker the first time and is computed the second time; the third always ends it."""
    mark = tmp_path / "been_here"
    once = f"__import__('pathlib').Path({str(mark)!r})"
    arguments = [
        "20 + 22",
        f"1 if {once}.exists() else ({once}.touch(), __import__('os')._exit(9))",
        "__import__('os')._exit(7)",
        "print('noise on standard output') or 3",
    ]
    found = dict(on_this_machine(2)(eval, arguments))
    lost = found.pop(2)
    assert found == {0: 42, 1: 1, 3: 3} and mark.exists()
    assert isinstance(lost, Lost) and f"{TRIES} worker processes" in lost.message and "code 7" in lost.message


def test_workers_end_with_a_sweep_that_is_broken_off() -> None:
    results = on_this_machine(2)(eval, ["__import__('os').getpid()", *["__import__('time').sleep(60)"] * 3])
    _, pid = next(results)
    results.close()
    assert not Path(f"/proc/{pid}").exists()


@contextmanager
def cluster_of_two() -> Iterator[Any]:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        yield cluster


@pytest.mark.full
@pytest.mark.needs("distributed", "psutil")
@pytest.mark.parametrize("where", ["cluster", "machine"])
def test_a_worker_is_lost_and_no_point(where: str, tmp_path: Path) -> None:
    """Killed once a fifth of the points is there; on a cluster by the address of the scheduler, as `gearfmu sweep
    --scheduler` has it. Every point is there once, with the number that the function for one point gives."""
    import psutil

    killed: list[int] = []
    with cluster_of_two() if where == "cluster" else nullcontext() as cluster:

        def workers() -> list[int]:
            if cluster:
                return [worker.pid for worker in cluster.workers.values()]
            own = psutil.Process().children(recursive=True)
            return [child.pid for child in own if "gearfmu.sweeps.worker" in child.cmdline()]

        def progress(part: float, text: str = "") -> None:
            if part >= KILL_AFTER and not killed:
                killed.append(workers()[0])
                os.kill(killed[0], signal.SIGKILL)

        over, on = {"torque": TORQUES, "positions": 4}, cluster.scheduler_address if cluster else 2
        table = gf.sweep("fzg_c/stage_relief", over, tmp_path, on=on, progress=progress)
    assert len(killed) == 1 and len(table) == POINTS and table.failures == []
    lines = (tmp_path / "points.jsonl").read_text(encoding="utf-8").splitlines()
    assert len({json.loads(line)["identity"] for line in lines}) == len(lines) == POINTS
    assert np.all(np.diff(table["te_mean_um"]) > 0)
    some = [0, 57, 123, 199]
    alone = gf.te("fzg_c/stage_relief", TORQUES[some], 4)
    assert table["te_mean_um"][some] == pytest.approx(1e6 * alone.te.mean(axis=1), rel=1e-12)


@pytest.mark.full
@pytest.mark.needs("distributed")
def test_a_point_that_kills_its_workers_is_named_by_dask_too() -> None:
    with cluster_of_two() as cluster:
        found = dict(on_cluster(cluster)(eval, ["1 + 1", "__import__('os')._exit(3)"]))
    assert found[0] == 2 and isinstance(found[1], Lost) and "KilledWorker" in found[1].message


# ---- a sweep that goes on: which points are computed again; a runner of ours counts what it is asked for -------------
STAGE = "fzg_c/stage_relief"
ASKED = [50.0, 100.0, 150.0]


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
    table = sweep(plan(STAGE, {"torque": ASKED, "positions": 4} | (over or {})), out, runner, **options)
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
        assert asked == ASKED and table["twice"].tolist() == [-50.0, -100.0, -150.0]
    table, asked = swept(tmp_path)
    assert asked == [] and table["twice"].tolist() == [100.0, 200.0, 300.0]
    for other in ({"stage.gears.pinion.tip_relief.amount": "10 um"}, {"positions": 5}):
        assert swept(tmp_path, over=other)[1] == ASKED, "points of other numbers are others"


def test_points_without_the_trace_that_is_asked_for_are_computed_again(tmp_path: Path) -> None:
    """And only those: one of three traces was deleted."""
    with_trace = Trace(np.arange(3.0), {"x": Channel(np.arange(3.0))})

    def traced(torque: float) -> Outcome:
        return Outcome(OK, "", {"twice": 2 * torque}, trace=with_trace)

    swept(tmp_path)
    table, asked = swept(tmp_path, traced, traces=True)
    assert asked == ASKED and all(table["trace"])
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
