"""The price list of a planetary set: its points, what they are measured against, its table."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pytest

from evidence.study.sets import SetRow, at_speed, ladder, with_planets
from gearfmu.report.study import write_chart
from gearfmu.scenefile.scene import load_scene
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.run import Job, study
from gearfmu.study.table import read_rows, write_rows

ROW = SetRow("s", 4, 85.0, "fast", 5e-6, 5, "", 248, "full, 0.312 µs", 0.02, -0.001, 0.07, 0.03, 35.0, 1.0)


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


def test_only_levels_and_steps_are_drawn(tmp_path: Path) -> None:
    against = "fast, 5 µs, 5 slices"
    changes = ({"planets": 3}, {"off": "coriolis", "against": against}, {"slices": 1, "against": against})
    others = [SetRow(**asdict(ROW) | change) for change in changes]
    finer = SetRow(**asdict(ROW) | {"h_s": 2.5e-6, "te_error": 0.01, "realtime_factor": 70.0})
    assert ladder([ROW, *others, finer], 4) == [ROW, finer]
    svg, _ = write_chart(ladder([ROW, finer], 4), 5, tmp_path / "set.svg")
    assert "fast" in svg.read_text(encoding="utf-8")
    write_rows(tmp_path / "sets.csv", SetRow, [ROW, finer])
    assert read_rows(tmp_path / "sets.csv", SetRow) == [ROW, finer]
