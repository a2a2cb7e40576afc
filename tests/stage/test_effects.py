"""Every effect on and off against calculation by hand (by_hand.py), the one table of effects against the kernel, and
sizes of the terms of turning axes in a stage."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import small_gear
from by_hand import DRIVE, Pair, bore_angle

from gearfmu import cli
from gearfmu.body import Body
from gearfmu.errors import ModelError
from gearfmu.geometry import PairGeometry
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.scenefile.scene import Effects
from gearfmu.stage import StageModel, Steady, Trace, assemble, loaded_te, simulate
from gearfmu.stage.effects import EFFECTS, costs, torque_on_flanks_alone
from gearfmu.stage.run.inertia import gear_inertia, largest_speeds
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import PortSpec

LOAD = 302.0
TORQUE, SPEED, START = 50.0, 10.0, 20e-6  # N·m, rad/s, s
ROOT = Path(__file__).resolve().parents[2]
RAISED = (100.0, 150.0)
PITCH = 2 * math.pi / 24  # rad, of the wheel
SINGLE = 0.75  # position with one tooth pair in contact
RIGID, STANDARD, FULL, PAPER = 0.0, 2.0, 3.0, 4.0
HELD = {"effect.bearings": 0.0}
STIFF = {"effect.elastic": 0.0}
APART = HELD | {"effect.coast_flank": 0.0}


@pytest.fixture(scope="module")
def hand(spec: Stage, bodies: list[Body]) -> Pair:
    return Pair(spec, bodies)


@pytest.fixture(scope="module")
def free(spec: Stage, bodies: list[Body]) -> StageModel:
    """Given torques on both shafts."""
    ports = {gear.name: PortSpec(kind="torque") for gear in spec.gears}
    return assemble(with_ports(spec, ports), bodies)


def state(model: StageModel, position: float, torque: float, **parameters: float):
    return statics_of(model, **parameters).transmission(-position * PITCH, torque)


def te(model: StageModel, position: float, torque: float, **parameters: float) -> float:
    return state(model, position, torque, **parameters).te


def spun(free: StageModel, parameters: Mapping[str, float], duration: float = 200e-6) -> Trace:
    """The gears part at 10 rad/s of the wheel; from START on a torque turns it further."""
    torque = lambda time: {"wheel.tau": -TORQUE * (time > START - 0.5e-6)}  # noqa: E731
    return simulate(free, torque, duration, 1e-6, {"h": 1e-6, "wheel.w_start": -SPEED, **parameters})


def turned(trace: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Time (s) for which the torque has been acting, and the wheel's angle (rad) in excess of its first speed, in the
    sense of the torque."""
    return np.maximum(trace.time - START, 0.0), -trace["wheel.gear.phi"] - SPEED * trace.time


def test_elastic(plain: StageModel, hand: Pair) -> None:
    """Off: one pair deflects by the Hertz law between rigid gears. On: and by finite-element statics."""
    (rolls,) = hand.rolls(SINGLE).values()
    rigid, elastic = hand.te(SINGLE, LOAD), hand.te(SINGLE, LOAD, elastic=hand.compliance(rolls, 5))
    off, on = te(plain, SINGLE, LOAD, **HELD | STIFF), te(plain, SINGLE, LOAD, **HELD)
    assert off == pytest.approx(rigid, rel=1e-4) and on == pytest.approx(elastic, rel=2e-3)
    assert on > 3 * off


@pytest.mark.parametrize("level", [RIGID, STANDARD, FULL])
def test_elastic_off_leaves_a_rigid_gear(free: StageModel, bodies: list[Body], level: float) -> None:
    """A sudden torque on a free gear: φ = τt²/2J, to rounding, at every level; no modes are left."""
    trace = spun(free, {"level": level, **APART, **STIFF})
    time, angle = turned(trace)
    by_hand = TORQUE * 0.5 * time**2 / bodies[1].inertia[2, 2]
    assert trace.meta["n_dyn"] == 0 and np.allclose(angle, by_hand, rtol=1e-5, atol=1e-4 * by_hand[-1])


@pytest.mark.parametrize("level", [RIGID, STANDARD, FULL])
def test_modes(free: StageModel, bodies: list[Body], level: float) -> None:
    """The bore of a free gear under a sudden torque: rigid body, static share at once, and the torsional modes below
    the cut of the level ring about theirs. Off (rigid): all of it is there at once."""
    cut = {RIGID: 0.0, STANDARD: free.stage.levels.standard_cut, FULL: math.inf}[level]
    assert elastic_angle_error(spun(free, {"level": level, **APART}), bodies[1], cut, damped=True) < 0.02


