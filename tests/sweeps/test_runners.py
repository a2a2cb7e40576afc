"""Workers of this machine and of a dask cluster: results of all arguments, whoever dies on the way; two hundred points
on two workers, one of which is killed."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gearfmu as gf
from gearfmu.sweeps.runners import TRIES, Lost, on_cluster, on_this_machine

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
