"""Scenes of the time-domain comparison (evidence/reduction/in_time): contact points, ranking of reductions, and
the kernel beside the finite elements."""

from __future__ import annotations

import importlib
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearfmu.body import reduce_bodies
from gearfmu.fem.coupling import rigid_modes
from gearfmu.femesh.mesh import rotated
from gearfmu.stagefile.forms.shapes import set_geometry
from gearfmu.stagefile.stage import load_stage

FOLDER = Path(__file__).resolve().parents[2] / "evidence" / "reduction" / "in_time"


def module(name: str) -> ModuleType:
    """A module of the comparison."""
    return importlib.import_module(f"evidence.reduction.in_time.{name}")


@pytest.fixture
def modules() -> SimpleNamespace:
    names = ("contact_points", "scenes", "ring_scene")
    return SimpleNamespace(**{name: module(name) for name in names})


@pytest.mark.parametrize("other", ["sun", "ring"])
def test_rows_of_contact_points_are_derivatives_of_their_gaps(other: str, modules: SimpleNamespace) -> None:
    """Rigid motion of either gear by 0.1 µm and 0.1 µm/r_b: the gaps' closed form moves as the rows say. Faces of a
    coarse mesh follow the involute to some 1e-3 of the normal's arm."""
    planet, against = placed(modules, other)
    grid = modules.contact_points.Grid(along=15, across=3, reach=0.2e-3)
    before = modules.contact_points.contact_points(planet, against, grid, {1: 0.0, -1: 0.0})
    assert len(before.gap) > 50 and set(before.side) == {1, -1}
    small, r_b = 1e-7, against.geometry.r_b
    for k, gear in enumerate((planet, against)):
        fields = rigid_modes(rotated(gear.sector.full().nodes, gear.angle))[:, [0, 1, 5]] / [1, 1, r_b]
        slopes = before.rows[k] @ fields
        for motion in np.eye(3):
            moved = replace(gear, centre=gear.centre + small * motion[:2], angle=gear.angle + small * motion[2] / r_b)
            pair = (moved, against) if k == 0 else (planet, moved)
            after = modules.contact_points.contact_points(*pair, grid, {1: 0.0, -1: 0.0})
            assert len(after.gap) == len(before.gap)
            assert np.allclose((after.gap - before.gap) / small, slopes @ motion, atol=5e-3)
    assert np.allclose(np.abs(slopes[:, 2]), 1.0, atol=5e-3), "a normal of the gear touches its base circle"


def placed(modules: SimpleNamespace, other: str) -> tuple[Any, Any]:
    """The planet of bolt 0, and the sun or the ring, on coarse meshes."""
    spec = load_stage("planetary54").written
    meshes, geometry = modules.scenes.Meshes(0.35, 0.17, 0.17), set_geometry(spec)
    centre = np.array([spec.set.center_distance, 0.0])
    planet = modules.scenes.placed_gear(spec.planet, geometry.sun_mesh.gears[1], centre, 0.0, meshes.gear)
    if other == "ring":
        return planet, modules.ring_scene.placed_ring(spec, meshes)
    angle = 0.0 if spec.planet.teeth % 2 else np.pi / spec.sun.teeth
    return planet, modules.scenes.placed_gear(spec.sun, geometry.sun_mesh.gears[0], np.zeros(2), angle, meshes.gear)


@pytest.mark.parametrize("other", ["sun", "ring"])
def test_backlash_is_shared_by_both_flanks(other: str, modules: SimpleNamespace) -> None:
    """The hammering scenes begin in the middle: the smallest gaps of both flanks are half of j_wt cos α_wt."""
    make = modules.scenes.hammering if other == "sun" else modules.ring_scene.ring_hammering
    scene = make(modules.scenes.Meshes(0.35, 0.17, 0.17))
    mesh = getattr(set_geometry(load_stage("planetary54").written), f"{other}_mesh")
    for side in (1, -1):
        least = scene.points.gap[scene.points.side == side].min()
        assert least == pytest.approx(mesh.normal_backlash / 2, rel=2e-3)
    area = scene.points.area.sum()
    assert 0 < area < 1e-3 and np.all(scene.points.area > 0)


