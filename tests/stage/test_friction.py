"""Friction of the flanks: exact solutions of a block on a spring, force across the line of action, energy, losses,
coefficients, what a stage file says of it, and the steps at which its γ is lowered. Gears are rigid where nothing else
is said: statics by hand then."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from driven import begun, give, stepped
from scipy.optimize import brentq

import gearfmu as gf
from evidence.energy.free import CONSERVING, FreePair, Rattle, energies, started
from gearfmu.body import Body, load_bodies
from gearfmu.errors import ModelError
from gearfmu.kernel import Kernel
from gearfmu.kernel.binding import status_words
from gearfmu.stage import StageModel, Steady, Trace, assemble, simulate
from gearfmu.stage.assembly.blob import GEAR_NUMBERS, read_blob
from gearfmu.stage.run.efficiency import loss_factor, mesh_efficiency
from gearfmu.stagefile.forms.expand import rewritten, with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.connections import FrictionSpec, PortSpec

RIGID = {"effect.elastic": 0.0, "level": 0.0, "effect.friction": 1.0}
EM = 1.0


# ---- a block on a spring: exact --------------------------------------------------------------------------------------


def rolls(blob: bytes, kernel: Kernel, t: float) -> tuple[float, float]:
    """Lengths of roll (m) of the tooth pair in contact on the drive flanks, where the gears of a started kernel stand;
    t: working pressure angle."""
    angle, approach = kernel.get("pinion.gear.phi"), kernel.get("mesh.te")
    sections = read_blob(blob)
    gears = [dict(zip(GEAR_NUMBERS, sections[f"gear{g}"], strict=True)) for g in (0, 1)]
    length = (gears[0]["r_b"] + gears[1]["r_b"]) * math.tan(t)
    pitch = 2 * math.pi / int(sections["size0"][1])
    found = [gears[0]["r_b"] * (gears[0]["phase"] + gears[0]["psi_b"] + k * pitch + angle + t) for k in range(-20, 20)]
    (roll,) = [s for s in found if length - gears[1]["s_tip"] < s < gears[0]["s_tip"]]
    return roll, length - roll + approach


def turning_points(block: Mapping[str, float], potential: Callable[[float], float], start: float) -> list[float]:
    """Angles of the pinion (rad) at which it turns back from rest at `start` under a torque of its own of `potential`
    (J, convex where it swings); the last: it stays.

    The normal force follows the motion, N = (τ_B + J_B r ä)/(r_B − µ s_B S) with S the sign of the sliding speed, so
    that what the wheel's torque and friction do to the pinion is a constant c_S of each sense, and between two turns
    the potential changes by what that constant does: masses do not matter.
    """
    b = block
    ratio = b["r_a"] / b["r_b"]
    arm = b["s_a"] - ratio * b["s_b"]

    def pull(sense: float) -> float:
        """Torque of wheel and friction on a pinion that turns with `sense`."""
        sliding = -math.copysign(1.0, arm) * sense
        friction = arm * b["mu"] * sliding * b["tau"] / (b["r_b"] - b["mu"] * b["s_b"] * sliding)
        return friction - ratio * b["tau"]

    def slope(angle: float) -> float:
        return (potential(angle + 1e-6) - potential(angle - 1e-6)) / 2e-6

    points = [start]
    while len(points) < 50:
        here = points[-1]
        senses = [sense for sense in (-1.0, 1.0) if sense * (pull(sense) - slope(here)) > 0]
        if not senses:
            return points
        (sense,) = senses

        def left(angle: float, here: float = here, sense: float = sense) -> float:
            return potential(angle) - potential(here) - pull(sense) * (angle - here)

        ahead = here + sense * 1e-4 * np.arange(1, 1000)
        past = next(k for k, angle in enumerate(ahead) if left(angle) > 0)
        points.append(float(brentq(left, ahead[past - 1], ahead[past], xtol=1e-14)))
    raise AssertionError("it does not come to rest")


def swinging(spec: Stage, bodies: Sequence[Any], port: PortSpec) -> bytes:
    ports = {"pinion": port, "wheel": PortSpec(kind="torque")}
    pair = FreePair(with_ports(spec, ports), bodies)
    return pair.place(Rattle(position=0.62, load=1.0))


MU = 0.3
WEIGHT, TIMES, FALL_STEP = 0.175, 60.0, 1e-5  # of the pendulum: N m, turns of its arm per turn of the pinion, s
FROZEN = {**CONSERVING, **RIGID, "effect.bearings": 0.0, "effect.hertz": 0.0, "effect.tip_relief": 0.0}


def extremes(path: np.ndarray, least: float) -> list[float]:
    """Values at which `path` turns back by more than `least`; not its start."""
    found, low, high, way = [], path[0], path[0], 0
    for value in path:
        low, high = min(low, value), max(high, value)
        if way >= 0 and value < high - least:
            if way:
                found.append(float(high))
            low, way = value, -1
        elif way <= 0 and value > low + least:
            if way:
                found.append(float(low))
            high, way = value, 1
    return found


def swing(
    spec: Stage,
    blob: bytes,
    kernel: Kernel,
    act: Callable[[int], None],
    potential: Callable[[float], float],
    steps: int,
) -> tuple[float, float]:
    """A started kernel against the exact solution: largest error of turning points and of the place where it stays (the
    mean over the last swings of the elastic contact), over the first swing; energy that friction took in those swings
    over what it took at all. `act`: what is done before each step; of `potential` (J)."""
    h, torque = kernel.get("h"), kernel.get("wheel.tau")
    geometry = spec.written.geometry
    s_a, s_b = rolls(blob, kernel, geometry.alpha_wt)
    r_a, r_b = (gear.r_b for gear in geometry.gears)
    block = dict(r_a=r_a, r_b=r_b, s_a=s_a, s_b=s_b, mu=MU, tau=torque)
    expected = turning_points(block, potential, kernel.get("pinion.gear.phi"))
    phi, lost = stepped(kernel, steps, h, "pinion.gear.phi", "mesh.friction_loss", before=act).T
    assert kernel.get("mesh.pairs") == 1 and len(expected) > 10 and kernel.get("solver.retried_steps") == 0
    first, late = abs(expected[1] - expected[0]), -steps // 10
    found = [*extremes(phi, 0.005 * first)[: len(expected) - 2], phi[late:].mean()]
    error = np.max(np.abs(np.array(found) - expected[1:])) / first
    return float(error), float((lost[-1] - lost[late]) / lost[-1])


@pytest.mark.parametrize("integrator", [0.0, EM])
def test_a_block_on_a_spring_swings_and_sticks_as_its_exact_solution(
    spec: Stage, bodies: list[Body], integrator: float
) -> None:
    """Pinion on a soft spring, wheel under a torque, one tooth pair that slides at a frozen position: the turning
    points shrink by the friction, then it stands still. The spring yields 10³ times as much as the contact."""
    stiffness, outer = 2e3, -8e-3
    blob = swinging(spec, bodies, PortSpec(kind="spring", k=stiffness, c=0.0))
    kernel = Kernel(blob, {**FROZEN, "friction_coefficient": MU, "h": 1e-5, "integrator": integrator})
    begun(kernel, {"wheel.tau": 30.0})

    def turn(_: int) -> None:
        give(kernel, {"pinion.phi": outer, "pinion.w": 0.0})

    error, slipped = swing(spec, blob, kernel, turn, lambda angle: 0.5 * stiffness * (angle - outer) ** 2, 10000)
    assert error < 5e-3 and abs(slipped) < 1e-5


def pendulum(
    spec: Stage, bodies: list[Body], torque: float, mu: float = MU
) -> tuple[bytes, Kernel, Callable[[int], None], float]:
    """Blob and kernel of the block with a weight on an arm that turns 60 times as far as the pinion; what sets its
    torque for the angle in the middle of the next step; the angle where it hangs."""
    blob = swinging(spec, bodies, PortSpec(kind="torque"))
    kernel = Kernel(blob, {**FROZEN, "friction_coefficient": mu, "h": FALL_STEP})
    r_a, r_b = (gear.r_b for gear in spec.written.geometry.gears)
    begun(kernel, {"wheel.tau": torque, "pinion.tau": torque * r_a / r_b})
    hangs = kernel.get("pinion.gear.phi") + 5e-4

    def fall(_: int) -> None:
        angle = kernel.get("pinion.gear.phi") + 0.5 * FALL_STEP * kernel.get("pinion.gear.w")
        kernel.set("pinion.tau", -WEIGHT * TIMES * math.sin(TIMES * (angle - hangs)))

    return blob, kernel, fall, hangs


def test_a_pendulum_swings_and_sticks_as_its_exact_solution(spec: Stage, bodies: list[Body]) -> None:
    """The same with a weight on an arm that turns 60 times as far as the pinion instead of the spring, swinging by 30°
    about where the wheel lifts it to: its torque is set before each step for the angle in its middle."""
    blob, kernel, fall, hangs = pendulum(spec, bodies, 7.5)
    error, slipped = swing(spec, blob, kernel, fall, lambda angle: -WEIGHT * math.cos(TIMES * (angle - hangs)), 30000)
    assert error < 5e-3 and abs(slipped) < 1e-5


@pytest.mark.parametrize("more", [0, 4, 5, 13, 14, 21, 28])
def test_a_flank_that_is_grazed_and_rubs_is_solved(spec: Stage, bodies: list[Body], more: int) -> None:
    """The first swing leaves and grazes the flank again and again. For the scalar that gives the invariant's jump back
    friction then changes sides for ever: the step goes without the jump."""
    _, kernel, fall, _ = pendulum(spec, bodies, 7.5 * (1 + 3e-3 * more))
    force = stepped(kernel, 200, FALL_STEP, "mesh.force", before=fall)
    assert kernel.get("solver.retried_steps") == 0 and np.sum(force == 0.0) > 20


def test_friction_that_finds_no_side_is_told(spec: Stage, bodies: list[Body]) -> None:
    """One step of this swing has none even without the scalar. A scalar that was found afterwards hid it."""
    _, kernel, fall, _ = pendulum(spec, bodies, 7.5 * 1.003, 0.1)
    stepped(kernel, 1200, FALL_STEP, before=fall)
    assert kernel.get("solver.retried_steps") == 1 and int(kernel.get("solver.status")) & 4


def test_below_the_limit_of_friction_nothing_moves(spec: Stage, bodies: list[Body]) -> None:
    """A torque that friction can hold: no creep, although friction fades with the speed of the pinion."""
    blob = swinging(spec, bodies, PortSpec(kind="spring", k=2e4, c=0.0))
    frozen = {**CONSERVING, **RIGID, "effect.bearings": 0.0}
    kernel = Kernel(blob, {**frozen, "friction_coefficient": 0.3})
    begun(kernel, {"wheel.tau": 300.0})
    give(kernel, {"pinion.phi": -0.1e-3, "pinion.w": 0.0})
    s_a, s_b = rolls(blob, kernel, spec.written.geometry.alpha_wt)
    slid = stepped(kernel, 100, 1e-3, "pinion.gear.phi", "wheel.gear.phi") @ (s_a, s_b)
    free, lost = 0.1e-3 * s_a, kernel.get("mesh.friction_loss")
    drift = abs(np.mean(slid[50:]) - np.mean(slid[:50]))
    assert abs(lost) < 1e-12 and drift < 2e-4 * free  # it yields and rings, undamped
    assert np.ptp(slid) < 3e-3 * free  # 2.4e-3 at 1 ms, what shorter steps converge to: 2.3e-3 … 2.4e-3


# ---- energy ----------------------------------------------------------------------------------------------------------
STARTS = (
    Rattle(position=0.3),
    Rattle(position=0.3, load=100.0, speed=0.05),
    Rattle(position=0.8, load=302.0, speed=0.05),
)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("h", [5e-6, 10e-6])
def test_friction_takes_what_the_energy_loses(pair_free: FreePair, start: Rattle, h: float) -> None:
    """Mesh damping off, frozen position: stored energy and what friction took are constant; it never grows."""
    kernel = started(pair_free, start, {**RIGID, "h": h, "friction_coefficient": 0.1})
    found = energies(kernel, h, 0.02)
    highest = np.max(found.total - np.minimum.accumulate(found.total)) / found.kinetic
    assert found.drift < 1e-5 and highest < 5e-5 * found.stored[0] / found.kinetic + 1e-6
    assert found.dissipated[-1] > 1e-4 * found.kinetic


# ---- forces and losses -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("rpm", [60, 300])
def test_force_across_the_line_of_action_jumps_at_the_pitch_point(spec: Stage, bodies: list[Body], rpm: float) -> None:
    """The off-line force of the pinion's bearing changes by 2 µ F where sliding changes its sign, at any speed."""
    mu, speed, angle = 0.06, rpm * math.pi / 30, spec.written.geometry.alpha_wt
    model = assemble(spec, bodies)
    pitch = 2 * math.pi / (16 * speed)
    run = {**RIGID, "friction_coefficient": mu, "h": 10e-6}
    trace = simulate(model, Steady(model, speed, 100.0), 1.2 * pitch, pitch / 2000, run)
    across = math.cos(angle) * trace["bearing.pinion.fx"] - math.sin(angle) * trace["bearing.pinion.fy"]
    single = (trace["mesh.pairs"][1:] == 1) & (across[1:] * across[:-1] < 0)
    at = 200 + int(np.flatnonzero(single[200:])[0])
    before, after = np.arange(at - 360, at - 60), np.arange(at + 60, at + 360)  # clear of where friction fades
    jump = abs(
        np.polyval(np.polyfit(after, across[after], 1), at) - np.polyval(np.polyfit(before, across[before], 1), at)
    )
    force = 2 * mu * trace["mesh.force"][at - 360 : at + 360].mean()
    assert jump == pytest.approx(force, rel=0.01)


