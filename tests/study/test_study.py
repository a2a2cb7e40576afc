"""The study itself on a few milliseconds of a scene: rows, resuming, staleness, price, chart."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace

import pytest

from evidence.study.sets import at_speed, with_planets
from gearfmu.kernel import Kernel
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stagefile.stage import load_stage
from gearfmu.study import bench
from gearfmu.study.bench import Point, Replay, measure, models_for, paired_price
from gearfmu.study.ladder import SLICES, STEPS, fitting, points
from gearfmu.study.run import Job, study
from gearfmu.study.table import ReferenceRow, Row, read_rows, write_rows
from gearfmu.sweeps.runners import on_this_machine

COLUMNS = (
    "scene,level,integrator,h_s,n_dyn,slices,te_error,te_mean_error,force_error,bearing_error,realtime_factor,cpu_ratio"
)
ROW = Row("s", "fast", "dg4", 5e-6, 51, 5, 0.02, -0.001, 0.07, 0.03, 0.5, 1.0)


@pytest.fixture(scope="module")
def scene() -> SceneSpec:
    """6 ms of the loaded pair."""
    return load_scene("pair_loaded").model_copy(update={"duration": 6e-3, "settle": 2e-3})


@pytest.fixture(scope="module")
def made(scene: SceneSpec, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tuple[Row, ...]]:
    out = tmp_path_factory.mktemp("study")
    return out, study(Job(scene, out, defaults=True)).rows


def test_every_level_once_and_modes_pay(made: tuple[Path, tuple[Row, ...]]) -> None:
    """At the default step what is left is the error of time, the same for every level that has the mesh's modes."""
    out, rows = made
    by_level = {row.level: row for row in rows}
    assert sorted(by_level) == ["fast", "full", "rigid", "standard"] and len(rows) == 4
    errors = {level: by_level[level].te_error for level in by_level}
    assert errors["rigid"] > 3 * errors["fast"] > 0, "measured: 27 times"
    assert [errors[level] / errors["full"] for level in ("fast", "standard")] == pytest.approx([1.0, 1.0], abs=0.1)
    assert by_level["rigid"].n_dyn == 4 < by_level["fast"].n_dyn < by_level["full"].n_dyn
    assert all(row.realtime_factor > 0 and row.slices == 5 for row in rows)
    assert 1.1 < by_level["full"].cpu_ratio / by_level["rigid"].cpu_ratio < 3.0, "sums over modes are tabulated"
    assert (out / "study.csv").read_text().splitlines()[0] == COLUMNS
    reference = read_rows(out / "references.csv", ReferenceRow)[0]
    assert reference.h_s < min(row.h_s for row in rows) / 3 and reference.n_dyn > by_level["full"].n_dyn


def test_a_study_goes_on_where_it_stopped(made: tuple[Path, tuple[Row, ...]], scene: SceneSpec) -> None:
    """Kept rows keep their times, which no second measurement would repeat; the missing one has the same errors."""
    out, rows = made
    write_rows(out / "study.csv", Row, [row for row in rows if row.level != "rigid"])
    again = study(Job(scene, out, defaults=True)).rows
    for before, after in zip(rows, again, strict=True):
        same = before.realtime_factor == pytest.approx(after.realtime_factor, rel=1e-5)
        assert same == (before.level != "rigid")
        assert after.te_error == pytest.approx(before.te_error, rel=1e-5)


def test_rows_of_another_kernel_are_measured_anew(scene: SceneSpec, tmp_path: Path) -> None:
    """In two processes."""
    other = Row(scene.name, "rigid", "dg4", fitting(20e-6, 7.5e-6), 0, 5, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0)
    write_rows(tmp_path / "study.csv", Row, [other, ROW])
    (tmp_path / "study.json").write_text(json.dumps({scene.name: {"identity": "of before"}}))
    short = scene.model_copy(update={"duration": 3e-3, "settle": 1e-3})
    rows = study(Job(short, tmp_path, defaults=True, runner=on_this_machine(2))).rows
    assert len(rows) == 4 and all(row.te_error < 1.0 for row in rows)
    assert ROW in read_rows(tmp_path / "study.csv", Row), "rows of other scenes stay"


def test_a_replay_is_the_run(scene: SceneSpec) -> None:
    """What is timed is what was measured: the replay ends in the state of the run."""
    model = models_for(scene)
    run = measure(scene, model, Point("fast", h=5e-6))
    replay = Replay(run.recording)
    steps = replay.left
    replay.chunk(steps)
    assert steps == round((scene.duration - scene.settle) / scene.coupling.step) and replay.left == 0
    assert replay.kernel.get("mesh.te") == run.signals.te[-1]


