"""The planetary set as part of a drivetrain: shortened versions of the shipped scenes. A clutch closes onto the
carrier, a rig runs the set up, a brake lets the ring go and catches it again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu.body import load_bodies
from gearfmu.cosim.coupled import OK, Result
from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.scene_run import run_once, stage_model
from gearfmu.fmu import export
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.scenefile.shaft_loads import SpeedControl
from gearfmu.stage import StageModel
from gearfmu.stage.run.trace import Trace

R_B_SUN, PIN_CIRCLE = 21.143e-3, 45e-3  # m
BACKLASH = 0.06e-3  # m, of each of the two meshes in series


def sliced_once(name: str) -> SceneSpec:
    """A shipped scene with one slice: its teeth are spur, and preparing takes a third."""
    scene = load_scene(name)
    return scene.with_stage(slices=1)


def with_capacity(scene: SceneSpec, duration: float, *points: tuple[float, float]) -> SceneSpec:
    brake = scene.drivetrain.clutches["brake"].model_copy(update={"capacity": points})
    parts = scene.drivetrain.model_copy(update={"clutches": {"brake": brake}})
    return scene.model_copy(update={"duration": duration, "drivetrain": parts})


def willis(trace: Trace) -> np.ndarray:
    """z_s φ_s + z_r φ_r − (z_s + z_r) φ_c since the start, over z_s, as a way on the sun's base circle, m: zero for
    rigid teeth without backlash."""
    turned = {name: trace[f"{name}.gear.phi"] - trace[f"{name}.gear.phi"][0] for name in ("sun", "ring", "carrier")}
    return R_B_SUN * (turned["sun"] + 3.0 * turned["ring"] - 4.0 * turned["carrier"])


def momentum(trace: Trace, model: StageModel) -> np.ndarray:
    """Angular momentum of all rotors of the set about its axis, kg·m²/s."""
    sun, planet, ring, carrier = load_bodies(model.stage)
    own = {"sun": sun, "ring": ring, "carrier": carrier} | {f"planet{k}": planet for k in (1, 2, 3, 4)}
    spins = sum(body.inertia[2, 2] * trace[f"{name}.gear.w"] for name, body in own.items())
    return spins + 4.0 * planet.total_mass * PIN_CIRCLE**2 * trace["carrier.gear.w"]


def impulse(trace: Trace, channel: str, step: float) -> np.ndarray:
    """Of a torque since the start, from its means over the steps, N·m·s."""
    return np.concatenate([[0.0], np.cumsum(trace[channel][1:]) * step])


# -- the ring's brake lets go and catches again ------------------------------------------------------------------------
def short_shift() -> SceneSpec:
    points = ((0.0, 400.0), (1e-3, 400.0), (1.5e-3, 0.0), (3e-3, 0.0), (4e-3, 250.0), (6e-3, 400.0))
    return with_capacity(sliced_once("planetary_shift"), 0.01, *points)


@pytest.fixture(scope="module")
def shift_model() -> StageModel:
    return stage_model(short_shift())


@pytest.fixture(scope="module")
def shift(shift_model: StageModel) -> Result:
    return run_once(short_shift(), Source(shift_model))


def test_while_the_brake_sticks_the_torques_are_those_of_the_teeth(shift: Result) -> None:
    """200 N·m on the carrier: a quarter at the sun, three quarters at the ring; it begins in that balance."""
    held = shift.trace.window(0.0, 1e-3)
    assert shift.outcome == OK and held["drive.brake.locked"].all()
    for name, torque in {"carrier": -200.0, "sun": 50.0, "ring": 150.0}.items():
        assert held[f"{name}.tau"].mean() == pytest.approx(torque, rel=5e-3), name
        assert held[f"{name}.tau"][:5] == pytest.approx(torque, rel=2e-3), "no jolt at the start"
        assert np.ptp(held[f"{name}.tau"]) < 0.06 * abs(torque), "the ripple of the meshes"
    assert np.abs(held["ring.gear.w"]).max() < 0.1 and held["sun.gear.w"].mean() == pytest.approx(340.0, rel=1e-3)


def test_the_brake_lets_go_slips_and_sticks_again(shift: Result) -> None:
    trace = shift.trace
    locked, slip, torque = (trace[f"drive.brake.{key}"] for key in ("locked", "slip", "tau"))
    assert locked[0] and not locked.all() and locked[-1] and np.all(slip[locked == 1] == 0.0)
    assert trace.time[locked == 0][0] == pytest.approx(1e-3 + 0.5e-3 * (1 - 150.0 / 420.0), abs=1.5e-4), "150 N·m"
    assert np.abs(slip).max() > 5.0 and np.all(slip * torque >= 0.0), "friction takes energy"
    assert np.all(np.abs(torque) <= 1.05 * 400.0 * (1 + 1e-9))


def test_angular_momentum_through_release_and_catch(shift: Result, shift_model: StageModel) -> None:
    """Of the set: what the torques of the three ports bring, all that they bring. Of the drivetrain: motor, road, brake
    and the ports' torques. Nothing gets lost at the cut, nor in slip and stick."""
    trace, scene = shift.trace, short_shift()
    step = scene.coupling.step
    brought = sum(impulse(trace, f"{name}.tau_mean", step) for name in ("carrier", "sun", "ring"))
    most = np.abs(impulse(trace, "carrier.tau_mean", step)).max()
    of_set = momentum(trace, shift_model)
    assert np.abs(of_set - of_set[0] + brought).max() < 1e-12 * most
    assert np.ptp(of_set) > 1e-3 * most, "there is something to balance"
    outside = (200.0 - 50.0) * trace.time + impulse(trace, "drive.ground.tau_mean", step) * -1.0
    inertias = scene.drivetrain.inertias
    of_drive = sum(part.inertia * trace[f"drive.{name}.w"] for name, part in inertias.items())
    assert np.abs(of_drive - of_drive[0] - outside - brought).max() < 1e-9 * most