def test_modal_damping(free: StageModel, bodies: list[Body]) -> None:
    """Off: the torsional modes ring without end; on: they decay with ζω."""
    for damped in (False, True):
        trace = spun(free, {"level": FULL, "effect.modal_damping": damped, **APART})
        assert elastic_angle_error(trace, bodies[1], math.inf, damped) < 0.02
        assert elastic_angle_error(trace, bodies[1], math.inf, not damped) > 0.05


def elastic_angle_error(trace: Trace, body: Body, cut: float, damped: bool) -> float:
    """Largest error of the bore's angle against theory, in parts of the largest elastic angle."""
    time, angle = turned(trace)
    acting = time > 1e-6
    by_hand = TORQUE * bore_angle(body, time, cut, damped)[acting]
    largest = (by_hand - TORQUE * 0.5 * time[acting] ** 2 / body.inertia[2, 2]).max()
    error = float(np.abs(angle[acting] - by_hand).max() / largest)
    return error


def test_residual(plain: StageModel, hand: Pair) -> None:
    """One pair, axes held. Off (level paper): what 400 modes a gear give. On: what the finite elements give."""
    (rolls,) = hand.rolls(SINGLE).values()
    for level, modes_only in ((PAPER, True), (FULL, False)):
        by_hand = hand.te(SINGLE, LOAD, elastic=hand.compliance(rolls, 5, modes_only))
        found = te(plain, SINGLE, LOAD, level=level, **HELD)
        assert found == pytest.approx(by_hand, rel=6e-3 if modes_only else 2e-3)  # bores are held with all they yield
    with pytest.raises(ModelError, match=r"effect\.residual"):
        te(plain, SINGLE, LOAD, **{"effect.residual": 0.0})


@pytest.mark.parametrize("torque", [3.0, 80.0, LOAD, 600.0])
def test_hertz(plain: StageModel, hand: Pair, torque: float) -> None:
    """Off: the secant of the law at torque_max, a straight line. On: the logarithm."""
    (rolls,) = hand.rolls(SINGLE).values()
    elastic = hand.compliance(rolls, 5)
    for on in (0.0, 1.0):
        found = te(plain, SINGLE, torque, **HELD, **{"effect.hertz": on})
        assert found == pytest.approx(hand.te(SINGLE, torque, bool(on), elastic), rel=2e-3)
        found = te(plain, SINGLE, torque, **HELD, **STIFF, **{"effect.hertz": on})
        assert found == pytest.approx(hand.te(SINGLE, torque, bool(on)), rel=1e-3)


@pytest.mark.parametrize("slices", [1, 3, 5, 10])
def test_slices(plain: StageModel, hand: Pair, slices: int) -> None:
    """Between rigid gears a slice carries what its width is; elastic teeth load the middle more. Off (1 slice): the
    load is uniform, and te the same within 0.1 %."""
    (rolls,) = hand.rolls(SINGLE).values()
    te_by_hand, shares_by_hand = hand.spread(SINGLE, LOAD, hand.compliance(rolls, slices))
    found = state(plain, SINGLE, LOAD, slices=slices, **HELD)
    ((_, forces),) = ((key, f) for key, f in found.forces.items() if sum(f) > 0)
    shares = np.array(forces) / sum(forces)
    assert found.te == pytest.approx(te_by_hand, rel=2e-3)
    assert np.allclose(slices * shares, slices * shares_by_hand, atol=5e-3)
    rigid = state(plain, SINGLE, LOAD, slices=slices, **HELD, **STIFF)
    assert rigid.te == pytest.approx(hand.te(SINGLE, LOAD), rel=1e-4)
    for force in next(f for f in rigid.forces.values() if sum(f) > 0):
        assert force == pytest.approx(LOAD / hand.geometry.gears[0].r_b / slices, rel=1e-4)