@lru_cache
def scene_of(name: str) -> tuple[Any, dict[Any, Any]]:
    """A scene of the comparison and the bodies reduced for it so far."""
    study = module("compare").STUDIES[name]
    return study.make(study.meshes), {}


@lru_cache
def run_of(scene: str, carrier: str, gears: str) -> dict[str, np.ndarray]:
    """Channels of a scene whose bodies are reduced like this, or "whole"."""
    compare, (made_scene, made) = module("compare"), scene_of(scene)
    return compare.integrated(made_scene, compare.STUDIES[scene].scheme, compare.Run(carrier, gears), made)


def error_of(scene: str, carrier: str, gears: str, channel: str) -> float:
    """Error of a channel, over its rms, against the unreduced scene."""
    reference, found = run_of(scene, "whole", "whole"), run_of(scene, carrier, gears)
    (name,) = [name for name in reference if name.startswith(channel)]
    return float(module("channels").errors(reference[name], found[name])[0])


@pytest.mark.full
def test_reductions_of_the_carrier_rank_as_in_the_paper(modules: SimpleNamespace) -> None:
    """Krylov and Rubin agree with the finite elements; modal truncation errs a thousand times as much."""
    found = {
        name: error_of("carrier_planet", f"{name} 120", "rubin 60", "bolt deflection")
        for name in ("modal", "craig_bampton", "rubin", "krylov")
    }
    assert max(found["rubin"], found["krylov"]) < 1e-3 * found["modal"] and found["craig_bampton"] < 1e-3
    assert error_of("carrier_planet", "whole", "rubin 60", "bolt deflection") < 1e-8


@pytest.mark.full
def test_eigenmodes_of_gears_suffice_for_speeds_and_not_for_forces(modules: SimpleNamespace) -> None:
    """400 modes of a gear, as in the paper; with the static residual forces are right, too."""
    run = ("hammering", "krylov 120", "modal 400")
    paper = {channel: error_of(*run, channel) for channel in ("mesh force", "planet speed", "sun speed")}
    assert paper["planet speed"] < 0.02 and paper["sun speed"] < 0.05 and paper["mesh force"] > 0.1
    residual = error_of("hammering", "krylov 120", "modal 400 + residual", "mesh force")
    assert residual < 0.1 * paper["mesh force"]


@pytest.mark.full
def test_a_ring_reduced_by_its_teeth_ranks_as_in_the_paper_and_needs_its_residual(modules: SimpleNamespace) -> None:
    """Of 400 modes those of Rubin and MacNeal give the force best, as in the paper; the static residual at the points
    of contact gives it three times better."""
    names = ("modal 400", "craig_bampton 400", "rubin 400", "modal 400 + residual")
    modal, craig_bampton, rubin, residual = (error_of("ring_hammering", name, "whole", "mesh force") for name in names)
    assert rubin < min(modal, craig_bampton) and 3 * residual < rubin


@pytest.mark.full
def test_kernel_carries_the_impact_of_the_finite_elements(modules: SimpleNamespace, tmp_path: Path) -> None:
    """Level full against the stored force of the unreduced gears: peak within 5 %, impulse within 1 %."""
    kernel, tables = (
        module("kernel"),
        module("tables"),
    )
    reference = tables.read_columns(FOLDER / "curves_kernel.csv")["finite elements"]
    spec = load_stage(FOLDER / "pair" / "stage.toml")
    bodies = reduce_bodies(spec, tmp_path)
    parameters = {"level": kernel.FULL, "integrator": kernel.DG4, "h": kernel.SAMPLE}
    exact, found = (
        kernel.facts(reference, force) for force in (reference, kernel.kernel_force(spec, bodies, parameters))
    )
    print(exact, found)
    assert found["peak_N"] == pytest.approx(exact["peak_N"], rel=0.05)
    assert found["impulse_mNs"] == pytest.approx(exact["impulse_mNs"], rel=0.01)
