"""The deformed pair: where teeth touch, which way they bend, and that a picture comes out of the shipped bodies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gearfmu.body import load_bodies
from gearfmu.geometry import PairGeometry
from gearfmu.report import picture
from gearfmu.report.scene3d import Shape, draw
from gearfmu.spec.forms.expand import as_general
from gearfmu.spec.stage import load_stage
from gearfmu.stage.run import touching
from gearfmu.stage.run.trace import Channel, Trace


@pytest.fixture(scope="module")
def stage() -> tuple[Any, list[Any]]:
    spec = load_stage("fzg_c/stage_relief")
    return spec, load_bodies(spec)


@pytest.mark.parametrize("sg", [1, -1])
@pytest.mark.parametrize("phi", np.linspace(0, 2 * math.pi / 16, 7))
def test_teeth_touch_where_both_flanks_are(stage: tuple[Any, list[Any]], sg: int, phi: float) -> None:
    """The flank points of both gears at the rolls found coincide in space, to rounding."""
    pair = PairGeometry.of(stage[0])
    angles = touching.meshing_angles(pair, phi, sg)
    contacts = touching.contacts_at(pair, angles, sg)
    assert 1 <= len(contacts) <= 2
    for contact in contacts:
        spots = []
        for g, gear in enumerate(pair.gears):
            roll, base = contact.rolls[g], angles[g] + 2 * math.pi * contact.teeth[g] / gear.z + sg * gear.psi_b
            polar = base - sg * (roll / gear.r_b - math.atan2(roll, gear.r_b))
            radius = math.hypot(roll, gear.r_b)
            spots.append(np.array([g * pair.a + radius * math.cos(polar), radius * math.sin(polar)]))
        assert np.linalg.norm(spots[0] - spots[1]) < 1e-9


def test_flanks_recede_under_load_on_either_side(stage: tuple[Any, list[Any]]) -> None:
    """A contact force presses the flanks apart: the approach that closes them is positive, and the same for drive
    and coast by symmetry."""
    spec, bodies = stage
    pair = PairGeometry.of(spec)
    found = {}
    for sg in (1, -1):
        angles = touching.meshing_angles(pair, sg * 0.3, sg)
        contacts = touching.contacts_at(pair, angles, sg)
        moved = [
            picture._displacement(bodies[g], pair.gears[g].z, [(c.teeth[g], c.rolls[g]) for c in contacts], sg * 5000.0)
            for g in (0, 1)
        ]
        placed = [picture._placed(bodies[g].display.points, angles[g], pair.a if g else 0.0) for g in (0, 1)]
        world = [u @ picture._rotation(angle).T for u, angle in zip(moved, angles, strict=True)]
        found[sg] = picture._approach(pair, contacts, sg, placed, world)
    assert found[1] > 1e-6
    assert found[-1] == pytest.approx(found[1], rel=0.05)


def test_a_load_on_another_tooth_is_the_same_field_turned(stage: tuple[Any, list[Any]]) -> None:
    body = stage[1][0]
    first, third = (picture._displacement(body, 16, [(tooth, 0.018)], 1000.0) for tooth in (0, 3))
    turn = picture._rotation(2 * math.pi * 3 / 16)
    assert np.linalg.norm(third, axis=1).max() == pytest.approx(np.linalg.norm(first, axis=1).max(), rel=1e-12)
    hot = [np.asarray(body.display.points, dtype=float)[np.argmax(np.linalg.norm(u, axis=1))] for u in (first, third)]
    assert np.allclose(hot[1], turn @ hot[0], atol=1e-6)


def shown(trace: Trace, stage: tuple[Any, list[Any]]) -> Any:
    return picture.deformed_pair(trace, as_general(stage[0]), "mesh", stage[1])


@pytest.mark.parametrize("force", [4000.0, -4000.0])
def test_picture_of_the_largest_force(stage: tuple[Any, list[Any]], force: float) -> None:
    t = np.arange(5) * 1e-3
    trace = Trace(
        t, {"mesh.force": Channel(np.array([0, 1, force, 1, 0.0]), "N"), "pinion.gear.phi": Channel(t * 200, "rad")}, {}
    )
    plot = shown(trace, stage)
    assert plot is not None and plot.picture.startswith("<img") and "t = 0.00200 s" in plot.caption
    assert ("coast" in plot.caption) == (force < 0)
    assert len(plot.columns["gear"]) == sum(len(body.display.points) for body in stage[1])


def test_no_force_no_picture(stage: tuple[Any, list[Any]]) -> None:
    t = np.arange(3.0)
    still = {"mesh.force": Channel(np.zeros(3), "N"), "pinion.gear.phi": Channel(t, "rad")}
    assert shown(Trace(t, still, {}), stage) is None
    assert shown(Trace(t, {"mesh.force": Channel(t, "N")}, {}), stage) is None


def test_near_faces_hide_far_ones() -> None:
    """Two squares one behind the other: the picture shows the value of the near one only."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    shapes = [
        Shape(square + [0, 0, z], np.array([[0, 1, 2, 3]]), np.full(4, value)) for z, value in ((1.0, 0.0), (0.0, 1.0))
    ]
    near_first, far_first = draw(shapes, np.full(3, 0.5), 0.4, "x"), draw(shapes[::-1], np.full(3, 0.5), 0.4, "x")
    assert near_first == far_first


@pytest.mark.parametrize(("wish", "scale"), [(1.0, 1), (4.9, 2), (5.0, 5), (87.0, 50), (0.7, 0.5)])
def test_scale_is_a_round_number(wish: float, scale: float) -> None:
    assert picture.round_scale(wish) == pytest.approx(scale)
