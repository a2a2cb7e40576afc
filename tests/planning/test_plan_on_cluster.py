"""Trials of a plan on a dask cluster: the executor of `gearfmu sweep`."""

from __future__ import annotations

from pathlib import Path

import pytest

import gearfmu as gf
from gearfmu.planning.book import Plan

ASKED = (["te", "bearing.pinion.fx"], ("500 Hz", "5 kHz"), "1 dB")


@pytest.mark.full
@pytest.mark.needs("distributed")
def test_a_plan_made_on_a_dask_cluster_is_the_plan_made_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the address of the scheduler, as `gearfmu plan --scheduler` has it. Prices are timed, errors are not."""
    from distributed import LocalCluster

    monkeypatch.setenv("GEARFMU_CACHE", str(tmp_path))
    scene = gf.load_scene("pair_loaded", {"settle": "20 ms", "duration": "80 ms"})
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        there = gf.plan(scene, *ASKED, on=cluster.scheduler_address, fresh=True)
    here = gf.plan(scene, *ASKED, fresh=True)
    assert _decided(there) == _decided(here) and there.segments[0].kept


def _decided(plan: Plan) -> list[tuple[object, ...]]:
    return [(s.choice, s.bound, s.error, [(i.effect, i.verdict) for i in s.lines]) for s in plan.segments]
