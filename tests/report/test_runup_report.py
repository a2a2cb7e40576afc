"""The report of a run-up: order maps of made-up sweeps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearfmu.body import load_bodies
from gearfmu.report import html as report
from gearfmu.report.metrics import MetricsError, order_map
from gearfmu.report.plots_runup import crossings
from gearfmu.report.runup import Turning, resonances, run_up_of_meshes, run_up_of_set
from gearfmu.report.signals import known_meshings, planet_set
from gearfmu.stage import Steady, assemble, simulate
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.stage import load_stage

STEP, SLOW, FAST, DURATION = 5e-5, 60.0, 240.0, 1.0  # s, rad/s of the carrier
TIME = np.arange(round(DURATION / STEP) + 1) * STEP
SPEED = SLOW + (FAST - SLOW) * TIME / DURATION
ANGLE = SLOW * TIME + 0.5 * (FAST - SLOW) * TIME**2 / DURATION


def test_an_order_keeps_its_line_and_its_level_while_the_speed_grows() -> None:
    found = order_map(TIME, 3.0 + 2.0 * np.cos(54.0 * ANGLE + 0.3), ANGLE, 100.0)
    line = found.amplitude[:, found.order == 54.0].ravel()
    assert line == pytest.approx(np.sqrt(2.0), rel=1e-3)
    off = found.amplitude[:, np.abs(found.order - 54.0) > 1.0]
    assert off.max() < 1e-3, "the mean and the sweep leave nothing beside it"
    assert found.speed == pytest.approx(np.interp(found.time, TIME, SPEED), rel=1e-3)
    assert found.order[1] == 0.25 and found.order[-1] == 100.0


def test_orders_that_the_sampling_cannot_tell_are_left_out() -> None:
    found = order_map(TIME, np.cos(ANGLE), ANGLE, 1000.0)
    limit = 0.45 / STEP * 2 * np.pi / found.speed
    for row, most in zip(found.amplitude, limit, strict=True):
        assert np.all(np.isnan(row[found.order > most])) and np.all(np.isfinite(row[found.order <= most]))


def test_no_orders_of_a_shaft_that_stands_or_turns_round_or_hardly_turns() -> None:
    with pytest.raises(MetricsError, match="at rest or reverses"):
        order_map(TIME, ANGLE, np.sin(ANGLE), 10.0)
    with pytest.raises(MetricsError, match="needs 4; record a longer run"):
        order_map(TIME, ANGLE, 0.1 * ANGLE, 10.0)


def sweep(speed: np.ndarray = SPEED, angle: np.ndarray = ANGLE) -> Trace:
    """Equal planets in alternating phase, as in a set whose ring teeth leave half a tooth from planet to planet."""
    channels, meshes = {}, {}
    for k in range(4):
        force = 1000.0 + 50.0 * (-1) ** k * np.cos(54.0 * angle)
        for central, gear, sign in (("sun", "sun", -1), ("ring", f"planet{k + 1}", 1)):
            channels[f"{central}_planet{k + 1}.force"] = Channel(sign * force, "N")
            meshes[f"{central}_planet{k + 1}"] = [gear, 18, "carrier"]
        channels[f"planet{k + 1}.gear.w"] = Channel(-2.0 * speed, "rad/s")
    channels["carrier.gear.w"], channels["carrier.gear.phi"] = Channel(speed, "rad/s"), Channel(angle, "rad")
    channels["sun.gear.w"] = Channel(4.0 * speed, "rad/s")
    for name, values in (("fx", np.cos(angle)), ("fy", np.sin(angle))):
        channels[f"bearing.ring.{name}"] = Channel(values, "N")
    return Trace(TIME, channels, {"scene": "sweep", "stage": "set", "outcome": "ok", "meshes": meshes})


def test_a_run_up_is_one_whose_carrier_gathers_speed() -> None:
    for trace, is_one in (
        (sweep(), True),
        (sweep(SPEED[::-1], ANGLE[-1] - ANGLE[::-1]), True),
        (sweep(np.full_like(TIME, FAST), FAST * TIME), False),
        (sweep(150.0 + 80.0 * np.sin(9.0 * TIME), 150.0 * TIME - 80.0 / 9.0 * np.cos(9.0 * TIME)), False),
    ):
        own = planet_set(trace, known_meshings(trace))
        found = run_up_of_set(trace, own)
        assert (found is not None) is is_one
        if found is not None:
            assert found.each == 54 and list(found.signals) == [
                "bearing.ring.fx", "sun_planet1.force", "ring_planet1.force",
            ]  # fmt: skip


def test_the_report_of_a_run_up_has_its_maps_instead_of_a_spectrum(tmp_path: Path) -> None:
    trace = sweep()
    report.write(trace, trace.meta, tmp_path)
    made = {path.stem for path in (tmp_path / "data").glob("*.csv")}
    assert {"spectrogram_speed", "orders_map", "orders_speed"} <= made and "spectrum" not in made
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Campbell diagram of the run-up" in text and "mesh orders k × 54" in text


def pair_sweep(swing: float = 0.0) -> Trace:
    """A pair of 16 teeth on the pinion: order 1 of the mesh, louder where it meets 800 Hz. swing: of the pinion's speed
    in that resonance, over its mean."""
    angle = 2.0 * ANGLE
    frequency = 16 * 2.0 * SPEED / (2 * np.pi)
    loud = 1.0 / np.abs(1 - (frequency / 800.0) ** 2 + 0.06j * frequency / 800.0)
    force = 1000.0 + 20.0 * loud * np.cos(16.0 * angle)
    swung = angle + swing / 16 * loud / loud.max() * np.sin(16.0 * angle)
    channels = {
        "pinion.gear.w": Channel(np.gradient(swung, TIME), "rad/s"),
        "pinion.gear.phi": Channel(swung, "rad"),
        "mesh.force": Channel(force, "N"),
        "bearing.pinion.fx": Channel(0.3 * force, "N"),
        "bearing.pinion.fy": Channel(0.9 * force, "N"),
    }
    return Trace(TIME, channels, {"scene": "sweep", "stage": "pair", "meshes": {"mesh": ["pinion", 16]}})


def test_the_run_up_of_a_pair_has_its_maps_over_the_pinions_speed(tmp_path: Path) -> None:
    trace = pair_sweep()
    report.write(trace, trace.meta, tmp_path)
    made = {path.stem for path in (tmp_path / "data").glob("*.csv")}
    assert {"spectrogram_speed", "orders_map", "orders_speed", "orders"} <= made
    assert not {"spectrum", "spectrogram"} & made
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "speed of the pinion in rpm" in text and "mesh orders k × 16" in text and "planets" not in text
    own = run_up_of_meshes(trace, known_meshings(trace))
    assert own is not None and list(own.signals) == ["bearing.pinion.fy", "mesh.force"] and own.resonances == ()
    found = own.orders["mesh.force"]
    peak = found.speed[np.argmax(found.amplitude[:, found.order == 16.0].ravel())]
    assert 16 * peak / (2 * np.pi) == pytest.approx(800.0, rel=0.03)
    marked = crossings(replace(own, resonances=(800.0,)))
    assert marked[0] == (1, 800.0, pytest.approx(3000.0)) and [order for order, *_ in marked] == [1, 2, 3, 4, 5, 6]


def test_a_run_up_shows_the_orders_of_the_loudest_direction_of_every_sensor() -> None:
    """√2 m/s² at order 3 of the mesh are 120 dB re 1 µm/s²; the sensor records means over the step."""
    trace = pair_sweep()
    speed = np.sqrt(2) / (48 * 2.0 * SPEED) * np.sin(48 * 2.0 * ANGLE)
    loud = np.diff(speed, prepend=speed[0]) / STEP
    sensors = {f"sensor.lid.a{axis}": Channel(share * loud, "m/s2") for axis, share in (("x", 0.1), ("z", 1.0))}
    housed = Trace(TIME, trace.channels | sensors, trace.meta)
    own = run_up_of_meshes(housed, known_meshings(housed))
    assert own is not None and list(own.signals)[-1] == "sensor.lid.az" and "sensor.lid.ax" not in own.signals
    signal, found = own.signals["sensor.lid.az"], own.orders["sensor.lid.az"]
    assert signal.kind.label == "dB re 1 µm/s²"
    levels = signal.kind.level(found.amplitude[:, found.order == 48.0].ravel())
    assert levels[np.isfinite(levels)] == pytest.approx(120.0, abs=0.2)


def test_the_rotation_of_a_shaft_is_its_angle_without_the_swing_of_a_mesh_resonance() -> None:
    trace = pair_sweep(0.3)
    assert np.diff(trace["pinion.gear.w"]).min() < -0.02 * 2.0 * SPEED.mean(), "the recorded speed swings"
    found = Turning.of(TIME, trace["pinion.gear.phi"])
    assert found.steady
    assert np.abs(found.angle - 2.0 * ANGLE).max() < 0.1 * 0.3 / 16
    assert np.abs(found.speed / (2.0 * SPEED) - 1).max() < 0.01
    backwards = Turning.of(TIME, -trace["pinion.gear.phi"])
    assert np.array_equal(backwards.angle, found.angle) and np.array_equal(backwards.speed, found.speed)


def test_a_swing_that_takes_several_revolutions_stays_in_the_rotation() -> None:
    slow = 2.0 * ANGLE + 0.1 * np.sin(2.0 * ANGLE / 4)
    found = Turning.of(TIME, slow)
    assert np.abs(found.angle - slow).max() < 0.01
    short = Turning.of(TIME[:5], slow[:5])
    assert short.speed == pytest.approx(2.0 * SPEED[:5], rel=0.05), "five samples have their differences"


def test_a_swinging_speed_neither_hides_the_run_up_nor_makes_orders_of_its_own(tmp_path: Path) -> None:
    """An order of constant amplitude keeps its line; over the recorded angle it would have others 16 orders away."""
    trace = pair_sweep(0.3)
    trace = replace(trace, channels=trace.channels | {"mesh.force": Channel(np.cos(96.0 * ANGLE), "N")})
    own = run_up_of_meshes(trace, known_meshings(trace))
    assert own is not None
    found = own.orders["mesh.force"]
    assert found.amplitude[:, found.order == 48.0].ravel() == pytest.approx(np.sqrt(0.5), rel=1e-2)
    assert np.nanmax(found.amplitude[:, np.abs(found.order - 48.0) > 1.0]) < 5e-3
    report.write(trace, trace.meta, tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    sections = [part.split('"')[0] for part in text.split('<section id="')[1:]]
    assert sections[:4] == ["spectrogram_speed", "orders_map", "orders_speed", "results"]
    assert "octaves" not in sections and "spectrum" not in sections


def test_orders_are_loudest_where_they_meet_the_linearised_stage() -> None:
    """`simulate --end-speed` of the shipped pair: the second mesh order in the wheel's bearing peaks at a resonance."""
    spec = load_stage("fzg_c/stage_relief")
    bodies = load_bodies(spec)
    model = assemble(spec, bodies)
    start, end, duration = 3500 * np.pi / 30, 6000 * np.pi / 30, 0.3
    drive = Steady(model, start, 150.0, (end - start) / duration)
    trace = simulate(model, drive, duration, 40e-6, {"level": 1.0})
    run = run_up_of_meshes(trace.window(0.02, duration), known_meshings(trace))
    assert run is not None
    found = run.orders["bearing.wheel.fy"]
    near = np.abs(found.order - 32.0) < 0.6
    peak = found.speed[np.argmax(np.linalg.norm(found.amplitude[:, near], axis=1))] * 32 / (2 * np.pi)
    known = resonances(run, "mesh", spec, bodies)
    print(f"peak {peak:.0f} Hz, resonances {[round(f) for f in known]}")
    assert min(abs(peak / f - 1) for f in known) < 0.02
    assert trace["pinion.gear.w"][-1] == pytest.approx(end, rel=0.01)