def test_coast_flank(free: StageModel, bodies: list[Body], pair: PairGeometry) -> None:
    """A torque parts the flanks. Off: the pinion turns on, φ = τt²/2J, through the backlash and beyond. On: until it
    has crossed the backlash, then no further than the coast flanks yield."""
    both = {on: spun(free, {**HELD, **STIFF, "effect.coast_flank": on}, 600e-6) for on in (0.0, 1.0)}
    time, _ = turned(both[0.0])
    fall = -bodies[1].flank.r_b * (SPEED * both[0.0].time + TORQUE * 0.5 * time**2 / bodies[1].inertia[2, 2])
    off, on = both[0.0]["mesh.te"], both[1.0]["mesh.te"]
    assert np.allclose(off, fall, rtol=1e-4, atol=1e-9) and fall[-1] < -3 * pair.normal_backlash
    met = np.argmax(fall < -pair.normal_backlash)
    assert np.allclose(on[: met - 1], off[: met - 1], atol=1e-12) and np.all(
        both[1.0]["mesh.force_coast"][: met - 1] == 0
    )
    assert both[1.0]["mesh.force_coast"][met:].max() > 1000 and on.min() > -pair.normal_backlash - 10e-6


@pytest.mark.parametrize("damping", [0.0, 30e3, 120e3])
def test_contact_damping(free: StageModel, hand: Pair, damping: float) -> None:
    """Rigid gears on the linear law: one oscillator, m ÿ + c b ẏ + k y = F, after a step of the torque. Off: nothing
    decays."""
    (rolls,) = hand.rolls(0.0).values()
    pinion, wheel = ((body.inertia[2, 2], body.flank.r_b) for body in hand.bodies)
    mass = 1 / (pinion[1] ** 2 / pinion[0] + wheel[1] ** 2 / wheel[0])
    stiffness = hand.width / hand.secant(rolls)
    omega = math.sqrt(stiffness / mass)
    zeta = damping * hand.width / (2 * math.sqrt(stiffness * mass))
    force = [torque / pinion[1] for torque in RAISED]
    switches = {"effect.contact_damping": float(damping > 0), "effect.hertz": 0.0, "contact_damping": damping or 15e3,
                "effect.tip_contact": 0.0}  # fmt: skip
    trace = simulate(free, _load_step(wheel[1] / pinion[1]), 1e-3, 2e-6, {"h": 1e-6, **APART, **STIFF, **switches})
    y, time = trace["mesh.te"], trace.time
    phase, decay = omega * math.sqrt(1 - zeta**2) * time, np.exp(-zeta * omega * time)
    step = (force[1] - force[0]) / stiffness
    ring = decay * (np.cos(phase) + zeta / math.sqrt(1 - zeta**2) * np.sin(phase))
    by_hand = force[1] / stiffness - step * ring
    error = np.abs(y - by_hand)[2:].max() / step
    assert error < 0.02 and trace["mesh.contact"].min() == 1


def test_tip_relief(relieved: StageModel, relief_spec: Stage, pair: PairGeometry) -> None:
    """Unloaded: te is the smallest depth of relief, both gears together, among the pairs on their flanks. Off: none."""
    flanks = {"effect.tip_contact": 0.0}
    off = loaded_te(relieved, [0.0], 24, **flanks, **{"effect.tip_relief": 0.0})
    on = loaded_te(relieved, [0.0], 24, **flanks)
    by_hand = [
        min(depth(relief_spec, pair, rolls) for rolls in Pair(relief_spec, ()).rolls(p).values()) for p in on.position
    ]
    assert np.abs(off.te).max() < 5e-9 and max(by_hand) > 0.5e-6
    assert np.allclose(on.te[0], by_hand, atol=1e-8)


def depth(spec: Stage, pair: PairGeometry, rolls: tuple[float, float]) -> float:
    """δ_A + δ_B of quadratic relief."""
    total = 0.0
    for gear, shape, roll in zip(spec.gears, pair.gears, rolls, strict=True):
        start = gear.tip_relief.start_roll
        total += gear.tip_relief.amount * max(0.0, (roll - start) / (shape.s_a - start)) ** 2
    return total


