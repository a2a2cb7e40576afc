"""A housing in the ground group: by hand, against dense matrices, and against the stage on rigid ground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from dense import answer, at_nodes, group_answer, read_nodes, relative
from housings import housing_of

import gearfmu as gf
from gearfmu.body import load_bodies
from gearfmu.body.body import Body, rigid_rows
from gearfmu.errors import ModelError, SpecError
from gearfmu.modes.housing import placed_housing
from gearfmu.stage import StageModel, Steady, assemble, simulate
from gearfmu.stage.assembly.assemble import mount_sets
from gearfmu.stage.assembly.groups import Layout, mount
from gearfmu.stage.assembly.layout import stage_layout
from gearfmu.stage.run.housing import HousingAlone
from gearfmu.stage.run.te import statics_of
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.stage import load_stage

TORQUE, SPEED, H = 150.0, 150.0, 20e-6
FAST = {"level": 1.0, "h": H / 2}


@cache
def stage() -> Stage:
    return load_stage("two_stage/stage_housed")


@cache
def gears() -> list:
    return load_bodies(load_stage("two_stage"))


@cache
def drawn() -> Body:
    return housing_of(stage(), 13.5, 40)


@cache
def housed() -> StageModel:
    return assemble(stage(), [*gears(), drawn()])


@cache
def shipped() -> StageModel:
    return gf.assemble("two_stage/stage_housed")


@cache
def on_ground() -> StageModel:
    return assemble(load_stage("two_stage"), gears())


@cache
def run(of: Callable[[], StageModel], duration: float = 4e-4, step: float = H, **parameters: float) -> Trace:
    model = of()
    given = FAST | {name.replace("__", "."): value for name, value in parameters.items()}
    return simulate(model, Steady(model, SPEED, TORQUE), duration, step, given)


def with_feet(chosen: Stage, **springs: float) -> Stage:
    """The stage with other springs under every foot."""
    feet = (s.model_copy(update=springs) if s.body == "housing" else s for s in chosen.supports)
    return chosen.model_copy(update={"supports": tuple(feet)})


def drawn_layout(body: Body, chosen: Stage | None = None) -> Layout:
    return stage_layout(chosen or stage(), gears(), {"housing": body})


def test_the_housed_group_is_the_dense_system() -> None:
    """The bore of a pinion, a seat, sensors, among themselves. Margin: differences are 1e-9 of the largest."""
    layout = drawn_layout(drawn())
    last = len(layout.bodies) - 1
    sensors = len(layout.bodies[last].nodes) - 2
    places = [(0, 0, 0), (last, 0, 1), *((last, sensors + k, d) for k in range(2) for d in range(3))]
    group = mount(layout)
    for omega in (2 * np.pi * 35.0, 2 * np.pi * 1730.0):
        wanted, _ = answer(layout, at_nodes(layout, places, omega), omega)
        found, _ = group_answer(group, read_nodes(group, places), omega)
        assert relative(found[:2, :2], wanted[:2, :2]) < 1e-6
        assert np.abs(found - wanted)[2:, 0].max() <= 1e-6 * np.abs(wanted)[2:, 0].max()  # nothing presses sensors


def test_a_bearing_beside_the_middle_of_its_seat_acts_with_a_rigid_arm() -> None:
    """The same housing told by nodes that lie 4 mm aside along the shafts."""
    offset = np.array([0.0, 0.0, 4e-3])
    body, arms, nodes = drawn(), np.eye(len(drawn().rows)), list(drawn().nodes)
    for k, node in enumerate(body.nodes):
        if node.name.startswith(("input", "output")):
            arms[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = rigid_rows(offset)
            nodes[k] = replace(node, point=node.point + offset)
    told = {"nodes": tuple(nodes), "rows": arms @ body.rows, "static": arms @ body.static @ arms.T}
    assert body.sensors is not None
    sensors = replace(body.sensors, static=body.sensors.static @ arms.T)
    aside = replace(body, sensors=sensors, **told)
    one, other = (mount(drawn_layout(own)) for own in (body, aside))
    assert np.allclose(one.omega, other.omega, rtol=1e-9)
    last = len(one.layout.bodies) - 1
    assert np.allclose(np.abs(one.node_rows(last, 11, 0)), np.abs(other.node_rows(last, 11, 0)), rtol=0, atol=1e-6)


def test_a_free_rigid_housing_yields_by_its_mass() -> None:
    """Without feet, as `gearfmu house` puts it under a finished run: seats answer by R M⁻¹ Rᵀ."""
    free = stage().model_copy(update={"supports": tuple(s for s in stage().supports if s.body != "housing")})
    body, omega = housing_of(stage(), 13.5), 2 * np.pi * 100.0
    placed = placed_housing(free, [*gears(), body])
    answers = placed.housing.answers(np.array([omega]))
    assert placed.feet == () and answers.mounts.shape[1] == 0
    rows = placed.housing.seats[:, :6]
    assert np.allclose(answers.seats[0], -(rows @ np.linalg.solve(body.mass, rows.T)) / omega**2, rtol=1e-12)
    with pytest.raises(SpecError, match="reaction torque"):
        assemble(free, [*gears(), body])


@pytest.mark.parametrize("effect", ["housing", pytest.param("bearings", marks=pytest.mark.full)])
def test_without_its_housing_it_is_the_stage_on_the_ground_bit_for_bit(effect: str) -> None:
    """And with the bearings held; sensors and mounts then read nothing."""
    off = {f"effect__{effect}": 0.0}
    own, plain = run(housed, **off), run(on_ground, **({} if effect == "housing" else off))
    assert [name for name in plain.channels if not np.array_equal(plain[name], own[name])] == []
    assert not any(np.any(own[name]) for name in own.channels if name.startswith(("sensor.", "mount.")))


def test_a_rigid_massive_housing_on_stiff_feet_is_rigid_ground() -> None:
    """Transmission error and forces at rest and in motion. Margin: differences are 1e-6 to 2e-5."""
    stiff = with_feet(stage(), radial=1e12, axial=1e12, tilt=1e11, torsion=1e11)
    heavy = assemble(stiff, [*gears(), housing_of(stage(), 1e5)])
    at_rest = [statics_of(model, **FAST).transmission(0.0, TORQUE) for model in (heavy, on_ground())]
    assert at_rest[0].te == pytest.approx(at_rest[1].te, rel=1e-4)
    found, wanted = run(lambda: heavy), run(on_ground)
    for name in wanted.channels:
        if name.endswith((".force", ".fx", ".fy", ".fz", ".te")):
            assert np.abs(found[name] - wanted[name]).max() <= 1e-4 * max(np.abs(wanted[name]).max(), 1.0), name


def test_a_sensor_tells_the_mean_acceleration() -> None:
    """Over a communication step of twice the length it is the mean of two, with the same internal steps. Margin: the
    solver's tolerance leaves 1e-4."""
    short, long = run(housed), run(housed, step=2 * H)
    for name in (name for name in short.channels if name.startswith("sensor.")):
        mean = 0.5 * (short[name][1::2] + short[name][2::2])
        assert np.abs(long[name][1:] - mean).max() <= 1e-3 * np.abs(mean).max()


