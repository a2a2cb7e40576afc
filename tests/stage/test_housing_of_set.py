"""A planetary set whose ring stands in a housing, along and about its axis."""

from __future__ import annotations

import numpy as np
import pytest

import gearfmu as gf
from gearfmu.body import load_bodies
from gearfmu.body.body import Body
from gearfmu.stage import StageModel, Steady, assemble, simulate
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.stage import load_stage

SET, HOUSED = "planetary54", "planetary54/stage_housed"


def shipped(name: str = SET) -> list[Body]:
    return load_bodies(load_stage(name))


def feet() -> dict[str, np.ndarray]:
    """Where the feet of the shipped housing are."""
    names = load_stage(HOUSED).housings[0].made_of.feet
    return {node.name: node.point for node in shipped(HOUSED)[-1].nodes if node.name in names}


def run(of: StageModel, **parameters: float) -> Trace:
    given = {"level": 1.0} | {name.replace("__", "."): value for name, value in parameters.items()}
    driven = of.driven_by_springs()
    return simulate(driven, Steady(driven, 85.0, 600.0), 2e-4, 2e-5, given)


@pytest.mark.full
def test_the_feet_carry_the_torque_of_the_ring() -> None:
    """At the start: what carrier and sun leave, 600 · 54/72 N·m, by moments about the axis; and the ring's on its seat.
    Without the effect it is the set on rigid ground."""
    housed = load_stage(HOUSED)
    of = assemble(housed, shipped(HOUSED))
    trace = run(of)
    start = {name: channel.values[0] for name, channel in trace.channels.items()}
    about = sum(x * start[f"mount.{name}.fy"] - y * start[f"mount.{name}.fx"] for name, (x, y, _) in feet().items())
    assert abs(about) == pytest.approx(abs(start["bearing.ring_seat.mz"]), rel=1e-4)
    assert abs(about) == pytest.approx(600.0 * 54 / 72, rel=2e-3)
    assert np.ptp(trace["mount.left_front.fy"]) > 0.0
    ground, own = housed.on_rigid_ground(), load_stage(SET).by_name(shipped())
    plain = assemble(ground, [own[name] for name in ground.files])
    off, bare = run(of, effect__housing=0.0, h=1e-5), run(plain, h=1e-5)
    most = np.abs(bare["sun_planet1.force"]).max()
    for name in sorted(bare.channels.keys() & off.channels.keys()):
        if name.endswith((".fx", ".fy", ".fz", ".force")):
            assert np.abs(bare[name] - off[name]).max() <= 1e-4 * most, name


@pytest.mark.full
def test_only_harmonics_that_the_planets_share_are_heard() -> None:
    """54 teeth and four planets: harmonic k of the mesh, 54 · 85/2π = 730.6 Hz, turns the ring where 54 k/4 is whole.
    Found: 82 dB between the second and the first, 62 between the second and the third."""
    trace = gf.simulate(HOUSED, "600 N*m", "85 rad/s", level="fast", duration="0.1 s", step="25 us")
    heard = gf.sound_power(trace, start="30 ms")
    power = dict(zip(np.round(heard.bands), np.ravel(heard.third_octaves()), strict=True))
    assert max(power[794], power[1995]) < 1e-4 * min(power[1585], power[3162])