@pytest.mark.parametrize("beyond", [0.1e-3, 0.2e-3, 0.3e-3])
def test_tip_contact(plain: StageModel, hand: Pair, beyond: float) -> None:
    """Rigid gears, the pinion's tip past the end of the flank: it touches when the approach of the pair that carries
    has closed the corner's gap, not before, and then takes its share. Off: it never does."""
    position = (hand.geometry.gears[0].s_tip + beyond - _roll_at_zero(hand)) / hand.geometry.base_pitch
    gap = hand.corner(position, 0)[0]
    (rolls,) = hand.rolls(position).values()
    touching = hand.touch_torque(rolls, gap)
    for torque, closed in ((0.97 * touching, False), (1.03 * touching, True), (3 * touching, True)):
        on, off = (state(plain, position, torque, **HELD | STIFF, **{"effect.tip_contact": f}) for f in (1.0, 0.0))
        assert off.te == pytest.approx(hand.te(position, torque), rel=1e-3)
        assert (sum(sum(f) > 0 for f in on.forces.values()) == 2) is closed
        assert on.te == pytest.approx(off.te, rel=1e-9) if not closed else gap < on.te < off.te


@pytest.mark.parametrize("beyond", [0.1e-3, 0.2e-3, 0.4e-3])
def test_a_tip_corner_yields_by_the_law_with_the_curvature_of_its_edge(
    plain: StageModel, hand: Pair, beyond: float
) -> None:
    """Rigid gears: what the corner gives way under its share of the load is how far the two have come closer."""
    pinion = hand.geometry.gears[0]
    position = (pinion.s_tip + beyond - _roll_at_zero(hand)) / hand.geometry.base_pitch
    (rolls,) = hand.rolls(position).values()
    found = state(plain, position, 4 * hand.touch_torque(rolls, hand.corner(position, 0)[0]), **HELD | STIFF)
    gap, roll = hand.corner(position, 0, found.te)
    load = sum(found.forces[DRIVE, 0]) / hand.width
    by_hand = hand.corner_approach(beyond + found.te, roll, load)
    assert load > 1e3 and -gap == pytest.approx(by_hand, rel=1e-4)


def test_tip_contact_off_is_exact_until_a_loaded_flank_ends(relieved: StageModel) -> None:
    """Below the torque at which corners begin to carry: nothing changes. Above: a loaded pair vanishes, and bit 16 of
    the status says so."""
    limit = torque_on_flanks_alone(relieved)
    for torque, ended in ((0.8 * limit, 0), (2 * limit, 16)):
        inputs = Steady(relieved, 200.0, torque)
        on, off = (simulate(relieved, inputs, 4e-3, 5e-5, {"level": 1, "effect.tip_contact": f}) for f in (1, 0))
        assert not np.any(on["solver.status"] & 16) and off["solver.status"][-1] & 16 == ended
        moved = np.abs(on["mesh.te"] - off["mesh.te"]).max() / on["mesh.te"].std()
        assert moved > 0.1 if ended else moved < 1e-5


def _roll_at_zero(hand: Pair) -> float:
    return hand.geometry.gears[0].r_b * (hand.geometry.gears[0].psi_b + hand.geometry.alpha_wt)


def test_bearings(plain: StageModel, hand: Pair) -> None:
    """Between rigid gears on held axes te is the local law's; bearings add F/k each. Off in motion: axes stay."""
    springs = sum(1 / gear.bearing.stiffness for gear in hand.spec.written.gears)
    force = LOAD / hand.geometry.gears[0].r_b
    off, on = (te(plain, SINGLE, LOAD, **STIFF, **{"effect.bearings": flag}) for flag in (0.0, 1.0))
    assert off == pytest.approx(hand.te(SINGLE, LOAD), rel=1e-4)
    assert on - off == pytest.approx(force * springs, rel=2.5e-2)  # the bore yields in series with its bearing


def test_roll_motion(plain: StageModel, hand: Pair) -> None:
    """Rigid gears turn by more than a pitch. Off: the one pair of the start carries all along, te is its law under the
    force of the moment. On: a second pair takes its part wherever there are two."""
    inputs = Steady(plain, 200.0, LOAD)
    for on in (0.0, 1.0):
        flanks = {"effect.tip_contact": 0.0, "effect.coast_flank": 0.0, "effect.roll_motion": on}
        trace = simulate(plain, inputs, 3e-3, 20e-6, {"level": RIGID, "h": 2e-6, **HELD, **STIFF, **flanks})
        by_hand = [hand.te(0.0, force * hand.geometry.gears[0].r_b) for force in trace["mesh.force"]]
        assert (trace["mesh.pairs"].max() == 2) == bool(on)
        off_by = np.abs(trace["mesh.te"] / by_hand - 1).max()
        assert off_by > 0.2 if on else off_by < 2e-3