@pytest.mark.parametrize(("of", "times"), [(shipped, 1.5), pytest.param(housed, 10.0, marks=pytest.mark.full)])
def test_the_balance_of_energy_closes_as_on_the_ground(of: Callable[[], StageModel], times: float) -> None:
    """The ground leaves 2.1e-5, the shipped housing 2.2e-6, the drawn one, whose seats yield more, 1.65e-4."""
    left, plain = (abs(run(model, 2e-3).meta["energy_residual"]) for model in (of, on_ground))
    assert left <= times * plain


@pytest.mark.full
def test_what_is_above_its_limit_is_compliance() -> None:
    """Statics stay, oscillators go."""
    soft = stage().model_copy(
        update={"bodies": stage().bodies | {"housing": stage().housings[0].model_copy(update={"dynamic_to": 2e3})}}
    )
    models = [assemble(chosen, [*gears(), drawn()]) for chosen in (soft, stage())]
    at_rest = [statics_of(model, level=1.0).transmission(0.0, TORQUE) for model in models]
    assert at_rest[0].te == pytest.approx(at_rest[1].te, rel=1e-7)
    lost = int(np.sum(drawn().frequency > 2e3))
    sizes = [mount_sets(drawn_layout(drawn(), own))[0].omega.size for own in (stage(), soft)]
    assert lost > 5 and sizes[0] - sizes[1] == lost


