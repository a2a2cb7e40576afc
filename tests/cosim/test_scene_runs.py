"""Scenes on the shipped pair: FMU against kernel, chain inside against clutch outside, files, refusals."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from gearfmu import cosim, fmu
from gearfmu.cosim.accuracy import Window, coupling_errors, rms
from gearfmu.cosim.coupled import OK
from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.scene_run import drive_of, in_drivetrain, run_once, stage_model, summary, verified
from gearfmu.errors import FmuError, ModelError, SpecError
from gearfmu.scenefile.scene import SHIPPED, SceneSpec, load_scene, shipped_scenes
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.stage import load_stage


def scene(name: str, duration: float, **stage) -> SceneSpec:
    """A shipped scene, cut to `duration`, without settling, its stage changed."""
    return load_scene(name, {"duration": duration, "settle": 0.0} | {f"stage.{key}": v for key, v in stage.items()})


def test_a_run_leaves_trace_and_summary_with_the_promised_fields(tmp_path):
    trace = cosim.run(scene("pair_loaded", 2e-3, level="fast"), tmp_path, unit="kernel", verify=True)
    read, summary = Trace.load(tmp_path / "trace.h5"), json.loads((tmp_path / "summary.json").read_text())
    assert np.array_equal(read["mesh.te"], trace["mesh.te"]) and read.meta == trace.meta == summary
    promised = ("outcome", "simulated_s", "cpu_s", "realtime_factor", "coupling_error", "energy_residual", "level")
    assert all(summary[key] is not None for key in (*promised, "n_dyn", "slices", "h", "hashes", "versions"))
    assert summary["outcome"] == OK and summary["level"] == "fast" and summary["meshes"] == {"mesh": ["pinion", 16]}
    assert 0 < summary["stage_cpu_s"] <= summary["cpu_s"] and summary["coupling_error_of"] == "pinion.tau"
    assert {"scene", "model", "body pinion", "body wheel"} <= set(summary["hashes"])


def test_chain_in_the_stage_and_exact_clutch_outside_are_the_same_drivetrain():
    """Two methods: the kernel's clutch in C against PyUnit's event-exact one, up to and past lock-up, rigid bodies.

    Lock-up falls into the same communication step; shaft torque, pinion and engine speeds agree within their margins.
    """
    inside = scene("clutch_closure", 0.14, level="rigid", slices=1)
    outside = inside.model_copy(
        update={"passenger_car": inside.passenger_car.model_copy(update={"chain_in_fmu": False})}
    )
    assert inside.chain_in_fmu and not outside.chain_in_fmu
    a, b = cosim.run(inside, unit="kernel"), cosim.run(outside, unit="kernel")
    lock_a, lock_b = (
        trace.time[np.argmax(trace[name] > 0)]
        for trace, name in ((a, "pinion.clutch.locked"), (b, "drive.clutch.locked"))
    )
    assert 0.11 < lock_a < 0.13 and abs(lock_a - lock_b) <= 1.001e-4
    assert rms(a["pinion.shaft.tau"] + b["pinion.tau"]) < 2e-3 * np.ptp(a["pinion.shaft.tau"])
    assert rms(a["drive.engine.w"] - b["drive.engine.w"]) < 2e-5 * np.ptp(a["drive.engine.w"])
    assert rms(a["pinion.clutch.slip"] - b["drive.clutch.slip"]) < 2e-4 * 52.0


def test_coupling_error_does_not_count_the_internal_step():
    """20 µs holds 7 internal steps, half of it 3.5: a plain comparison would mostly see another internal step."""
    rig = scene("pair_light", 0.02, level="fast")
    source = Source(stage_model(rig))
    own, halved = run_once(rig, source), run_once(rig.with_coupling(step=0.5 * rig.coupling.step), source)
    assert round(rig.coupling.step / own.facts["solver.h"]) % 2 == 1
    plain = coupling_errors(own.trace, halved.trace, 2, Window(0.0, steady=False))["pinion.tau"].relative
    estimate = verified(rig, source, own)["pinion.tau"].relative
    assert estimate < 2e-3 and estimate < 0.1 * plain


def test_a_scene_switches_effects(tmp_path):
    """Bearings off: no bore moves; through FMU and kernel alike."""
    held = scene("pair_loaded", 2e-3, level="fast", **{"effects.bearings": False, "effects.coast_flank": True})
    model = stage_model(held)
    sources = Source(model), Source(model, fmu.export(model, tmp_path / "pair.fmu"))
    traces = [run_once(held, source).trace for source in sources]
    for trace in traces:
        assert np.all(trace["pinion.gear.y"] == 0) and np.all(trace["bearing.pinion.fy"] != 0)
        assert np.array_equal(trace["mesh.te"], traces[0]["mesh.te"])


def test_the_summary_says_what_was_off():
    held = scene("pair_loaded", 2e-3, level="fast", **{"effects.tip_contact": False, "effects.hertz": True})
    source = Source(stage_model(held))
    assert summary(held, source, run_once(held, source), None)["effects_off"] == ["tip_contact"]


@pytest.mark.parametrize("unit", ["kernel", "fmu"])
def test_a_step_that_cannot_be_is_refused_before_the_run(unit, tmp_path):
    with pytest.raises((ModelError, FmuError)):
        cosim.run(scene("pair_loaded", 1e-3, h=5e-4), tmp_path / "out", unit=unit)
    assert not (tmp_path / "out" / "trace.h5").exists()


@pytest.mark.full
@pytest.mark.parametrize(("name", "torque"), [("pair_loaded", 302.0), ("pair_light", 80.0)])
def test_pairs_reach_their_torque_and_speed_within_the_settling_time(name, torque):
    trace = cosim.run(name, unit="fmu")
    assert trace.meta["outcome"] == OK and abs(trace.meta["energy_residual"]) < 1e-7
    steady, shipped = trace.window(trace.meta["settle"]), load_scene(name)
    periods = math.floor((steady.time[-1] - steady.time[0]) * shipped.start.pinion_speed / (2 * math.pi) * 16)
    assert periods >= 20
    assert -steady["pinion.tau"].mean() == pytest.approx(torque, rel=1e-3)
    assert steady["wheel.tau"].mean() == pytest.approx(-1.5 * torque, rel=1e-3)
    assert steady["pinion.gear.w"].mean() == pytest.approx(shipped.start.pinion_speed, rel=1e-4)


# ---- scene files, and what their drives ask of a stage; messages: tests/stagefile/broken.json ------------------------
@pytest.mark.parametrize("stage", ["fzg_c", "reduced_models/planetary54", "reduced_models/fzg_c/stage_relief.toml"])
def test_a_stage_is_no_scene_and_says_so(stage):
    with pytest.raises(SpecError, match=r"this is a stage: name it in a scene under \[stage\]"):
        load_scene(stage)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("pair_loded", 'did you mean "pair_loaded"'),
        ("nothing", "clutch_closure_housed, clutch_closure_train, clutch_dump"),
    ],
)
def test_an_unknown_scene_is_asked_about(name, words):
    with pytest.raises(SpecError, match=words):
        load_scene(name)


def test_hash_follows_values_not_text():
    one, other = (load_scene("pair_light", {"test_rig.torque": torque}).hash for torque in ("0.08 kN*m", "81 N*m"))
    assert one == load_scene("pair_light").hash != other


VALUES = ["1", "-1", "0.0", "nan", "inf", "1e400", "99999999999999999999", "true", '""', '"1"', '"1 s"', '"-5 N*m"',
          '"1e9 rad/s"', '"1e-30 s"', '"nan s"', '"a\\u0000b"', "[]", "[[]]", '[["0 s", "1 N*m"]]', '[["1 s"]]',
          "{}", "{ a = 1 }", "1979-05-27"]  # fmt: skip


def test_whatever_stands_in_a_field_it_loads_or_lists_problems(tmp_path):
    """Every value of the shipped scenes, in the first that has the field, replaced by everything that does not belong
    there."""
    refused, tried, seen = 0, 0, set()
    for name in shipped_scenes():
        lines, table = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8").splitlines(), ""
        for number, line in enumerate(lines):
            key, sign, _ = line.partition(" = ")
            table = line if line.startswith("[") else table
            if not sign or key.startswith("#") or (table, key) in seen:
                continue
            seen.add((table, key))
            for value in VALUES:
                changed = [*lines[:number], f"{key} = {value}", *lines[number + 1 :]]
                (tmp_path / "scene.toml").write_text("\n".join(changed), encoding="utf-8")
                tried += 1
                try:
                    load_scene(tmp_path / "scene.toml")
                except SpecError as error:
                    refused += 1
                    assert all(problem.file and problem.remedy for problem in error.problems)
    assert tried > 1500 and 0.7 * tried < refused < tried


@pytest.mark.parametrize("name", shipped_scenes())
def test_a_stage_with_the_ports_that_a_drive_needs_has_the_same_drive(name):
    """Scenes are run on the stage that has their ports already, an FMU brings its own."""
    scene = load_scene(name)
    bare = load_stage(scene.stage.name)
    ready = in_drivetrain(scene, load_stage(scene.stage.name))
    first, second = drive_of(scene, bare), drive_of(scene, ready)
    assert first.ports == second.ports and first.ports
    assert first.start() == second.start() and first.silent == second.silent
    for port, wanted in first.ports.items():
        assert (ready.ports[port].kind, ready.ports[port].chain) == (wanted.kind, wanted.chain)
    if second.with_shafts is not None:
        own = {name: port.model_copy(update={"k": 2 * port.k}) for name, port in ready.ports.items() if port.k}
        other = drive_of(second.with_shafts({**ready.ports, **own}), ready)
        assert {name: port.k for name, port in other.ports.items()} == {name: own[name].k for name in other.ports}


def test_alternating_torques_and_clutches_of_a_drive_are_known():
    known = {name: load_scene(name) for name in ("planetary_backfire", "clutch_closure", "planetary_shift")}
    drives = {name: drive_of(s, load_stage(s.stage.name)) for name, s in known.items()}
    assert drives["planetary_backfire"].frequencies == (300.0,) and not drives["planetary_backfire"].watched
    assert drives["clutch_closure"].watched == () and drives["clutch_closure"].signals  # its clutch is in the stage
    assert set(drives["planetary_shift"].watched) == set(known["planetary_shift"].drivetrain.clutches)
