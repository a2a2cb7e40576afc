"""Sound of a channel, and runs compared in one page."""

from __future__ import annotations

import io
import re
import wave
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import gearfmu as gf
from gearfmu import report
from gearfmu.commands.runs import compare as compare_verb
from gearfmu.errors import GearfmuError
from gearfmu.report.metrics import amplitude_spectrum
from gearfmu.report.sound import RATE, STEPS, heard_channel, sound_of
from gearfmu.stage.run.trace import Channel, Trace, TraceError

TIME = np.arange(25_000) * 2e-5
TONE = 950.0


def run(scale: float = 1.0, **meta: str) -> Trace:
    tone = scale * np.sin(2 * np.pi * TONE * TIME)
    channels = {
        "mesh.force": Channel(3000 + 80 * tone, "N"),
        "mesh.te": Channel(1e-5 + 1e-6 * tone, "m"),
        "bearing.pinion.fx": Channel(300 + 10 * tone, "N"),
        "bearing.pinion.fy": Channel(900 + 40 * tone, "N"),
        "pinion.gear.w": Channel(np.full(TIME.size, 2 * np.pi * TONE / 16), "rad/s"),
    }
    known = {"scene": "steady", "stage": "pair", "settle": 0.1, "meshes": {"mesh": ["pinion", 16]}}
    return Trace(TIME, channels, known | meta)


def test_sound_has_the_tone_at_its_level() -> None:
    sound = sound_of(run(), "bearing.pinion.fy")
    with wave.open(io.BytesIO(sound.wav)) as file:
        assert (file.getframerate(), file.getnchannels(), file.getsampwidth()) == (RATE, 1, 2)
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2").astype(float)
    assert samples.size / RATE == pytest.approx(0.4, abs=1e-3)
    inner = samples[samples.size // 4 : -samples.size // 4] / STEPS * sound.full_scale
    lines = amplitude_spectrum(inner, 1 / RATE)
    assert lines.frequency[np.argmax(lines.amplitude)] == pytest.approx(TONE, abs=6)
    assert np.std(inner) == pytest.approx(40 / np.sqrt(2), rel=5e-3) and sound.rms == pytest.approx(
        40 / np.sqrt(2), rel=1e-3
    )
    assert np.abs(samples).max() == pytest.approx(STEPS * 10 ** (-1 / 20), rel=1e-3)
    assert f"Level {20 * np.log10(40 / np.sqrt(2)):.1f} dB re 1 N" in sound.caption


def test_the_page_plays_a_bearing_force_or_the_channel_that_was_chosen(tmp_path: Path) -> None:
    trace = run()
    assert heard_channel(trace) == "bearing.pinion.fy"
    page = gf.write_report(trace, tmp_path, tell=lambda text: None).read_text(encoding="utf-8")
    assert "Bearing force y, pinion (bearing.pinion.fy), 0.1 s to" in page and "audio/wav;base64" in page
    chosen = gf.write_report(trace, tmp_path / "b", sound="mesh.te", tell=lambda text: None)
    assert "Transmission error (mesh.te), 0.1 s to" in chosen.read_text(encoding="utf-8")
    assert (tmp_path / "b" / "data" / "sound.wav").stat().st_size > 0.4 * RATE * 2
    with pytest.raises(TraceError, match="no channel 'mesh.tee'"):
        gf.write_report(trace, tmp_path / "c", sound="mesh.tee")


def test_a_comparison_tells_differences_in_decibel(tmp_path: Path) -> None:
    page = gf.compare({"before": run(), "after": run(0.5)}, tmp_path / "page.html").read_text(encoding="utf-8")
    table = page[page.index("<h2>Results") : page.index("Changes against before")]
    cells = dict(re.findall(r"<tr><td>([^<]+)</td>(.*?)</tr>", table))
    assert "−6.0 dB" in cells["Transmission error, rms of the alternating part"]
    assert (
        "−6.0 dB" in cells["Mesh force, rms of the alternating part"]
        and "better" in cells["Mesh force, rms of the alternating part"]
    )
    assert "+0.0 %" in cells["Mesh force, mean"]
    octaves = page[page.index("<h2>Octave bands") :]
    assert octaves.count("−6.0") >= 3
    assert {path.name for path in (tmp_path / "page_data").iterdir()} >= {
        "mesh_time.csv",
        "spectra.csv",
        "mesh_orders.csv",
    }
    assert not re.search(r'(src|href)="(?!data:|page_data/|#)', page)


def test_three_traces_are_named_by_what_tells_them_apart(tmp_path: Path) -> None:
    paths = []
    for name in ("a", "b", "c"):
        run().save(tmp_path / name / "trace.h5")
        paths.append(str(tmp_path / name))
    done = CliRunner().invoke(compare_verb, [*paths, "--out", str(tmp_path / "page.html")])
    assert done.exit_code == 0, done.output
    assert "<h1>a, b and c" in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert CliRunner().invoke(compare_verb, [*paths, "--name", "x"]).exit_code == 2
    with pytest.raises(GearfmuError, match="two traces or more"):
        gf.compare([run()], tmp_path / "page.html")


def test_a_short_or_uneven_run_has_no_sound(tmp_path: Path) -> None:
    trace = run()
    short = trace.window(0.1, 0.11)
    assert "<audio" not in report.write(short, short.meta, tmp_path / "a").read_text(encoding="utf-8")
    uneven = Trace(TIME + 4e-6 * np.sin(np.arange(TIME.size)), trace.channels, trace.meta)
    assert "Sound: the samples are not evenly spaced" in report.write(uneven, {}, tmp_path / "b").read_text(
        encoding="utf-8"
    )