def test_the_tooth_loss_factor_is_the_integral_of_an_evenly_shared_load(spec: Stage) -> None:
    """Ohlendorf's H_V against Σ |v| of all pairs on the path, each with its share, over a base pitch."""
    pair = spec.written.geometry
    path, p = pair.path, pair.base_pitch
    positions = (np.arange(20000) + 0.5) / 20000 * p
    slides, pairs = np.zeros(20000), np.zeros(20000)
    for k in range(-1, 3):
        roll = path["A"] + positions + k * p
        on = (roll >= path["A"]) & (roll <= path["E"])
        slides += on * np.abs(roll - path["C"])
        pairs += on
    r_a, r_b = (gear.r_b for gear in pair.gears)
    assert loss_factor(pair) == pytest.approx(np.mean(slides / pairs) * (1 / r_a + 1 / r_b), rel=1e-4)


def test_efficiency_of_a_run_stands_beside_the_closed_form(spec: Stage, bodies: list[Body]) -> None:
    """A spur pair with a constant coefficient: teeth that yield share the load more gently than evenly, so that the
    run loses less, but not by a tenth."""
    found = mesh_efficiency(assemble(spec, bodies), 302.0, 200.0, {"level": 0.0, "friction_coefficient": 0.05})
    assert found.meshes["mesh"].coefficient == pytest.approx(0.05, rel=0.02) and found.retried_steps == 0
    assert found.lost == pytest.approx(found.closed, rel=0.1)
    assert 0.98 < found.efficiency < 1.0


