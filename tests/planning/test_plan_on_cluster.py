"""Trials of a plan on a dask cluster: the executor of `gearfmu sweep`."""

from __future__ import annotations

from pathlib import Path

import pytest

import gearfmu as gf

ASKED = (["te", "bearing.pinion.fx"], ("500 Hz", "5 kHz"), "1 dB")


@pytest.mark.full
@pytest.mark.needs("distributed")
def test_a_plan_made_on_a_dask_cluster_is_the_plan_made_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the address of the scheduler, as `gearfmu plan --scheduler` has it. Prices are timed, and choose among sets
    that keep the budget: the plans may differ there. What was measured is the same."""
    from distributed import LocalCluster

    monkeypatch.setenv("GEARFMU_CACHE", str(tmp_path))
    scene = gf.load_scene("pair_loaded", {"settle": "20 ms", "duration": "80 ms"})
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        there = gf.plan(scene, *ASKED, on=cluster.scheduler_address, fresh=True)
    here = gf.plan(scene, *ASKED, fresh=True)
    for there_is, here_is in zip(there.segments, here.segments, strict=True):
        assert there_is.kept and here_is.kept
        assert (there_is.kind, there_is.window) == (here_is.kind, here_is.window)
        assert there_is.noise == pytest.approx(here_is.noise, rel=1e-3)
        assert there_is.error_default == pytest.approx(here_is.error_default, rel=1e-3)
        if there_is.choice == here_is.choice:
            assert there_is.error == pytest.approx(here_is.error, rel=1e-3)
            assert there_is.bound == pytest.approx(here_is.bound, rel=1e-3)
