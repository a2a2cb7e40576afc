"""The chapter of a housing: there with its sensors, absent without; its numbers are those of the trace and of
`gf.sound_power`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gearfmu as gf
from gearfmu import report
from gearfmu.body import load_bodies
from gearfmu.report import housing
from gearfmu.report.metrics import MetricsError
from gearfmu.report.run import Run
from gearfmu.report.signals import Window
from gearfmu.sound import level
from gearfmu.stage.run.trace import Channel, Trace

STEP = 25e-6
TIME = np.arange(8001) * STEP
ALL = Window(0.0, float(TIME[-1]), "here")
FIGURES = [
    f"housing_{name}" for name in ("octaves", "spectrum", "orders_stage1", "orders_stage2", "paths", "mounts", "sound")
]


def tone(frequency: float) -> Trace:
    """√2 m/s² at a frequency as the kernel records it: mean over every step."""
    speed = np.sqrt(2) / (2 * np.pi * frequency) * np.sin(2 * np.pi * frequency * TIME)
    values = np.diff(speed, prepend=0.0) / STEP
    still = Channel(np.zeros(TIME.size), "m/s2")
    return Trace(TIME, {"sensor.lid.ax": Channel(values, "m/s2"), "sensor.lid.ay": still}, {})


@pytest.mark.parametrize("middle", [160, 1000, 6300])
def test_one_metre_per_second_squared_is_120_decibel_in_its_own_third_octave(middle: float) -> None:
    plot = housing.accelerations(tone(1000 * 10 ** (round(10 * np.log10(middle / 1000)) / 10)), ALL)
    levels, bands = plot.columns["sensor.lid.ax_[dB re 1 µm/s²]"], plot.picture.panels[0].ticks
    at = bands.index(f"{middle:g}")
    assert levels[at] == pytest.approx(120.0, abs=0.02) and np.delete(levels, at).max() < 90
    assert list(plot.columns) == ["third_octave_[Hz]", "sensor.lid.ax_[dB re 1 µm/s²]"], "what stands still is left out"


@pytest.fixture(scope="module")
def closure() -> Trace:
    """The first 60 ms of the shipped scene."""
    scene = gf.load_scene("clutch_closure_housed")
    return gf.run(scene.model_copy(update={"duration": 0.06}), unit="kernel")


def test_with_a_housing_the_chapter_is_there_and_its_sound_is_that_of_sound_power(
    closure: Trace, tmp_path: Path
) -> None:
    stage = gf.load("two_stage/stage_housed")
    page = report.write(closure, closure.meta, tmp_path, stage, load_bodies(stage)).read_text(encoding="utf-8")
    places = [page.index(f'<section id="{name}">') for name in FIGURES]
    assert places == sorted(places) and "Housing and sound" in page
    sound = gf.sound_power(closure, stage, start=Run(closure, {}).window.start)
    told = np.genfromtxt(tmp_path / "data" / "housing_sound.csv", delimiter=",", skip_header=1)
    assert told[:, 0] == pytest.approx(sound.bands, rel=1e-6)
    for column, erp in ((1, False), (2, True)):
        assert told[:, column] == pytest.approx(level(sound.third_octaves(erp)[0]), abs=1e-6)
        words = f"{sound.total(erp)[0]:.1f} dB, {sound.total_a(erp)[0]:.1f} dB(A)"
        assert words in page


def test_it_is_absent_without_a_housing_and_where_the_housing_is_held(closure: Trace, tmp_path: Path) -> None:
    channels = {n: c for n, c in closure.channels.items() if not n.startswith(("sensor.", "mount."))}
    held = {n: replace(c, values=0 * c.values) if n.startswith("sensor.") else c for n, c in closure.channels.items()}
    for number, own in enumerate((channels, held)):
        folder = tmp_path / str(number)
        page = report.write(Trace(closure.time, own, {}), {}, folder).read_text(encoding="utf-8")
        assert "housing_" not in page and not list((folder / "data").glob("housing*"))


def test_what_is_missing_for_the_sound_is_said_and_the_rest_stays(closure: Trace, tmp_path: Path) -> None:
    stage = gf.load("two_stage/stage_housed")
    *others, own = load_bodies(stage)
    bodies = [*others, replace(own, skin=None, how=replace(own.how, hash="0" * 64))]
    with pytest.raises(MetricsError, match="housing has no skin"):
        housing.sound(Run(closure, {}, stage, bodies))
    page = report.write(closure, closure.meta, tmp_path).read_text(encoding="utf-8")
    assert "Sound power of the housing: the stage&#x27;s bodies are not at hand." in page
    assert 'id="housing_octaves"' in page and 'id="housing_sound"' not in page