def test_the_three_ports_turn_as_willis_says(shift: Result) -> None:
    """Through the release too, in which all three turn: within the backlash and what teeth and pins give way."""
    way = willis(shift.trace)
    assert np.abs(way).max() < 2.0 * BACKLASH + 0.1e-3
    of_ring = 3.0 * R_B_SUN * np.abs(shift.trace["ring.gear.phi"])
    assert of_ring.max() > 5.0 * np.abs(way).max(), "the ring did turn"


def test_energy_at_the_cut(shift: Result) -> None:
    assert abs(shift.energy_residual) < 1e-5
    left = np.ptp(shift.trace["energy.residual"])
    assert left < 2e-4 * shift.throughput


@pytest.mark.full
def test_the_fmu_with_three_ports_is_the_kernel_bit_for_bit(shift_model: StageModel, tmp_path: Path) -> None:
    scene = with_capacity(sliced_once("planetary_shift"), 1e-3, (0.0, 400.0), (2e-4, 400.0), (4e-4, 0.0))
    path = export(shift_model, tmp_path / "set.fmu")
    traces = [run_once(scene, Source(shift_model, fmu)).trace for fmu in (None, path)]
    assert list(traces[0].channels) == list(traces[1].channels)
    for name in traces[0].channels:
        assert np.array_equal(traces[0][name], traces[1][name]), name


# -- a clutch closes onto the carrier ----------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def closure() -> Result:
    """Slip 3 rad/s, gone within 4 ms."""
    scene = sliced_once("planetary_closure")
    changed = {
        "duration": 0.012,
        "start": scene.start.model_copy(update={"slip": 3.0}),
        "clutch": scene.clutch.model_copy(update={"capacity": ((2e-3, 0.0), (6e-3, 300.0))}),
    }
    scene = scene.model_copy(update=changed)
    return run_once(scene, Source(stage_model(scene)))


def test_nothing_moves_before_the_clutch_does(closure: Result) -> None:
    """The set rolls with the vehicle: no torque but what slows it down, no tooth force to speak of."""
    before, after = closure.trace.window(0.0, 2e-3), closure.trace.window(5e-3)
    meshes = [f"{central}_planet{k}.force_mean" for central in ("sun", "ring") for k in (1, 2, 3, 4)]
    assert closure.outcome == OK
    assert max(np.abs(before[name][1:]).max() for name in meshes) < 0.1 * max(np.abs(after[n]).max() for n in meshes)
    assert before["carrier.gear.w"] == pytest.approx(85.0, rel=2e-3)