def test_a_train_is_measured_by_all_its_meshes_and_bearings() -> None:
    scene = load_scene("clutch_closure_train").model_copy(update={"duration": 0.4e-3})
    run = measure(scene, models_for(scene), Point("rigid", slices=1))
    samples = len(run.signals.te)
    assert run.signals.te.shape == run.signals.force.shape == (samples, 2), "stage1, stage2"
    assert run.signals.bearing.shape == (samples, 12), "x and y of six bearings, without seats of gears on shafts"
    assert run.signals.locked is not None and not run.signals.locked.any()


def test_half_the_step_costs_twice_by_a_clock_that_counts_steps(
    scene: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step takes a microsecond, a call as much: the price is per simulated second, without the calls."""
    made, real = [0.0], Kernel.try_step

    def counted(kernel: Kernel, time: float, step: float) -> int:
        made[0] += 1.0 + (0.0 if math.isnan(step) else step / kernel.get("solver.h"))
        return real(kernel, time, step)

    model = models_for(scene)
    whole, half = (measure(scene, model, Point("fast", h=h)) for h in (5e-6, 2.5e-6))
    monkeypatch.setattr(Kernel, "try_step", counted)
    monkeypatch.setattr(bench, "clock", SimpleNamespace(thread_time=lambda: 1e-6 * made[0]))
    price = paired_price(half, whole, looked_at=1e-3)
    assert (price.cpu_ratio, price.realtime_factor) == pytest.approx((2.0, 0.4))


def test_points_cover_levels_steps_slices_and_the_papers_way() -> None:
    found = points(load_scene("pair_loaded"))
    assert {p.level for p in found} == {"rigid", "fast", "standard", "full", "paper"}
    assert {p.slices for p in found} == set(SLICES) and ("full", "rk45") in {(p.level, p.integrator) for p in found}
    assert all(20e-6 / p.h == pytest.approx(round(20e-6 / p.h)) for p in found if p.h)
    assert min(p.h for p in found if p.h) == pytest.approx(min(STEPS))
    assert not [p for p in points(load_scene("clutch_closure")) if p.integrator == "rk45"]


# ---- sets ------------------------------------------------------------------------------------------------------------
@pytest.mark.full
def test_a_set_is_studied_like_a_pair(tmp_path: Path) -> None:
    """`gearfmu study` of a set: levels at their default steps, kept; forces of all meshes are read back with it."""
    scene = load_scene("planetary_paper").model_copy(update={"duration": 1e-3, "settle": 0.4e-3})
    rows = study(Job(scene, tmp_path, defaults=True)).rows
    by_level = {row.level: row for row in rows}
    assert sorted(by_level) == ["fast", "full", "rigid", "standard"]
    assert by_level["rigid"].force_error > by_level["fast"].force_error > 0
    for row, again in zip(rows, study(Job(scene, tmp_path, defaults=True)).rows, strict=True):
        assert (again.level, again.n_dyn, again.slices) == (row.level, row.n_dyn, row.slices)
        numbers = [(r.h_s, r.te_error, r.force_error, r.realtime_factor) for r in (again, row)]
        assert numbers[0] == pytest.approx(numbers[1], rel=1e-5), "kept in six digits, prices too"


def test_another_speed_keeps_the_loads_in_balance() -> None:
    """What brakes in proportion to its speed has the same torque at the start."""
    scene = at_speed(load_scene("planetary_paper"), 300.0)
    assert scene.start.pinion_speed == 300.0 and scene.shaft_loads is not None
    brake = scene.shaft_loads["sun"].proportional
    assert brake is not None and brake.slope * 4 * 300.0 == pytest.approx(-150.0)
    assert scene.shaft_loads["carrier"].constant == 600.0


@pytest.mark.parametrize(("planets", "places"), [(3, None), (5, (0, 14, 29, 43, 58))])
def test_planets_stand_as_evenly_as_teeth_allow(planets: int, places: tuple[int, ...] | None) -> None:
    spec = load_stage("planetary54")
    changed = with_planets(spec, planets)
    assert (changed.written.set.planets, changed.written.set.positions) == (planets, places)
    assert changed.written.carrier.mesh.scale < spec.written.carrier.mesh.scale
