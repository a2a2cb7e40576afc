"""Scenes of the time-domain comparison (evidence/reduction/in_time): contact points, ranks of the reductions, the
kernel beside finite elements."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evidence.energy.free import Rattle, free_pair, started
from evidence.reduction.in_time import scenes
from evidence.reduction.in_time.contact_points import Grid, contact_points
from gearfmu.body import reduce_bodies
from gearfmu.fem.coupling import rigid_modes
from gearfmu.femesh.mesh import rotated
from gearfmu.stagefile.forms.shapes import set_geometry
from gearfmu.stagefile.stage import load_stage

FOLDER = Path(__file__).resolve().parents[2] / "evidence" / "reduction" / "in_time"
IMPACT = Path(__file__).resolve().parents[1] / "reference" / "impact_pair" / "stage.toml"


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
        return planet, scenes.placed_ring(spec, meshes)
    angle = 0.0 if spec.planet.teeth % 2 else np.pi / spec.sun.teeth
    return planet, scenes.placed_gear(spec.sun, geometry.sun_mesh.gears[0], np.zeros(2), angle, meshes.gear)


@pytest.mark.full
def test_kernel_carries_the_impact_of_the_finite_elements(tmp_path: Path) -> None:
    """Planet and sun of planetary54 through half their backlash, on a coarse mesh, nothing damped, no tip relief, gaps
    linear about the start: level full against the unreduced gears (program of commit 4f20d638, 2026-11-30). Peak within
    5 %, impulse within 1 %."""
    spec, h, count = load_stage(IMPACT), 1e-6, 250
    off = {"effect.tip_relief": 0.0, "effect.tip_contact": 0.0}
    start = Rattle(position=0.1, speed=1.0)
    kernel = started(
        free_pair(spec, reduce_bodies(spec, tmp_path)), start, {**off, "level": 3, "integrator": 0, "h": h}
    )
    force = np.zeros(count)
    for step in range(count):
        kernel.step(step * h, h)
        force[step] = kernel.get("mesh.force")
    print(force.max(), h * force[force > 0].sum())
    assert force.max() == pytest.approx(4387.0, rel=0.05), "N"
    assert h * force[force > 0].sum() == pytest.approx(0.1226, rel=0.01), "N·s"