def _load_step(ratio: float) -> Callable[[float], dict[str, float]]:
    """Torques that hold each other: of the static start, then raised at once."""
    start = iter(RAISED[:1])

    def torques(time: float) -> dict[str, float]:
        torque = next(start, RAISED[1])
        return {"pinion.tau": torque, "wheel.tau": torque * ratio}

    return torques


def test_the_table_has_every_switch_of_the_kernel(plain: StageModel) -> None:
    """Every effect.* variable is an effect that a scene can switch, and every one says the same of itself. A pair has
    not those of a carrier, and one with nominal flanks that run true none of these."""
    variables = {name.removeprefix("effect.") for name in plain.kernel().variables if name.startswith("effect.")}
    names = [effect.name for effect in EFFECTS]
    of_others = {effect.name for effect in EFFECTS if effect.carried or effect.of_data}
    assert len(set(names)) == len(names) and variables <= set(names)
    assert set(Effects.model_fields) - of_others == variables and not variables & of_others
    for effect in EFFECTS:
        if effect.name not in of_others:
            plain.kernel(**effect.off_setting).prepare()


def test_builds_leave_out_the_effects_of_the_kernels_table() -> None:
    table = (ROOT / "gearfmu" / "kernel" / "src" / "model" / "gk_effects.inc").read_text(encoding="utf-8")
    names = re.findall(r"^GK_(?:EFFECT|PART)\((\w+)", table, re.MULTILINE)
    assert sorted(names) == sorted(effect.name for effect in EFFECTS)


def test_what_is_off_costs_nothing() -> None:
    """At most 5 % more instructions than a kernel compiled without it, by the table in the package, which the
    documentation shows. evidence.price.effects_cost, which makes it, fails where a run with the effect off has other
    bits, too."""
    found = costs()
    assert list(found) == [effect.name for effect in EFFECTS]
    for cost in found.values():
        assert math.isfinite(cost.share) and -0.05 < cost.price_of_off <= 0.05, cost


def test_the_verb_prints_the_table_with_the_numbers_of_a_stage(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.outcome(["effects", "fzg_c/stage_relief"]) == 0
    out = capsys.readouterr().out
    assert all(f"{effect.name}: {effect.title}\n" in out for effect in EFFECTS)
    assert out.count("\n  in the stage  ") == len(EFFECTS) + 2  # and what is left out, of both gears
    assert "15 µm and 15 µm" in out and "5 over 14 mm" in out


# ---- sizes of the terms of turning axes in a stage -------------------------------------------------------------------
def test_speeds_are_those_of_the_fastest_the_stage_may_turn() -> None:
    pair = largest_speeds(load_stage("fzg_c"))
    assert pair["wheel"] / pair["pinion"] == pytest.approx(-16 / 24)
    of_set = largest_speeds(load_stage("planetary54"))
    assert [of_set[name] for name in ("carrier", "sun", "planet1", "ring")] == pytest.approx(
        [300.0, 1200.0, -600.0, 0.0]
    )


def test_sizes_of_a_small_gear() -> None:
    """Of first and second order in the speed; ΔJ/J by a force is by reciprocity what its place moves outward."""
    body, force = small_gear.coarse(), 1e4
    modes = elastic_modes(body, 16)
    shown = SimpleNamespace(
        spin=modes.spin,
        frequency=modes.frequency,
        modes=modes.frequency.size,
        inertia=body.inertia[3:, 3:],
        toothed=SimpleNamespace(part=modes.part, roll=np.zeros(4), static=np.full((2, 2, 12, 4, 4, 3, 3), 1e-9)),
    )
    slow, fast = (gear_inertia("gear", shown, speed, force, 1e6) for speed in (500.0, 1000.0))
    assert slow is not None and fast is not None
    assert fast.whirl / slow.whirl == pytest.approx(2.0) and fast.stiffening / slow.stiffening == pytest.approx(4.0)
    assert fast.growth / slow.growth == pytest.approx(4.0) and fast.by_load == slow.by_load
    assert slow.deflection == pytest.approx(1e-5)
    polar = body.inertia[5, 5]
    assert fast.by_load == pytest.approx(2 * fast.growth / 1000.0**2 * force / polar)
    assert 1e-9 < fast.by_speed < 1e-3
    assert gear_inertia("gear", SimpleNamespace(spin=None, modes=0), 1.0, 1.0, 1.0) is None