def test_a_run_up_turns_through_the_angle_of_its_speeds() -> None:
    spec = load_stage("fzg_c")
    drive = Steady(assemble(spec, load_bodies(spec)), 30.0, 150.0, 400.0)
    step = 1e-4
    before, now, after = (drive(0.2 + side * step) for side in (-1, 0, 1))
    for port in ("pinion", "wheel"):
        speed = (after[f"{port}.phi"] - before[f"{port}.phi"]) / (2 * step)
        assert speed == pytest.approx(now[f"{port}.w"], rel=1e-9)
        assert (after[f"{port}.w"] - before[f"{port}.w"]) / (2 * step) == pytest.approx(now[f"{port}.a"], rel=1e-9)
    assert now["pinion.w"] == pytest.approx(110.0) and now["wheel.w"] == pytest.approx(-110.0 * 16 / 24)


def train_sweep() -> Trace:
    """25/61 and 19/73 teeth: every mesh has its own orders of the input, the second is loudest at 500 Hz."""
    second = 25 / 61 * 19
    frequency = second * 2.0 * SPEED / (2 * np.pi)
    loud = 1.0 / np.abs(1 - (frequency / 500.0) ** 2 + 0.05j * frequency / 500.0)
    channels = {
        "stage1.force": Channel(1000.0 + 10.0 * np.cos(25 * 2.0 * ANGLE), "N"),
        "stage2.force": Channel(-2000.0 + 5.0 * loud * np.cos(second * 2.0 * ANGLE), "N"),
    }
    for gear, ratio in (("input", 2.0), ("intermediate", -2.0 * 25 / 61), ("output", 2.0 * 25 * 19 / 61 / 73)):
        channels[f"{gear}.gear.w"] = Channel(ratio * SPEED, "rad/s")
        channels[f"{gear}.gear.phi"] = Channel(ratio * ANGLE, "rad")
    meta = {"scene": "sweep", "stage": "train", "meshes": {"stage1": ["input", 25], "stage2": ["intermediate", 19]}}
    return Trace(TIME, channels, meta)


