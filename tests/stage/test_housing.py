"""A housing in the ground group: by hand, against dense matrices, and against the stage on rigid ground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from housings import housing_of

from gearfmu.body import load_bodies
from gearfmu.body.body import Body, Node, rigid_rows
from gearfmu.errors import ModelError, SpecError
from gearfmu.modes.housing import placed_housing
from gearfmu.reduction.full_order import COMPONENTS
from gearfmu.stage import StageModel, Steady, assemble, simulate
from gearfmu.stage.assembly.assemble import mount_sets
from gearfmu.stage.assembly.ground_part import GroundPart
from gearfmu.stage.assembly.groups import Group, Layout, Support, mount, node_directions
from gearfmu.stage.assembly.layout import stage_layout
from gearfmu.stage.run.housing import HousingAlone
from gearfmu.stage.run.te import statics_of
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage
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
    return assemble(stage(), load_bodies(stage()))


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


def block(name: str, mass: float) -> GroundPart:
    """A rigid body with one node at its origin."""
    return GroundPart(
        name=name,
        mass=np.diag([mass] * 3 + [mass * 1e-2] * 3),
        omega=np.zeros(0),
        zeta=np.zeros(0),
        nodes=(Node("node", "rigid", COMPONENTS, np.zeros(3)),),
        rows=np.zeros((1, 6, 0)),
        residual=np.zeros((6, 6)),
    )


def spring(name: str, first: int, second: int | None, stiffness: float) -> Support:
    ends = (first, 0), None if second is None else (second, 0)
    return Support(name, *ends, tuple(range(6)), np.eye(6) / stiffness, np.zeros(6))


def test_two_masses_on_springs_by_hand() -> None:
    """A rotor of 2 kg on 30 N/µm in a housing of 10 kg on 80 N/µm: ω² of k₁/m₁, (k₁ + k₂)/m₂, k₁²/(m₁ m₂)."""
    m1, m2, k1, k2 = 2.0, 10.0, 30e6, 80e6
    layout = Layout(
        [block("rotor", m1), block("housing", m2)],
        [(0,)],
        [spring("bearing", 0, 1, k1), spring("mount", 1, None, k2)],
        planar=False,
    )
    assert layout.freedoms(1) == (0, 1, 2, 3, 4, 5)  # it belongs to no rotor: nothing of it is a spin
    a, b, c = k1 / m1, (k1 + k2) / m2, k1 * k1 / (m1 * m2)
    root = np.sqrt(((a - b) / 2) ** 2 + c)
    omega = mount(layout).omega
    for wanted in (np.sqrt((a + b) / 2 - root), np.sqrt((a + b) / 2 + root)):
        assert np.sum(np.abs(omega / wanted - 1) < 1e-12) >= 3  # along x, y and z


def drawn_layout(body: Body, chosen: Stage | None = None) -> Layout:
    return stage_layout(chosen or stage(), gears(), {"housing": body})


def dense_response(layout: Layout, hit: tuple[int, int], seen: list[tuple[int, int, int]], omega: float) -> np.ndarray:
    """Displacements of nodes (body, node, direction) under a unit force along x on a node, undamped: all bodies with
    their own coordinates, supports by their forces, one saddle-point system."""
    sizes = [6 + body.omega.size for body in layout.bodies]
    at = np.concatenate([[0], np.cumsum(sizes)])
    mass, stiffness = np.eye(at[-1]), np.zeros(at[-1])
    supports = len(layout.support_names())
    rows, give = np.zeros((supports, at[-1])), np.zeros((supports, supports))
    start = 0
    for support in layout.supports:
        own = slice(start, start + len(support.directions))
        give[own, own] = support.compliance
        start = own.stop
    for b, body in enumerate(layout.bodies):
        mass[at[b] : at[b] + 6, at[b] : at[b] + 6] = body.mass
        stiffness[at[b] + 6 : at[b + 1]] = body.omega**2
        sides = node_directions(layout, b)
        rows[:, at[b] : at[b + 1]] = sides @ nodes_of(body)
        give += sides @ body.residual @ sides.T
    body, node = hit
    push = np.zeros(at[-1])
    push[at[body] : at[body + 1]] = nodes_of(layout.bodies[body])[6 * node]
    moved = node_directions(layout, body) @ layout.bodies[body].residual[6 * node]
    spins = [at[own[0]] + 5 for own in layout.rotors]  # their rigid rotation: held, as in the group it is no unknown
    held = np.zeros((len(spins), at[-1]))
    for k, own in enumerate(layout.rotors):
        turn = np.zeros(at[-1])
        for b in own:
            turn[at[b] + 5] = 1.0
        held[k] = mass @ turn
    dynamic = np.diag(stiffness) - omega**2 * mass
    zero = np.zeros((supports, len(spins)))
    system = np.block(
        [
            [dynamic, rows.T, held.T],
            [rows, -give, zero],
            [held, zero.T, np.zeros((len(spins), len(spins)))],
        ]
    )
    scale = 1 / np.sqrt(np.abs(system).max(axis=1))
    right = np.concatenate([push, -moved, np.zeros(len(spins))])
    found = scale * np.linalg.solve(system * np.outer(scale, scale), scale * right)
    x, force = found[: at[-1]], found[at[-1] : at[-1] + supports]
    result = []
    for own, where, direction in seen:
        free, row = layout.bodies[own], 6 * where + direction
        direct = free.residual[row, 6 * node] if own == body else 0.0
        to_supports = node_directions(layout, own) @ free.residual[row]
        result.append(nodes_of(free)[row] @ x[at[own] : at[own + 1]] - to_supports @ force + direct)
    return np.array(result)


def nodes_of(body: GroundPart) -> np.ndarray:
    """(6K, 6 + n): motion of all nodes."""
    return np.vstack([np.hstack([node.rigid_rows, rows]) for node, rows in zip(body.nodes, body.rows, strict=True)])


def group_response(group: Group, hit: tuple[int, int], seen: list[tuple[int, int, int]], omega: float) -> np.ndarray:
    body, node = hit
    pushed, pressed = group.node_rows(body, node, 0), group.node_supports(body, node, 0)
    result = []
    for own, where, direction in seen:
        direct = group.layout.bodies[own].residual[6 * where + direction, 6 * node] if own == body else 0.0
        direct -= group.node_supports(own, where, direction) @ group.kappa @ pressed
        result.append(group.node_rows(own, where, direction) @ (pushed / (group.omega**2 - omega**2)) + direct)
    return np.array(result)


def test_the_housed_group_is_the_dense_system() -> None:
    """Force on the bore of a pinion → itself, a seat, sensors. Margin: differences are 1e-9 of the largest."""
    layout = drawn_layout(drawn())
    last = len(layout.bodies) - 1
    sensors = len(layout.bodies[last].nodes) - 2
    seen = [(0, 0, 0), (last, 0, 1), *((last, sensors + k, d) for k in range(2) for d in range(3))]
    group = mount(layout)
    for frequency in (35.0, 1730.0):
        wanted = dense_response(layout, (0, 0), seen, 2 * np.pi * frequency)
        found = group_response(group, (0, 0), seen, 2 * np.pi * frequency)
        assert np.abs(found - wanted).max() <= 1e-6 * np.abs(wanted).max()
        assert np.abs(found[2:] - wanted[2:]).max() <= 1e-6 * np.abs(wanted[2:]).max()  # sensors among themselves


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
