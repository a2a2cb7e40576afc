"""A planetary set whose ring stands in a housing, along and about its axis."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from housings import rigid_block

from gearfmu.body import load_bodies
from gearfmu.body.body import Body
from gearfmu.stage import StageModel, Steady, assemble, simulate
from gearfmu.stage.run.te import statics_of
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage

FEET = {"left": (-0.1, -0.12, 0.0), "right": (0.1, -0.12, 0.0)}
TABLE = """
[bodies.housing]
kind = "housing"
[bodies.housing.reduced]
file = "{file}"
length = "1 m"
stiffness = "{file}"
mass = "{file}"
seats = {{ ring = 1 }}
feet = {{ left = 2, right = 3 }}
"""
FOOT = """
[[supports]]
name = "{name}"
body = "housing"
node = "{name}"
radial = "1e8 N/m"
axial = "1e8 N/m"
tilt = "1e6 N*m/rad"
"""


@cache
def stage(folder: Path) -> Stage:
    """planetary54 on a housing; the files of the superelement are named and not read."""
    file = folder / "housing.inp"
    file.write_text("", encoding="utf-8")
    text = find_stage("planetary54").read_text(encoding="utf-8")
    text = text.replace("[ring.mounts]", '[ring.mounts]\nto = "housing"\nnode = "ring"')
    path = folder / "stage.toml"
    path.write_text(text + TABLE.format(file=file.name) + "".join(FOOT.format(name=n) for n in FEET), encoding="utf-8")
    return load_stage(path)


@pytest.fixture(scope="module")
def housed(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return stage(tmp_path_factory.mktemp("set"))


def model(chosen: Stage, mass: float) -> StageModel:
    block = rigid_block("housing", mass, {"ring": (0.0, 0.0, 0.0)} | FEET)
    return assemble(chosen, [*shipped(), block])


@cache
def shipped() -> list[Body]:
    return load_bodies(load_stage("planetary54"))


def run(of: StageModel, **parameters: float) -> Trace:
    given = {"level": 1.0} | {name.replace("__", "."): value for name, value in parameters.items()}
    driven = of.driven_by_springs()
    return simulate(driven, Steady(driven, 85.0, 600.0), 2e-4, 2e-5, given)


def test_the_ring_stands_on_two_supports(housed: Stage) -> None:
    held = {s.name: s for s in housed.supports if s.body == "ring"}
    assert held["ring"].to is None and (held["ring"].axial, held["ring"].torsion) == (None, None)
    assert held["ring_seat"].to == "housing" and held["ring_seat"].radial is None
    plain = next(s for s in load_stage("planetary54").supports if s.body == "ring")
    assert (held["ring"].radial, held["ring"].tilt) == (plain.radial, plain.tilt)
    assert (held["ring_seat"].axial, held["ring_seat"].torsion) == (plain.axial, plain.torsion)
    assert isinstance(housed.written, PlanetarySpec) and housed.files[-1] == "housing"
    assert housed.file_of("planet2") == "planet"


def test_a_heavy_housing_on_stiff_feet_is_rigid_ground(housed: Stage) -> None:
    """Margin: 1e-6."""
    stiff = tuple(
        s.model_copy(update={"radial": 1e12, "axial": 1e12, "tilt": 1e11}) if s.body == "housing" else s
        for s in housed.written.supports
    )
    found = statics_of(model(rewritten(housed, supports=stiff), 1e5)).transmission(0.0, 600.0)
    wanted = statics_of(assemble(load_stage("planetary54"), shipped())).transmission(0.0, 600.0)
    assert found.te == pytest.approx(wanted.te, rel=1e-4)


@pytest.mark.full
def test_the_feet_carry_the_torque_of_the_ring(housed: Stage) -> None:
    """At the start: what carrier and sun leave, 600 · 54/72 N·m, by moments about the axis; and the ring's on its seat.
    Without the effect it is the set on rigid ground."""
    of = model(housed, 20.0)
    trace = run(of)
    start = {name: channel.values[0] for name, channel in trace.channels.items()}
    about = sum(x * start[f"mount.{name}.fy"] - y * start[f"mount.{name}.fx"] for name, (x, y, _) in FEET.items())
    assert abs(about) == pytest.approx(abs(start["bearing.ring_seat.mz"]), rel=1e-4)
    assert abs(about) == pytest.approx(600.0 * 54 / 72, rel=2e-3)
    assert np.ptp(trace["mount.left.fy"]) > 0.0
    ground, own = housed.on_rigid_ground(), load_stage("planetary54").by_name(shipped())
    plain = assemble(ground, [own[name] for name in ground.files])
    off, bare = run(of, effect__housing=0.0, h=1e-5), run(plain, h=1e-5)
    most = np.abs(bare["sun_planet1.force"]).max()
    for name in sorted(bare.channels.keys() & off.channels.keys()):
        if name.endswith((".fx", ".fy", ".fz", ".force")):
            assert np.abs(bare[name] - off[name]).max() <= 1e-4 * most, name
