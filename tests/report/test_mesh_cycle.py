"""Mesh cycle, contact pattern, dynamic factor: against the statics they come from and made-up signals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import gearfmu as gf
from gearfmu.body import load_bodies
from gearfmu.report.mesh_cycle import (
    BINS,
    contact_pattern,
    face_load_factor,
    folded,
    no_mean_cycle,
    over_width,
    static_face_load_factor,
    transmission_error,
)
from gearfmu.report.results import dynamic_factors
from gearfmu.report.run import Run
from gearfmu.report.signals import SETTLED, Window, window_of_interest
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stage.run.flank_loads import FlankLoads, flank_loads
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage

TORQUE = 302.0


@pytest.fixture(scope="module", params=["fzg_c/stage_relief", "helical_demo"])
def model(request: pytest.FixtureRequest) -> StageModel:
    spec = load_stage(request.param)
    return assemble(spec, load_bodies(spec))


def test_forces_of_the_slices_carry_the_torque_and_lie_on_the_path_of_contact(model: StageModel) -> None:
    found = flank_loads(model, 150.0, "mesh", positions=8)
    pair = mesh_shape(model.stage, model.stage.engagements[0])
    gear = pair.gears[0]
    carried = [found.force[found.at == i].sum() for i in range(8)]
    # the flanks slide off the theoretical line where a tip corner carries: a few per mille
    assert carried == pytest.approx([150.0 / (gear.r_b * math.cos(gear.beta_b))] * 8, rel=6e-3)
    assert np.allclose(found.te, loaded_te(model, [150.0], 8).te[0], rtol=1e-6, atol=0)
    loaded = found.roll[found.force > 0.02 * found.force.max()]
    beyond = 0.06 * pair.base_pitch + 0.5 * found.face_width / found.width.size * abs(math.tan(gear.beta_b))
    assert pair.path["A"] - beyond < loaded.min() and loaded.max() < pair.path["E"] + beyond
    assert found.side == 1 and found.position == pytest.approx(np.arange(8) / 8, abs=1e-6)


@pytest.mark.full
def test_quasi_static_mesh_cycle_of_a_set_is_that_of_a_run() -> None:
    """Both by the angle of the carrier: its plate twists its bore by another 13 µm at the base circles."""
    spec = load_stage("planetary54")
    model = assemble(spec, load_bodies(spec))
    run = gf.simulate(model, 600.0, 85.0, duration=6e-3, level="rigid")
    for mesh in ("sun_planet1", "ring_planet1"):
        still = flank_loads(model, 600.0, mesh, positions=4)
        assert run[f"{mesh}.te"][150:].mean() == pytest.approx(still.te.mean(), rel=0.01)


def test_line_load_over_the_path_adds_up_to_the_mesh_force() -> None:
    """Over a whole engagement every roll is passed once: the mean of the sum over pairs is the integral of the line
    load over roll and width, divided by the base pitch."""
    spec = load_stage("fzg_c/stage_relief")
    model = assemble(spec, load_bodies(spec))
    found, pair = flank_loads(model, TORQUE, "mesh"), mesh_shape(model.stage, model.stage.engagements[0])
    roll = np.linspace(found.roll.min(), found.roll.max(), 2000)
    load = found.line_load(roll)
    total = np.trapezoid(load.mean(axis=1), roll) * found.face_width / pair.base_pitch
    assert total == pytest.approx(TORQUE / pair.gears[0].r_b, rel=0.02)


def test_folding_gives_the_mean_cycle_and_refuses_what_has_none() -> None:
    position = np.linspace(0.0, 40.0, 20_001)
    noise = np.random.default_rng(3).standard_normal(position.size)
    mean = folded(position, 5.0 + np.sin(2 * np.pi * position) + 0.1 * noise)
    assert mean is not None
    middle = (np.arange(BINS) + 0.5) / BINS
    assert np.abs(mean - 5.0 - np.sin(2 * np.pi * middle)).max() < 0.03
    assert folded(position / 10, noise) is None and folded(position[::1000], noise[::1000]) is None


def steady(force: np.ndarray, time: np.ndarray, **more: np.ndarray) -> Trace:
    units = {"mesh.te": "m", "pinion.gear.phi": "rad", "wheel.gear.phi": "rad"}
    channels = {name: Channel(values, units.get(name, "N")) for name, values in more.items()}
    return Trace(time, {"mesh.force": Channel(force, "N"), **channels}, {"settle": float(time[time.size // 5])})


def test_quasi_static_and_recorded_cycle_lie_over_one_another() -> None:
    """A run that goes slowly through the statics: its mean cycle is theirs, in size and place."""
    spec = load_stage("fzg_c/stage_relief")
    bodies: list[Any] = load_bodies(spec)
    model, time = assemble(spec, bodies), np.linspace(0.0, 1.0, 20_001)
    pitches = 30.0 * time
    table, pair = loaded_te(model, [TORQUE], 48), mesh_shape(model.stage, model.stage.engagements[0])
    te = np.interp(np.mod(pitches, 1.0), np.append(table.position, 1.0), np.append(table.te[0], table.te[0, 0]))
    names = {"mesh.te": te, "wheel.gear.phi": -pitches * 2 * np.pi / pair.gears[1].z}
    trace = steady(np.full(time.size, TORQUE / pair.gears[0].r_b), time, **names)
    cycle = Run(trace, {}, spec, bodies)
    assert cycle.statics[1] == []
    plot = transmission_error(cycle, "mesh")
    assert plot is not None and not isinstance(plot.picture, str)
    static, run = plot.picture.panels[0].curves
    assert (static.name, run.name) == ("quasi-static", "in the run")
    assert np.abs(np.interp(static.x[1:-1], run.x, run.y) - static.y[1:-1]).max() < 0.08 * np.ptp(static.y)
    harmonics = plot.picture.panels[1].curves
    assert harmonics[1].y[:3] == pytest.approx(harmonics[0].y[:3], rel=0.03, abs=0.03)
    pattern = contact_pattern(cycle, "mesh")
    assert pattern is not None
    heat = pattern.picture.panels[0].heat  # type: ignore[union-attr]
    assert heat is not None and heat.values.max() == heat.high and "drive flanks" in pattern.caption


def test_without_statics_and_mean_cycle_there_is_no_picture() -> None:
    spec, time = load_stage("fzg_c/stage_relief"), np.arange(100) * 1e-4
    trace = steady(np.ones(100), time, **{"mesh.te": np.zeros(100), "wheel.gear.phi": np.zeros(100)})
    assert transmission_error(Run(trace, {}, spec), "mesh") is None


def test_a_short_run_is_called_short() -> None:
    """Faults: a steady run of three mesh periods, and one that ends before it has settled, were called not steady."""
    settled = Window(0.1, 0.2, SETTLED)
    assert "too short: 3.0 mesh periods after settling, 8 are needed" in no_mean_cycle(settled, np.linspace(0, 3, 50))
    assert "too few" in no_mean_cycle(settled, np.linspace(0, 30, 50))
    assert "not recorded" in no_mean_cycle(settled, None)
    time = np.arange(100) * 1e-4
    force = {"mesh.force": Channel(np.ones(100), "N")}
    early, unsettled = (window_of_interest(Trace(time, force, meta)) for meta in ({"settle": 0.02}, {}))
    assert "settling time of 0.02 s" in early.reason and (early.start, early.end) == (0.0, time[-1])
    assert "too short" in no_mean_cycle(early, None) and "not steady" in no_mean_cycle(unsettled, None)


def test_dynamic_factor_is_the_peak_over_the_mean() -> None:
    time = np.arange(20_000) * 1e-5
    trace = steady(1000.0 + 250.0 * np.sin(2 * np.pi * 700 * time), time)
    assert dynamic_factors(trace) == {"dynamic_factor": pytest.approx(1.25, rel=1e-3)}
    highest = Channel(np.full(time.size, 1400.0), "N")
    recorded = Trace(time, {**trace.channels, "mesh.force_max": highest}, trace.meta)
    assert dynamic_factors(recorded)["dynamic_factor"] == pytest.approx(1.4, rel=1e-3)
    swing = 1000.0 + 500.0 * np.sin(2 * np.pi * 2 * time)
    slow = Trace(time, {"mesh.force": Channel(swing, "N")}, {})
    assert dynamic_factors(slow)["dynamic_factor"] == pytest.approx(1.0, abs=0.03), "a slow swing is static"
    assert dynamic_factors(Trace(time, {"mesh.force": Channel(np.zeros(time.size), "N")}, {})) == {}


def test_face_load_factor_is_that_of_the_means() -> None:
    time = np.arange(100.0)
    trace = Trace(time, {f"mesh.slice_{k}": Channel(np.full(100, 100.0 * k), "N") for k in (1, 2, 3)}, {})
    assert face_load_factor(trace, "mesh") == pytest.approx(1.5)
    assert face_load_factor(Trace(time, {"mesh.force": Channel(time, "N")}, {}), "mesh") is None
    sums = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0]])
    statics = FlankLoads(np.zeros(1), np.zeros(1), 1.0, np.zeros(3), 1, sums, sums, np.zeros(2, int))
    assert static_face_load_factor(statics) == pytest.approx(1.5)


def test_no_statics_without_a_load() -> None:
    spec = load_stage("fzg_c")
    trace = steady(np.full(100, 0.1), np.arange(100.0))
    assert Run(trace, {}, spec, load_bodies(spec)).statics == ({}, [])


def test_load_over_the_width_is_smooth_and_goes_through_the_slices() -> None:
    """Linear loads come out exactly up to both ends; a step makes neither overshoot nor pull."""
    middles, places = np.linspace(-0.4, 0.4, 5), np.linspace(-0.5, 0.5, 41)
    found = over_width(np.stack([3 + 2 * middles, np.array([0.0, 0.0, 5.0, 5.0, 5.0])]), middles, places)
    assert found[0] == pytest.approx(3 + 2 * places) and found[1].min() >= 0 and found[1].max() <= 5 + 1e-12
    assert found[1, [4, 12, 20, 28, 36]] == pytest.approx([0, 0, 5, 5, 5])
