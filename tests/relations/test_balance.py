"""R8, balance by outputs: what supports and ports do to a stage is what moves it. From output channels alone, with
masses, places and dashpots from the bodies and the tables.

At rest the forces on the ground and the moments of the ports are in balance. In motion a support's force is that of its
spring and its dashpot, the forces on the ground are the rate of momentum, and the power of the ports is what is stored
and lost. Momentum is observable where all bodies are gears: shafts and carriers have no channels of motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from kinds import HOUSED, KINDS, Drawn, Kind, at_level, bodies_of, channels, every, family, level_number, listed, loaded

from gearfmu.stage import assemble
from gearfmu.stage.assembly.blob import read_blob, with_guid, write_blob
from gearfmu.stage.assembly.groups import Layout
from gearfmu.stage.assembly.layout import even_grids, place_of, stage_layout
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stage.run.simulate import simulate
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.tables.connections import SupportSpec
from gearfmu.stagefile.tables.housing import HousingBody

FORCES, MOMENTS = 1e-5, 2e-3  # at rest, of the largest force and torque; moments: forces act where bodies have moved to
DASHPOT = 0.2  # root mean square: what is quasi-static moves without it; found up to 0.13, a thin ring
DRAWN_DASHPOT = 0.1  # of drawn stages; found up to 0.061
MOMENTUM = 0.02  # root mean square: trapezoids of forces; modal damping holds bodies a little
ENERGY = 1e-3  # of what passed through the ports, in fractions of a pitch; found up to 3e-4
WORK, DRAWN_WORK = 1e-6, 6e-6  # of the same; found up to 3e-6 in drawn sets, 3.6e-6 in one with friction
DEAR = ["helical_set"]
START = 30  # steps in which friction, unknown at rest, sets in
RATE = 2e-5  # of the speed of a port
TORQUE = 1  # kind of a port in the blob
STEP = 2e-6  # s, of communication: short enough to differentiate outputs


# ---- at rest --------------------------------------------------------------------------------------------------------
def at_rest(kind: Kind, time: float, level: str = "fast") -> dict[str, float]:
    """Outputs at the static equilibrium with which a run begins."""
    model = kind.model().driven_by_springs()
    kernel = model.kernel(level=float(level_number(model, level)))
    for name, value in loaded(kind)(time).items():
        kernel.set(name, value)
    kernel.initialize(0.0)
    return {v.name: kernel.get(v.name) for v in kernel.variables.values() if v.causality == "output"}


def on_the_ground(kind: Kind, out: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Force (3,) and moment (3,) about the origin that the stage exerts on the ground and through its ports."""
    stage, force, moment = kind.stage, np.zeros(3), np.zeros(3)
    for support in stage.supports:
        if support.to is not None:
            continue
        foot = isinstance(stage.bodies[support.body], HousingBody)
        name = f"{'mount' if foot else 'bearing'}.{support.name}"
        own = [np.array([out.get(f"{name}.{kind}{axis}", 0.0) for axis in "xyz"]) for kind in "fm"]
        force += own[0]
        moment += own[1] + np.cross(held_at(kind, support), own[0])
    moment[2] += sum(out[f"{port}.tau"] for port in stage.ports)
    return force, moment


def held_at(kind: Kind, support: SupportSpec) -> np.ndarray:
    """(3,) m: where a support acts."""
    body = kind.stage.bodies[support.body]
    point = np.zeros(3)
    if isinstance(body, CarrierBody | HousingBody):
        nodes = {node.name: node.point for node in bodies_of(kind.file)[body.name].nodes}
        point = np.asarray(nodes[support.node or "bore"])
    if isinstance(body, HousingBody):
        return point
    z = place_of(kind.stage, support) + point[2]
    return np.array([*kind.stage.rotors[kind.stage.rotor_of(support.body)].axis, z])


def is_at_rest(kind: Kind, time: float, level: str = "fast") -> None:
    out = at_rest(kind, time, level)
    force, moment = on_the_ground(kind, out)
    largest = max(abs(value) for name, value in out.items() if family(name) == "f")
    torque = max(abs(out[f"{port}.tau"]) for port in kind.stage.ports)
    assert np.abs(force).max() < FORCES * largest, force / largest
    assert np.abs(moment).max() < MOMENTS * torque, moment / torque


@pytest.mark.parametrize("kind", every(DEAR))
def test_a_stage_at_rest_is_held_by_its_supports_and_ports(kind: Kind) -> None:
    """Where its input has made a third of a turn, drawn stages at the start."""
    is_at_rest(kind, 0.0 if isinstance(kind, Drawn) else 2 * math.pi / 3 / kind.speed)


def test_a_housed_stage_at_rest_is_held_by_its_feet() -> None:
    is_at_rest(HOUSED, 0.0, "rigid")