@pytest.mark.full
def test_efficiency_of_a_set_counts_the_power_that_rolls() -> None:
    """Of a held ring the sun rolls under ω_s − ω_c: (z_r/(z_s + z_r)) P through all sun meshes, and as much through
    those of the ring. The torque ports of the set are driven through springs."""
    found = mesh_efficiency(gf.assemble("planetary54"), 400.0, 50.0, {"level": 0.0}, settles=2e-3, pitches=2)
    rolling = [sum(m.power for name, m in found.meshes.items() if name.startswith(g)) for g in ("sun", "ring")]
    assert rolling == pytest.approx([0.75 * found.power] * 2)
    assert 0.8 * found.closed < found.lost < found.closed and 0.98 < found.efficiency < 1.0
    ring = found.meshes["ring_planet1"].loss_factor
    assert 0 < ring < 0.4 * found.meshes["sun_planet1"].loss_factor, "flanks of a ring slide less"


# ---- coefficients ----------------------------------------------------------------------------------------------------
def test_a_run_takes_the_coefficient_of_iso_tr_14179(helical: StageModel) -> None:
    """By hand, with the load and the rolling speeds of the run."""
    drive = Steady(helical, 100.0, 100.0)
    common = {"level": 0.0, "slices": 1.0}
    law = {"effect.friction": 1.0, "friction_law": 2.0, "oil_viscosity": 0.04, "flank_roughness": 0.5e-6}
    dry, rubbing = (simulate(helical, drive, 4e-4, 1e-4, common | more) for more in ({}, law))
    pair = helical.stage.written.geometry
    a, b = pair.gears
    pitch = [pair.length * gear.r_b / (a.r_b + b.r_b) for gear in (a, b)]
    rho = 1e3 * pitch[0] * pitch[1] / sum(pitch) / math.cos(a.beta_b)
    load = dry["mesh.force"][-1] / (1e3 * min(gear.face_width for gear in helical.stage.gears))
    expected = 0.048 * (load / (100.0 * 2 * pitch[0] * rho)) ** 0.2 * 40.0**-0.05 * 0.5**0.25
    assert rubbing["mesh.friction_ratio"][-1] == pytest.approx(expected, rel=0.01)