@pytest.mark.parametrize(
    ("moved", "words"),
    [
        ([2e-3, 0, 0], "the axes of seat input_left of housing and the bearing input_left lie apart, at x, y = (2, 0)"),
        ([0, 0, 0.05], "seat input_left of housing and the bearing input_left lie apart along z: at 50"),
    ],
)
def test_seats_off_their_bearings_are_told(moved: list[float], words: str) -> None:
    body = drawn()
    seat = body.nodes[0]
    low, high = seat.span
    other = replace(seat, point=seat.point + moved, span=(low + moved[2], high + moved[2]))
    with pytest.raises(ModelError) as error:
        drawn_layout(replace(body, nodes=(other, *body.nodes[1:])))
    assert words in str(error.value)


def test_bearing_forces_give_the_sensors_back() -> None:
    """The housing on its feet alone under the recorded forces. Margin: forces that are constant over 10 µs leave 2.6 %
    (0.2 dB)."""
    trace = run(housed, 1e-3, 1e-5)
    alone = HousingAlone.of(stage(), [*gears(), drawn()])
    assert len(alone.channels) == 27  # five directions of balls, four of rollers
    velocity, sensors = alone.motion(trace).velocity, alone.body.sensors
    speed = velocity @ np.hstack([sensors.rigid_rows, sensors.rows])[:, : velocity.shape[1]].T
    names = [f"sensor.{name}.a{axis}" for name in ("top", "cover") for axis in "xyz"]
    found, told = np.diff(speed, axis=0) / 1e-5, np.stack([trace[name][1:] for name in names], axis=1)
    assert np.abs(found - told).max() <= 0.05 * np.abs(told).max()
    assert np.std(found - told) <= 0.045 * np.std(told)


# ---- of a set: its ring stands in the housing ------------------------------------------------------------------------
SET, HOUSED = "planetary54", "planetary54/stage_housed"


def feet() -> dict[str, np.ndarray]:
    """Where the feet of the shipped housing are."""
    names = load_stage(HOUSED).housings[0].made_of.feet
    return {node.name: node.point for node in load_bodies(load_stage(HOUSED))[-1].nodes if node.name in names}


def set_run(of: StageModel, **parameters: float) -> Trace:
    driven = of.driven_by_springs()
    return simulate(driven, Steady(driven, 85.0, 600.0), 2e-4, 2e-5, {"level": 1.0} | parameters)


def test_the_ring_stands_on_two_supports() -> None:
    housed = load_stage(HOUSED)
    held = {s.name: s for s in housed.supports if s.body == "ring"}
    assert held["ring"].to is None and (held["ring"].axial, held["ring"].torsion) == (None, None)
    assert held["ring_seat"].to == "housing" and held["ring_seat"].radial is None
    plain = next(s for s in load_stage(SET).supports if s.body == "ring")
    assert (held["ring"].radial, held["ring"].tilt) == (plain.radial, plain.tilt)
    assert (held["ring_seat"].axial, held["ring_seat"].torsion) == (plain.axial, plain.torsion)
    assert isinstance(housed.written, PlanetarySpec) and housed.files[-1] == "housing"
    assert housed.file_of("planet2") == "planet"


@pytest.mark.full
def test_the_feet_carry_the_torque_of_the_ring() -> None:
    """At the start: what carrier and sun leave, 600 · 54/72 N·m, by moments about the axis; and the ring's on its seat.
    Without the effect it is the set on rigid ground."""
    housed = load_stage(HOUSED)
    of = assemble(housed, load_bodies(housed))
    trace = set_run(of)
    start = {name: channel.values[0] for name, channel in trace.channels.items()}
    about = sum(x * start[f"mount.{name}.fy"] - y * start[f"mount.{name}.fx"] for name, (x, y, _) in feet().items())
    assert abs(about) == pytest.approx(abs(start["bearing.ring_seat.mz"]), rel=1e-4)
    assert abs(about) == pytest.approx(600.0 * 54 / 72, rel=2e-3)
    assert np.ptp(trace["mount.left_front.fy"]) > 0.0
    ground, own = housed.on_rigid_ground(), load_stage(SET).by_name(load_bodies(load_stage(SET)))
    plain = assemble(ground, [own[name] for name in ground.files])
    off, bare = set_run(of, **{"effect.housing": 0.0, "h": 1e-5}), set_run(plain, h=1e-5)
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
