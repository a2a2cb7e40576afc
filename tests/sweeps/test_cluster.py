"""Two hundred points on two workers, one of which is killed on the way: on a dask cluster and on this machine."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import gearfmu as gf

POINTS, KILL_AFTER = 200, 0.2
TORQUES = np.linspace(10.0, 600.0, POINTS)


def killing(pids: Callable[[], list[int]]) -> tuple[Callable[..., None], list[int]]:
    """A progress function that kills the first of the workers once a fifth of the points is there; and whom it
    killed."""
    killed: list[int] = []

    def progress(part: float, text: str = "") -> None:
        if part >= KILL_AFTER and not killed:
            killed.append(pids()[0])
            os.kill(killed[0], signal.SIGKILL)

    return progress, killed


def assert_nothing_is_lost(table: gf.SweepTable, folder: Path, killed: list[int]) -> None:
    """Every point is there once, with the number that the function for one point gives."""
    assert len(killed) == 1 and len(table) == POINTS and table.failures == []
    lines = (folder / "points.jsonl").read_text(encoding="utf-8").splitlines()
    assert len({json.loads(line)["identity"] for line in lines}) == len(lines) == POINTS
    assert np.all(np.diff(table["te_mean_um"]) > 0)
    some = [0, 57, 123, 199]
    alone = gf.te("fzg_c/stage_relief", TORQUES[some], 4)
    assert table["te_mean_um"][some] == pytest.approx(1e6 * alone.te.mean(axis=1), rel=1e-12)


@contextmanager
def cluster_of_two() -> Iterator[object]:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        yield cluster


@pytest.mark.full
@pytest.mark.needs("distributed")
def test_a_dask_cluster_loses_a_worker_and_no_point(tmp_path: Path) -> None:
    """By the address of the scheduler, as `gearfmu sweep --scheduler` has it."""
    with cluster_of_two() as cluster:
        progress, killed = killing(lambda: [worker.pid for worker in cluster.workers.values()])
        over = {"torque": TORQUES, "positions": 4}
        table = gf.sweep("fzg_c/stage_relief", over, tmp_path, on=cluster.scheduler_address, progress=progress)
        assert_nothing_is_lost(table, tmp_path, killed)


@pytest.mark.full
@pytest.mark.needs("psutil")
def test_this_machine_loses_a_worker_and_no_point(tmp_path: Path) -> None:
    import psutil

    def workers() -> list[int]:
        own = psutil.Process().children(recursive=True)
        return [child.pid for child in own if "gearfmu.sweeps.worker" in child.cmdline()]

    progress, killed = killing(workers)
    over = {"torque": TORQUES, "positions": 4}
    table = gf.sweep("fzg_c/stage_relief", over, tmp_path, on=2, progress=progress)
    assert_nothing_is_lost(table, tmp_path, killed)


@pytest.mark.full
@pytest.mark.needs("distributed")
def test_a_point_that_kills_its_workers_is_named_by_dask_too() -> None:
    from gearfmu.sweeps.runners import Lost, on_cluster

    with cluster_of_two() as cluster:
        found = dict(on_cluster(cluster)(eval, ["1 + 1", "__import__('os')._exit(3)"]))
    assert found[0] == 2 and isinstance(found[1], Lost) and "KilledWorker" in found[1].message