# ---- what a stage says -----------------------------------------------------------------------------------------------
def test_a_stage_file_turns_friction_on(helical: StageModel) -> None:
    own = FrictionSpec(law="iso_tr_14179", viscosity=0.05, roughness=1e-6)
    stage = helical.stage
    stage = rewritten(stage, contact=stage.written.contact.model_copy(update={"friction": own}))
    kernel = assemble(stage, load_bodies(stage)).kernel()
    names = ("effect.friction", "friction_law", "oil_viscosity", "flank_roughness")
    assert [kernel.get(name) for name in names] == [1.0, 2.0, 0.05, 1e-6]


def test_bodies_that_do_not_know_their_profile_are_refused(spec: Stage, bodies: list[Body]) -> None:
    bare = [replace(body, flank=replace(body.flank, tangent=None)) for body in bodies]
    with pytest.raises(ModelError, match="reduce its body again"):
        assemble(spec, bare).kernel(**{"effect.friction": 1.0}).prepare()


@pytest.mark.parametrize("integrator", [2.0, 3.0])
def test_other_integrators_refuse_friction(helical: StageModel, integrator: float) -> None:
    with pytest.raises(ModelError, match="integrator dg4 or em"):
        helical.kernel(**{"effect.friction": 1.0, "integrator": integrator}).prepare()