# ---- ports ----------------------------------------------------------------------------------------------------------
def steps_of_every_kind() -> Iterator[object]:
    """The default step for each kind, a quarter of it for two; the others and the dearest kind under make test-full."""
    for name in KINDS:
        for h in (1.25e-6, 2.5e-6, 5e-6, 10e-6):
            quick = name != "helical_set" and (h == 10e-6 or (h == 2.5e-6 and name in ("pair", "internal")))
            yield pytest.param(name, h, marks=() if quick else pytest.mark.full)


@pytest.mark.parametrize(("name", "h"), [*steps_of_every_kind()])
def test_the_speed_of_a_port_is_the_rate_of_its_angle(name: str, h: float) -> None:
    """A port that is given its torque, sampled every step: what its speed sums up to is how far it turns, although the
    bore's oscillators keep speeds of their own kind."""
    kind = KINDS[name]
    driven = kind.model().driven_by_springs()
    port, sections = driven.shafts.output, read_blob(driven.blob)
    kinds = np.array(sections["port_kinds"], np.int32).reshape(-1, 3)
    kinds[list(driven.stage.ports).index(port), 1] = TORQUE
    model = replace(driven, blob=write_blob(with_guid(sections | {"port_kinds": kinds})))
    torque, speed = at_rest(kind, 0.0)[f"{port}.tau"], loaded(kind)(0.0)[f"{port}.w"]

    def inputs(time: float) -> dict[str, float]:
        own = {n: value for n, value in loaded(kind)(time).items() if not n.startswith(f"{port}.")}
        return own | {f"{port}.tau": torque}

    out = simulate(model, inputs, 200 * h, h, at_level(model, h=h) | {f"{port}.w_start": speed})
    w, turned = out[f"{port}.w"], out[f"{port}.phi"][-1] - out[f"{port}.phi"][20]
    rate = turned / (out.time[-1] - out.time[20])
    assert np.trapezoid(w[20:], out.time[20:]) / (out.time[-1] - out.time[20]) == pytest.approx(rate, rel=RATE)


# ---- dashpots -------------------------------------------------------------------------------------------------------
@cache
def layout_of(kind: Kind) -> Layout:
    stage = kind.model().driven_by_springs().stage
    bodies = bodies_of(kind.file)
    carriers, gears = ([bodies[body.name] for body in of] for of in (stage.carriers, stage.gears))
    few = even_grids(stage, gears, 4)  # flanks of a gear are none of its supports
    return stage_layout(stage, gears, {body.name: body for body in carriers}, few)


@pytest.mark.parametrize("kind", every(DEAR))
def test_a_support_gives_its_force_by_spring_and_own_dashpot(kind: Kind) -> None:
    """Force − k·displacement = c·speed in every direction of every support that has a dashpot. On the ground of a set
    dashpots turn with the axes of the carrier (docs/theory, 3.10): their speed is that in these axes. Seen by it:
    dashpots of other supports in the force of a bearing; a displacement that is force over stiffness, dashpots
    included."""
    allowed = DRAWN_DASHPOT if isinstance(kind, Drawn) else DASHPOT
    model, layout = kind.model().driven_by_springs(), layout_of(kind)
    out = channels(simulate(model, loaded(kind), 80 * STEP, STEP, at_level(model, h=STEP)))
    turning = [out[f"{carrier.name}.gear.w"][1:-1] for carrier in model.stage.carriers]
    names = [*zip(layout.support_names(), layout.displacement_names(), strict=True)]
    constants = [(c, s.damping[i]) for s in layout.supports for i, c in enumerate(np.diag(s.compliance))]
    seen = 0
    parts: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for i, ((force, moved), (compliance, c)) in enumerate(zip(names, constants, strict=True)):
        if c == 0.0 or moved not in out:
            continue
        speed = (out[moved][2:] - out[moved][:-2]) / (2 * STEP)
        if turning and force.startswith("bearing.") and force[-1] in "xy":
            sense, beside = (1.0, i + 1) if force[-1] == "x" else (-1.0, i - 1)
            speed = speed + sense * turning[0] * out[names[beside][1]][1:-1]
        damped = (out[force] - out[moved] / compliance)[1:-1]
        parts.setdefault(force.rpartition(".")[0] + family(force), []).append((damped, c * speed))
        seen += 1
    assert seen
    largest: dict[str, float] = {}
    for name, own in parts.items():
        largest[name[-1]] = max(largest.get(name[-1], 0.0), *(rms(damped) for damped, _ in own))
    for name, own in parts.items():
        apart = max(rms(damped - by_hand) for damped, by_hand in own)
        assert apart < allowed * largest[name[-1]], (name, apart / largest[name[-1]])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


