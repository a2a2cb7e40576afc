"""A housing with twelve seats, four on every shaft: more directions of supports than the kernel once held."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bored import BORES, SENSORS, block
from decks import write_deck
from housings import housing_of

from gearfmu.body import Body, load_bodies, reduce_body
from gearfmu.stage import StageModel, Steady, assemble, simulate
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage

pytestmark = pytest.mark.full  # six seats stand in tests/stage/test_housing.py

LEVELS = (12, 40, 80, 110)  # mm; a seat is where a bore meets one
SEATS = {f"{bore}{k}": (bore, z) for bore in BORES for k, z in enumerate(LEVELS)}
HOUSING = """[bodies.housing]
kind = "housing"
modes = 120
dynamic_to = "6 kHz"
material = {{ youngs_modulus = "72 GPa", poisson_ratio = 0.33, density = "2700 kg/m^3" }}
[bodies.housing.import]
file = "housing.inp"
length = "1 mm"
seats = {{ {seats} }}
feet = {{ {feet} }}
sensors = {{ {sensors} }}

"""
BEARING = """
[[supports]]
name = "{name}"
body = "{bore}_shaft"
at = "{z} mm"
to = "housing"
node = "{name}"
radial = "1e8 N/m"
axial = "3e7 N/m"
tilt = "5e3 N*m/rad"
damping_ratio = 0.0
"""


def stage(folder: Path, seats: list[str]) -> Stage:
    """two_stage with the seats, and their bearings, in this order; nothing damps its supports."""

    def named(names: list[str]) -> str:
        return ", ".join(f'{name} = "{name.upper()}"' for name in names)

    text = re.sub(r"damping_ratio = .*", "damping_ratio = 0.0", find_stage("two_stage/stage_housed").read_text("utf-8"))
    head, tables = text[: text.index("[bodies.housing]")], re.split(r"(?=\[\[supports\]\])", text)[1:]
    kept = [table for table in tables if 'to = "housing"' not in table]
    feet = re.findall(r'node = "(foot\d)"', "".join(kept))
    housing = HOUSING.format(seats=named(seats), feet=named(feet), sensors=named(list(SENSORS)))
    bearings = [BEARING.format(name=name, bore=SEATS[name][0], z=SEATS[name][1]) for name in seats]
    base = f'base = "{find_stage("two_stage").as_posix()}"'
    path = folder / "stage.toml"
    made = block(LEVELS, {name: (bore, z, z) for name, (bore, z) in SEATS.items()})
    sets = {name.upper(): own for name, own in made.sets.items()}
    write_deck(folder / "housing.inp", made.nodes, {"hexahedron20": made.cells}, sets)
    path.write_text(head.replace('base = "stage.toml"', base) + housing + "".join([*kept, *bearings]), encoding="utf-8")
    return load_stage(path)


def model(folder: Path, seats: list[str], reduced: bool) -> StageModel:
    chosen = stage(folder, seats)
    body = (
        reduce_body(chosen, "housing") if reduced else in_order(housing_of(stage(folder, list(SEATS)), 20.0, 40), seats)
    )
    return assemble(chosen, [*load_bodies(load_stage("two_stage")), body])


def in_order(body: Body, seats: list[str]) -> Body:
    """The body with its seats in this order, before its feet."""
    assert body.sensors is not None and body.sensors.static is not None
    names = [node.name for node in body.nodes]
    at = [names.index(name) for name in [*seats, *(name for name in names if name not in seats)]]
    rows = (6 * np.array(at)[:, None] + np.arange(6)).ravel()
    felt = replace(body.sensors, static=body.sensors.static[:, rows])
    nodes = tuple(body.nodes[k] for k in at)
    return replace(body, nodes=nodes, rows=body.rows[rows], static=body.static[np.ix_(rows, rows)], sensors=felt)


@pytest.fixture(scope="module", params=[False, True], ids=["drawn", "reduced"])
def runs(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[Trace]:
    """Of 0.4 ms, in the order of the table and in the other: of a housing with drawn modes, and of one reduced anew."""
    found = []
    for seats in (list(SEATS), list(SEATS)[::-1]):
        of = model(tmp_path_factory.mktemp("seats"), seats, request.param)
        found.append(simulate(of, Steady(of, 150.0, 150.0), 4e-4, 2e-5, {"level": 1.0}))
    return found


def test_its_feet_carry_what_its_seats_take(runs: list[Trace]) -> None:
    """At rest, along x, y and z; 96 directions of supports."""
    start = {name: channel.values[0] for name, channel in runs[0].channels.items()}
    for axis in "xyz":
        seats = [start[f"bearing.{name}.f{axis}"] for name in SEATS]
        feet = [start[f"mount.foot{k}.f{axis}"] for k in range(4)]
        assert abs(sum(seats)) == pytest.approx(abs(sum(feet)), abs=1e-6 * np.abs(seats).max())


def test_the_order_of_its_seats_and_bearings_changes_nothing(runs: list[Trace]) -> None:
    """Margin: 2.5e-6 of a sensor, 6e-8 of the mesh force."""
    one, other = runs
    felt = max(np.abs(one[name]).max() for name in one.channels if name.startswith("sensor."))
    assert set(one.channels) == set(other.channels)
    for name in one.channels:
        if name.startswith("sensor."):
            assert np.abs(one[name] - other[name]).max() <= 1e-4 * felt, name
        elif name.endswith((".fx", ".fy", ".fz", ".force")):
            assert np.abs(one[name] - other[name]).max() <= 1e-6 * np.abs(one["stage1.force"]).max(), name