# ---- steps at which friction used to make forces alternate: γ is lowered there, and there alone ----------------------
def rubbing(h: float, on: bool = True) -> dict[str, float]:
    return {"level": 1.0, "h": h, "effect.friction": float(on), "friction_coefficient": 0.1}


def rolling(model: StageModel, h: float, on: bool = True) -> Trace:
    """4 ms, every internal step recorded."""
    return simulate(model, Steady(model, 2000 * math.pi / 30, 600.0), 4e-3, h, rubbing(h, on))


@pytest.mark.parametrize("h", [3.4e-6, 3.57e-6, 3.7e-6])
def test_forces_do_not_alternate_from_step_to_step(relieved: StageModel, h: float) -> None:
    """With the limit of frictionless contact the second difference of the force was 0.8 to 1.5 of its mean."""
    trace = rolling(relieved, h)
    force = trace["mesh.force"]
    assert np.std(np.diff(force, 2)) < 0.03 * np.mean(force)
    assert trace["solver.retried_steps"][-1] == 0


@pytest.mark.parametrize("h", [3.2e-6, 3.73e-6, 3.9e-6])
def test_contacts_that_stick_are_stable_at_rest(relieved: StageModel, h: float) -> None:
    """Friction that follows the gaps takes from their compliance: by the limits of free and sliding contacts these runs
    ended within 22 ms, half of their steps unsolved."""
    trace = simulate(relieved, Steady(relieved, 0.0, 302.0), 0.03, 1e-3, rubbing(h))
    late = trace["mesh.force"][-5:]
    assert trace["solver.retried_steps"][-1] == 0
    assert np.ptp(late) < 1e-3 * np.mean(late)


@pytest.mark.parametrize(("h", "on", "lowered"), [(5e-6, True, False), (3.57e-6, False, False), (3.57e-6, True, True)])
def test_gamma_is_lowered_by_friction_alone(relieved: StageModel, h: float, on: bool, lowered: bool) -> None:
    status = int(rolling(relieved, h, on)["solver.status"][-1])
    assert any("gamma" in word for word in status_words(status)) is lowered, status_words(status)
