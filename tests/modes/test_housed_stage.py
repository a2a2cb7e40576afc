"""A housing under a run of the shipped train against the same housing in the run, and what `gf.house` refuses."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from verbs import call

import gearfmu as gf
from gearfmu.modes.housed import housed
from gearfmu.modes.housing import placed_housing
from gearfmu.modes.rings import Rings
from gearfmu.sound import SoundError, level, midbands, third_octaves
from gearfmu.stage import StageModel
from gearfmu.stage.run.simulate import Steady, simulate
from gearfmu.stage.run.trace import Channel, Trace

HOUSED, RIGID = "two_stage/stage_housed", "two_stage"


@pytest.mark.full
def test_a_housed_run_has_sound(tmp_path: Path) -> None:
    """From the run's bearing forces: verb and function, their file of the matrix, a waterfall. Measured: 80 dB."""
    stage = gf.load(HOUSED)
    run = gf.simulate(gf.assemble(stage), "100 N*m", "1500 rpm", duration="0.13 s", step=25e-6, level="fast")
    sound = gf.sound_power(run, stage, tmp_path / "matrix.h5", 300)
    assert 60 < sound.total()[0] < 100 and sound.total(erp=True)[0] > sound.total()[0]
    run.save(tmp_path / "trace.h5")
    arguments = ("--matrix", tmp_path / "matrix.h5", "--patches", 300, "--erp", "--csv", tmp_path / "sound.csv")
    code, out, err = call("sound", tmp_path, *arguments)
    assert code == 0 and f"sound power level {sound.total()[0]:.1f} dB" in out, err
    assert len(np.genfromtxt(tmp_path / "sound.csv", delimiter=",", names=True)) == 22
    again = gf.sound_power(run, stage, tmp_path / "matrix.h5", 300, speed="input.gear.w")
    assert again.speed is not None and again.speed == pytest.approx(157.08, rel=1e-3)
    assert level(again.power.mean(axis=0).sum()) == pytest.approx(sound.total()[0], abs=1.0)  # short segments: .5 dB


class Ripple:
    """The train at rest under 100 N·m; the outer end of its input swings by tones every 20 Hz from 160 Hz to 4 kHz."""

    def __init__(self, model: StageModel) -> None:
        self.rest = Steady(model, 0.0, 100.0)
        self.omega = 2 * np.pi * np.arange(160.0, 4000.0, 20.0)
        self.phase = np.random.default_rng(1).uniform(0, 2 * np.pi, len(self.omega))

    def __call__(self, time: float) -> dict[str, float]:
        values, angle = self.rest(time), self.omega * time + self.phase
        size = 2e-6 * min(1.0, time / 0.02)
        values["input.phi"] += size * float(np.cos(angle).sum())
        values["input.w"] -= size * float((self.omega * np.sin(angle)).sum())
        return values


@pytest.mark.full
def test_a_housing_under_a_run_is_the_housing_in_the_run() -> None:
    """Two runs in time, excited at a port, so that both have one excitation: third octaves of sensors within .5 dB
    (measured .3), where forces on rigid ground err by up to 30 dB."""
    step, parameters = 25e-6, {"level": 1.0}
    rigid, whole = gf.assemble(gf.load(RIGID)), gf.assemble(gf.load(HOUSED))
    one, two = (simulate(model, Ripple(model), 0.13, step, parameters) for model in (rigid, whole))
    trace = dataclasses.replace(one, meta=one.meta | {"stage": RIGID, "settle": 0.02})
    found = gf.house(trace, HOUSED, "100 N*m")
    stage = gf.load(HOUSED)
    placed = placed_housing(stage, gf.reduce(stage))
    blocked = np.stack([one[name] for name in placed.seats], axis=1)
    alone = housed(_absent(placed.seats), placed.housing, blocked, step, 10e3).sensor
    exact, own = (_bands(np.stack([run[name] for name in placed.sensors], axis=1), step) for run in (two, found))
    tones = midbands(200, 6300) < 3500
    assert np.abs(own - exact)[tones].max() < 0.5
    assert np.abs(_bands(alone, step) - exact)[tones].max() > 20


def _absent(names: tuple[str, ...]) -> Rings:
    """Rings of a stage that resists nothing."""
    s, none = len(names), np.zeros(0)
    free = np.zeros((s, 0))
    return Rings(names, none, np.zeros((0, 0)), free, free, np.zeros((s, s)), np.zeros((s, s)))


def _bands(values: np.ndarray, step: float) -> np.ndarray:
    """dB in third octaves, of all columns together, from .03 to .12 s."""
    piece = values[int(0.03 / step) : int(0.12 / step)]
    window = np.hanning(len(piece))[:, None]
    power = (np.abs(np.fft.rfft(window * (piece - piece.mean(axis=0)), axis=0)) ** 2).sum(axis=1)
    return 10 * np.log10(third_octaves(np.fft.rfftfreq(len(piece), step), power, midbands(200, 6300)))


@pytest.fixture(scope="module")
def finished() -> Trace:
    """A trace as a run on rigid ground would leave it."""
    time = np.arange(400) * 25e-6
    names = ["mesh1.contact", "mesh2.contact"]
    engaged = [f"{mesh.name}.contact" for mesh in gf.load(RIGID).engagements] or names
    return Trace(time, {name: Channel(np.ones(400, int)) for name in engaged}, {"stage": RIGID, "torque": 100.0})


def test_a_run_that_lost_contact_is_refused(finished: Trace) -> None:
    name = next(iter(finished.channels))
    apart = dataclasses.replace(finished, channels=finished.channels | {name: Channel(np.arange(400) % 2)})
    with pytest.raises(SoundError, match="lost contact"):
        gf.house(apart, HOUSED)


def test_a_run_with_a_housing_and_one_without_bearing_forces_are_refused(finished: Trace) -> None:
    with pytest.raises(SoundError, match="was in the run"):
        gf.house(dataclasses.replace(finished, meta={"stage": HOUSED, "torque": 100.0}), HOUSED)
    with pytest.raises(SoundError, match="torque"):
        gf.house(dataclasses.replace(finished, meta={"stage": RIGID}), HOUSED)


def test_sound_needs_a_housing(finished: Trace) -> None:
    with pytest.raises(gf.GearfmuError, match="no housing"):
        gf.sound_power(finished)
