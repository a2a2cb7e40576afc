"""Scenes of the time-domain comparison (benchmarks/in_time): contact points, and what their tables say."""

from __future__ import annotations

import csv
import importlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gearfmu.fem.coupling import rigid_modes
from gearfmu.femesh.mesh import rotated
from gearfmu.geometry.planetary import PlanetaryGeometry
from gearfmu.spec.stage import load_stage

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "in_time"


@pytest.fixture
def modules(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    monkeypatch.syspath_prepend(str(FOLDER))
    names = ("contact_points", "scenes")
    return SimpleNamespace(**{name: importlib.import_module(name) for name in names})


def test_rows_of_contact_points_are_derivatives_of_their_gaps(modules: SimpleNamespace) -> None:
    """Rigid motion of either gear by 0.1 µm and 0.1 µm/r_b: the gaps' closed form moves as the rows say. Faces of a
    coarse mesh follow the involute to some 1e-3 of the normal's arm."""
    spec = load_stage("planetary54")
    geometry = PlanetaryGeometry.of(spec)
    sun = modules.scenes.placed_gear(spec.sun, geometry.sun_mesh.gears[0], np.zeros(2), geometry.sun_phase(), 0.17)
    planet = modules.scenes.placed_gear(spec.planet, geometry.sun_mesh.gears[1], geometry.planet_centre(0), 0.0, 0.17)
    grid = modules.contact_points.Grid(along=21, across=3, reach=0.2e-3)
    before = modules.contact_points.contact_points(planet, sun, grid, {1: 0.0, -1: 0.0})
    assert len(before.gap) > 50 and set(before.side) == {1, -1}
    small, r_b = 1e-7, sun.geometry.r_b
    for k, gear in enumerate((planet, sun)):
        fields = rigid_modes(rotated(gear.sector.full().nodes, gear.angle))[:, [0, 1, 5]] / [1, 1, r_b]
        slopes = before.rows[k] @ fields
        for motion in np.eye(3):
            moved = replace(gear, centre=gear.centre + small * motion[:2], angle=gear.angle + small * motion[2] / r_b)
            pair = (moved, sun) if k == 0 else (planet, moved)
            after = modules.contact_points.contact_points(*pair, grid, {1: 0.0, -1: 0.0})
            assert len(after.gap) == len(before.gap)
            assert np.allclose((after.gap - before.gap) / small, slopes @ motion, atol=5e-3)
    assert np.allclose(np.abs(slopes[:, 2]), 1.0, atol=5e-3), "a normal of the sun touches its base circle"


def test_backlash_is_shared_by_both_flanks(modules: SimpleNamespace) -> None:
    """The hammering scene begins in the middle: the smallest gaps of both flanks are half of j_wt cos α_wt."""
    scene = modules.scenes.hammering(modules.scenes.Meshes(0.35, 0.17))
    spec = load_stage("planetary54")
    mesh = PlanetaryGeometry.of(spec).sun_mesh
    for side in (1, -1):
        least = scene.points.gap[scene.points.side == side].min()
        assert least == pytest.approx(mesh.normal_backlash / 2, rel=2e-3)
    area = scene.points.area.sum()
    assert 0 < area < 1e-3 and np.all(scene.points.area > 0)


def rows(name: str) -> list[dict[str, str]]:
    with (FOLDER / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def error(scene: str, carrier: str, gears: str, channel: str) -> float:
    (row,) = [
        row
        for row in rows("errors.csv")
        if (row["scene"], row["carrier"], row["gears"], row["half_step"]) == (scene, carrier, gears, "False")
        and row["channel"].startswith(channel)
    ]
    return float(row["error"])


def test_tables_say_what_the_paper_says() -> None:
    """Carrier: Krylov and Rubin on the finite elements, modal truncation beside them. Gears: 400 eigenmodes are good
    for speeds and not for forces, unless the static residual is there."""
    found = {
        name: error("carrier_planet", f"{name} 120", "rubin 60", "bolt deflection")
        for name in ("modal", "craig_bampton", "rubin", "krylov")
    }
    assert max(found["rubin"], found["krylov"]) < 1e-3 * found["modal"] and found["craig_bampton"] < 1e-3
    assert error("carrier_planet", "whole", "rubin 60", "bolt deflection") < 1e-8
    paper = {c: error("hammering", "krylov 120", "modal 400", c) for c in ("mesh force", "planet speed", "sun speed")}
    assert paper["planet speed"] < 0.02 and paper["sun speed"] < 0.05 and paper["mesh force"] > 0.1
    assert error("hammering", "krylov 120", "modal 400 + residual", "mesh force") < 0.1 * paper["mesh force"]


def test_calculix_goes_the_same_way() -> None:
    """Both windows in CalculiX: every channel within 1e-4 of its rms (measured: its printed digits)."""
    found = rows("window.csv")
    assert {row["scene"] for row in found} == {"carrier_planet", "hammering"} and len(found) == 11
    assert all(float(row["largest"]) < 1e-4 for row in found), found


def test_kernel_carries_the_impact_of_the_finite_elements() -> None:
    """Level full: peak within 5 %, impulse within 1 % of the unreduced gears."""
    found = {row["model"]: (float(row["peak_N"]), float(row["impulse_mNs"])) for row in rows("kernel.csv")}
    assert found["kernel, level full"][0] == pytest.approx(found["finite elements"][0], rel=0.05)
    assert found["kernel, level full"][1] == pytest.approx(found["finite elements"][1], rel=0.01)