# ---- momentum -------------------------------------------------------------------------------------------------------
MOVED = [(name, effect) for name in ("pair", "helical", "internal") for effect in (None, "friction", "film")]
BESIDE = ("helical", None)  # runs with an effect have all that is in this one


@pytest.mark.parametrize(
    ("name", "effect"), [pytest.param(*one, marks=[pytest.mark.full] * (one == BESIDE)) for one in MOVED]
)
def test_forces_on_the_ground_are_the_rate_of_momentum(name: str, effect: str | None) -> None:
    """Σ m (x(t+H) − 2 x(t) + x(t−H))/H² against the means of both steps. Flanks, friction and film act between bodies,
    whatever they do. Seen by it: dashpots that bearing forces leave out."""
    kind, step = KINDS[name], 0.5 * STEP
    stage, bodies = kind.stage, bodies_of(kind.file)
    gears = [gear.name for gear in stage.gears]
    observed = assemble(stage, listed(stage, bodies), observe=gears).driven_by_springs()
    on = {f"effect.{effect}": 1.0} if effect else {}
    out = channels(simulate(observed, loaded(kind), 150 * step, step, at_level(observed, "full", h=step) | on))
    rate, force = 0.0, 0.0
    for gear in gears:
        turned = np.exp(1j * (tooth_phases(stage)[gear] + out[f"{gear}.gear.phi"]))
        place = turned * (out[f"{gear}.motion.x"] + 1j * out[f"{gear}.motion.y"])
        mean = out[f"bearing.{gear}.fx_mean"] + 1j * out[f"bearing.{gear}.fy_mean"]
        rate = rate + bodies[gear].total_mass * (place[2:] - 2 * place[1:-1] + place[:-2]) / step**2
        force = force + 0.5 * (mean[1:-1] + mean[2:])
    later = slice(START, None)
    assert rms(np.abs(rate + force)[later]) < MOMENTUM * rms(np.abs(force)[later])


# ---- energy ---------------------------------------------------------------------------------------------------------
def keeps_its_energy(kind: Kind, allowed: float = WORK, **parameters: float) -> float:
    """What friction and film took, over the energy that passed the ports."""
    model, inputs = kind.model().driven_by_springs(), loaded(kind)
    step = kind.step
    out = channels(simulate(model, inputs, 20 * step, step, at_level(model, **parameters)))
    speeds = {port: inputs(0.0)[f"{port}.w"] for port in kind.stage.ports}
    powers = {port: -out[f"{port}.tau_mean"][1:] * speed for port, speed in speeds.items()}
    through = sum(float(np.abs(power).sum()) * step for power in powers.values())
    work = np.cumsum(sum(powers.values())) * step
    assert np.abs(out["energy.work"][1:] - work).max() < allowed * through
    lost = out["energy.dissipated"]
    stored = out["energy.stored"] - out["energy.stored"][1]
    left = stored[1:] - (work - work[0]) + lost[1:] - lost[1]
    assert np.abs(left).max() < ENERGY * through, np.abs(left).max() / through
    known = sum(out[name] for name in out if name.endswith((".friction_loss", ".film_loss")))
    assert (np.diff(lost) > -1e-9 * through).all() and (np.diff(lost - known) > -1e-6 * through).all()
    return float(np.max(known)) / through


@pytest.mark.parametrize("kind", every(DEAR))
def test_power_of_the_ports_is_what_is_stored_and_lost(kind: Kind) -> None:
    """Seen by it: a planet whose teeth are placed by a branch of atan2 overlaps its neighbours, and the stage gains up
    to 6 % of what passes."""
    keeps_its_energy(kind, DRAWN_WORK if isinstance(kind, Drawn) else WORK)


@pytest.mark.parametrize(("name", "effect"), [("helical", "friction"), ("helical", "film"), ("set", "friction")])
def test_power_of_the_ports_is_what_is_stored_and_lost_with_oil(name: str, effect: str) -> None:
    meshes = KINDS[name].stage.engagements
    law = {f"{mesh.name}.friction_coefficient": 0.05 for mesh in meshes} if len(meshes) > 1 else {}
    taken = keeps_its_energy(KINDS[name], DRAWN_WORK if law else WORK, **{f"effect.{effect}": 1.0, **law})
    print(f"{name}, {effect}: {taken:.1e} of what passed the ports")
    assert effect == "film" or 1e-3 < taken < 2e-2


@pytest.mark.parametrize("kind", every(DEAR, seeds=()))
def test_a_stage_without_load_leaves_no_step_unsolved(kind: Kind) -> None:
    """Forces near zero are no measure of what has settled (gk_couple.c, NEGLIGIBLE)."""
    model = kind.model().driven_by_springs()
    trace = simulate(model, loaded(kind, 0.0), kind.duration, kind.step, at_level(model))
    assert trace["solver.retried_steps"][-1] == 0 and trace["solver.steps"][-1] > 90
