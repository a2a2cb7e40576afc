"""Scenes of the time-domain comparison (evidence/reduction/in_time): contact points, ranks of the reductions, the
kernel beside the finite elements."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evidence.reduction.in_time import kernel, ring_scene, scenes, tables
from evidence.reduction.in_time.contact_points import Grid, contact_points
from gearfmu.body import reduce_bodies
from gearfmu.fem.coupling import rigid_modes
from gearfmu.femesh.mesh import rotated
from gearfmu.stagefile.forms.shapes import set_geometry
from gearfmu.stagefile.stage import load_stage

FOLDER = Path(__file__).resolve().parents[2] / "evidence" / "reduction" / "in_time"


@pytest.mark.parametrize("other", ["sun", "ring"])
def test_rows_of_contact_points_are_derivatives_of_their_gaps(other: str) -> None:
    """Rigid motion of either gear by 0.1 µm and 0.1 µm/r_b: the gaps' closed form moves as the rows say. Faces of a
    coarse mesh follow the involute to some 1e-3 of the normal's arm."""
    planet, against = placed(other)
    grid = Grid(along=15, across=3, reach=0.2e-3)
    before = contact_points(planet, against, grid, {1: 0.0, -1: 0.0})
    assert len(before.gap) > 50 and set(before.side) == {1, -1}
    small, r_b = 1e-7, against.geometry.r_b
    for k, gear in enumerate((planet, against)):
        fields = rigid_modes(rotated(gear.sector.full().nodes, gear.angle))[:, [0, 1, 5]] / [1, 1, r_b]
        slopes = before.rows[k] @ fields
        for motion in np.eye(3):
            moved = replace(gear, centre=gear.centre + small * motion[:2], angle=gear.angle + small * motion[2] / r_b)
            pair = (moved, against) if k == 0 else (planet, moved)
            after = contact_points(*pair, grid, {1: 0.0, -1: 0.0})
            assert len(after.gap) == len(before.gap)
            assert np.allclose((after.gap - before.gap) / small, slopes @ motion, atol=5e-3)
    assert np.allclose(np.abs(slopes[:, 2]), 1.0, atol=5e-3), "a normal of the gear touches its base circle"


def placed(other: str) -> tuple[Any, Any]:
    """The planet of bolt 0, and the sun or the ring, on coarse meshes."""
    spec = load_stage("planetary54").written
    meshes, geometry = scenes.Meshes(0.35, 0.17, 0.17), set_geometry(spec)
    centre = np.array([spec.set.center_distance, 0.0])
    planet = scenes.placed_gear(spec.planet, geometry.sun_mesh.gears[1], centre, 0.0, meshes.gear)
    if other == "ring":
        return planet, ring_scene.placed_ring(spec, meshes)
    angle = 0.0 if spec.planet.teeth % 2 else np.pi / spec.sun.teeth
    return planet, scenes.placed_gear(spec.sun, geometry.sun_mesh.gears[0], np.zeros(2), angle, meshes.gear)


@pytest.mark.full
def test_kernel_carries_the_impact_of_the_finite_elements(tmp_path: Path) -> None:
    """Level full against the stored force of the unreduced gears: peak within 5 %, impulse within 1 %."""
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
