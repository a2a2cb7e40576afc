"""The turning view: forces, teeth and angles it hands to the page are those of the run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from test_packed import unpacked

from gearfmu.body import load_bodies
from gearfmu.report.moving import FRAMES, View, moving_view
from gearfmu.report.packed import Pack
from gearfmu.report.structure import AROUND, parts, turned
from gearfmu.report.style import round_scale
from gearfmu.stage.assembly.observed import gear_bodies
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.forms.general import EngagementSpec, Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage

SPEED, FORCE = 200.0, 8000.0  # rad/s, N
TIME = np.linspace(0.0, 0.02, 2001)


def turning_pair(sign: float = 1.0) -> tuple[Trace, Any, dict[str, Any]]:
    """A pair that turns without slip under a constant force."""
    spec = load_stage("fzg_c")
    angle = SPEED * TIME
    channels = {
        "mesh.force": Channel(np.full(TIME.size, sign * FORCE), "N"),
        "pinion.gear.phi": Channel(angle, "rad"),
        "wheel.gear.phi": Channel(-angle * 16 / 24, "rad"),
    }
    return Trace(TIME, channels, {}), spec, gear_bodies(spec, load_bodies(spec))


@pytest.fixture(scope="module")
def view() -> View:
    trace, stage, bodies = turning_pair()
    found = moving_view(trace, stage, bodies, (0.001, 0.019))
    assert found is not None
    return found


def test_contacts_carry_the_recorded_force(view: View) -> None:
    pinion, wheel = view.bodies
    for body in (pinion, wheel):
        _, roll, force = body.contacts["mesh"]
        assert force.sum(axis=1) == pytest.approx(FORCE)
        assert np.all((roll > 0) == (force > 0))
    both = (pinion.contacts["mesh"][2] > 0).sum(axis=1)
    assert set(both) == {1, 2}, "one and two tooth pairs take turns"


def apart(view: View, stage: Stage, mesh: EngagementSpec, frame: int, sg: int) -> float:
    """Distance (m) of the points in which both gears of a mesh touch, each from its own angle, tooth and roll."""
    made, spots = {body.name: body for body in view.bodies}, []
    for name, shape in zip(mesh.gears, mesh_shape(stage, mesh).gears, strict=True):
        body = made[name]
        tooth, roll, force = (values[frame, 0] for values in body.contacts[mesh.name])
        assert force * sg > 0
        t = body.angle[frame] + 2 * math.pi * tooth / shape.z + sg * (shape.psi_b - roll / shape.r_b)
        x, y, _ = body.place
        spots.append(complex(x[frame], y[frame]) + (shape.r_b + 1j * sg * roll) * np.exp(1j * t))
    return abs(spots[0] - spots[1])


@pytest.mark.parametrize("sg", [1, -1])
def test_loaded_teeth_stand_where_the_flanks_of_both_gears_meet(sg: int) -> None:
    trace, stage, bodies = turning_pair(sg)
    found = moving_view(trace, stage, bodies, (0.001, 0.019))
    assert found is not None
    assert max(apart(found, stage, stage.engagements[0], frame, sg) for frame in range(0, FRAMES, 7)) < 2e-6


def test_without_angles_or_load_there_is_no_view() -> None:
    trace, stage, bodies = turning_pair()
    still = Trace(TIME, {"mesh.force": trace.channels["mesh.force"]}, {})
    assert moving_view(still, stage, bodies, (0.0, 0.02)) is None
    free = Trace(TIME, {**trace.channels, "mesh.force": Channel(np.zeros(TIME.size), "N")}, {})
    assert moving_view(free, stage, bodies, (0.0, 0.02)) is None


def test_the_page_gets_one_sector_and_small_numbers(view: View) -> None:
    pack = Pack()
    numbers = view.numbers(pack)
    text = pack.text({"stage": numbers})
    assert len(text) < 500_000
    content, arrays = unpacked(text)
    pinion = content["stage"]["bodies"][0]
    assert pinion["teeth"] == 16 and arrays[pinion["points"]].size == 3 * pinion["size"]
    unit = arrays[pinion["unit"]].astype(float) * pinion["step"]
    assert np.abs(unit - view.bodies[0].loads[1].ravel()).max() <= 0.51 * pinion["step"]  # type: ignore[index]
    assert arrays[pinion["angle"]] == pytest.approx(view.bodies[0].angle)


@pytest.mark.full
def test_planets_stand_between_sun_and_ring() -> None:
    """In a set at rest under a load every mesh has its contacts, and the points of both gears are one."""
    spec = load_stage("planetary54")
    stage, bodies = spec, gear_bodies(spec, load_bodies(spec))
    carrier = 85.0 * TIME
    channels = {"carrier.gear.phi": Channel(carrier, "rad"), "sun.gear.phi": Channel(4 * carrier, "rad")}
    for k in range(1, 5):
        channels[f"planet{k}.gear.phi"] = Channel(-2 * carrier, "rad")
        for central, sign in (("sun", -1), ("ring", 1)):
            channels[f"{central}_planet{k}.force"] = Channel(np.full(TIME.size, sign * 1800.0), "N")
    view = moving_view(Trace(TIME, channels, {}), stage, bodies, (0.0, 0.02))
    assert view is not None
    names = {body.name for body in view.bodies}
    assert {"sun", "ring", *(f"planet{k}" for k in range(1, 5))} <= names, "shafts and carrier beside them"
    for mesh in stage.engagements:
        sg = -1 if mesh.name.startswith("sun") else 1
        assert max(apart(view, stage, mesh, frame, sg) for frame in (3, 77)) < 5e-6, mesh.name


def test_shafts_and_carriers_of_the_stage_are_drawn_with_its_measures() -> None:
    """A shaft of its cylinders' radii; a carrier's bolts on the axes of its planets, all round its own axis."""
    train = load_stage("two_stage")
    shafts = {name: (rotor, profile) for name, rotor, profile, _, _ in parts(train)}
    assert set(shafts) == {"input_shaft", "intermediate_shaft", "output_shaft"}
    rotor, profile = shafts["input_shaft"]
    body = train.bodies["input_shaft"]
    assert rotor == "input" and max(z for _, z in profile) == pytest.approx(body.length)
    assert max(radius for radius, _ in profile) == max(0.5 * s.outer_diameter for s in body.sections)
    planets = load_stage("planetary54")
    found = {name: axis for name, rotor, _, axis, _ in parts(planets) if rotor == "carrier"}
    bolts = [axis for name, axis in found.items() if "bolt" in name]
    assert len(found) == 5 and [math.hypot(*axis) for axis in bolts] == pytest.approx([0.045] * 4)
    points, quads, ahead = turned(profile)
    assert len(points) == AROUND * len(profile) and len(quads) == len(ahead) == len(profile) - 1


def test_a_pair_without_shafts_has_its_gears_alone(view: View) -> None:
    assert [body.name for body in view.bodies] == ["pinion", "wheel"]
    assert "shafts" not in view.caption


@pytest.mark.parametrize(("wish", "scale"), [(1.0, 1), (4.9, 2), (5.0, 5), (87.0, 50), (0.7, 0.5)])
def test_scale_is_a_round_number(wish: float, scale: float) -> None:
    assert round_scale(wish) == pytest.approx(scale)