def test_the_clutch_slips_then_sticks_and_carries_less_than_it_can(closure: Result) -> None:
    trace = closure.trace
    slip, torque, locked = (trace[f"carrier.clutch.{key}"] for key in ("slip", "tau", "locked"))
    assert locked[-1] and not locked[0] and slip[0] == pytest.approx(3.0)
    first = int(np.argmax(locked))
    assert np.all(slip[:first] > 0.0) and np.abs(slip[locked == 1]).max() < 1e-6
    capacity = np.interp(trace.time, [2e-3, 6e-3], [0.0, 300.0])
    assert np.all(np.abs(torque) <= capacity + 300.0 * 5e-6 / 4e-3), "a mean over the last internal step"
    assert np.abs(torque[1:first] - capacity[1:first]).max() < 0.5, "it slips with its capacity"


def test_the_sun_drives_the_vehicle_as_the_teeth_say(closure: Result) -> None:
    """The shafts' impulses on carrier and sun against the momentum of the set, reduced to the carrier: ring at rest."""
    trace = closure.trace
    assert np.abs(willis(trace)).max() < 2.0 * BACKLASH + 0.1e-3
    late = trace.window(2e-3)
    carrier, sun = (np.trapezoid(late[f"{name}.shaft.tau"], late.time) for name in ("carrier", "sun"))
    # kg·m², the planets' at their places with the carrier, by turns of the rotors
    own = {"carrier": 3.8e-3, "sun": 4 * 6.2e-5, **{f"planet{k}": -2 * 6e-5 for k in range(1, 5)}}
    gained = sum(of * (late[f"{name}.gear.w"][-1] - late[f"{name}.gear.w"][0]) for name, of in own.items())
    assert carrier + 4.0 * sun == pytest.approx(gained, abs=0.015 * abs(carrier))
    assert abs(closure.energy_residual) < 1e-4


# -- run-up on a rig ---------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def runup() -> Result:
    """From 40 rad/s in 10 ms at 104 rad/s², as the scene has it, from 2 ms on."""
    scene = sliced_once("planetary_runup")
    control = scene.drivetrain.torques["control"]
    wanted = SpeedControl(damping=20.0, over_time=((2e-3, 40.0), (1.2e-2, 40.0 + 1.04)))
    torques = scene.drivetrain.torques | {"control": control.model_copy(update={"speed_control": wanted})}
    parts = scene.drivetrain.model_copy(update={"torques": torques})
    scene = scene.model_copy(update={"duration": 0.012, "settle": 0.0, "drivetrain": parts, "record": ("*",)})
    return run_once(scene, Source(stage_model(scene)))


def test_the_run_up_begins_in_balance_and_gathers_speed(runup: Result) -> None:
    start, trace = runup.trace.window(0.0, 2e-3), runup.trace
    assert runup.outcome == OK and abs(runup.energy_residual) < 1e-5
    for name, torque in {"carrier": -400.0, "sun": 100.0}.items():
        assert np.abs(start[f"{name}.tau"] - torque).max() < 0.01 * abs(torque), "no jolt at the start"
    assert np.abs(willis(trace)).max() < 0.05e-3
    assert trace["carrier.gear.w"][-40:].mean() > 40.1 and trace["drive.control.tau"][-1] > 405.0
    assert trace["drive.control.tau"] == pytest.approx(
        400.0 + 20.0 * (np.interp(trace.time, [2e-3, 1.2e-2], [40.0, 41.04]) - trace["drive.motor.w"]), rel=1e-9
    )


def test_the_pin_out_of_place_carries_more(runup: Result) -> None:
    means = [np.abs(runup.trace[f"sun_planet{k}.force_mean"][1:]).mean() for k in (1, 2, 3, 4)]
    assert means[0] == max(means) and means[0] > 1.05 * np.mean(means)