def test_the_run_up_of_a_train_has_the_orders_of_every_mesh(tmp_path: Path) -> None:
    trace = train_sweep()
    run = run_up_of_meshes(trace, known_meshings(trace))
    assert run is not None and run.shaft == "input"
    assert run.families == pytest.approx({"stage1": 25.0, "stage2": 25 * 19 / 61}, rel=1e-9)
    assert run.others == pytest.approx({"intermediate": 25 / 61, "output": 25 * 19 / 61 / 73}, rel=1e-9)
    marked = {k: (f, rpm) for k, f, rpm in crossings(replace(run, resonances=(500.0,)))}
    assert marked[5] == (500.0, pytest.approx(60 * 500.0 * 61 / 25 / 19)), "orders of the second mesh follow"
    found = run.orders["stage2.force"]
    near = np.abs(found.order - 25 * 19 / 61) < 0.5
    peak = found.speed[np.argmax(np.linalg.norm(found.amplitude[:, near], axis=1))]
    assert peak == pytest.approx(2 * np.pi * 500.0 * 61 / 25 / 19, rel=0.04)
    report.write(trace, trace.meta, tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "mesh orders k × 25 of stage1, k′ × 7.78689 of stage2" in text
    assert "Shafts turn at the orders 1 (input), 0.4098 (intermediate), 0.1067 (output)." in text
    head = (tmp_path / "data" / "orders_speed.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "stage2 order 4 of stage1.force_rms_[N]" in head
