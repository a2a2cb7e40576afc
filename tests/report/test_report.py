"""The page: complete, self-contained, the same every time, and honest about what a trace does not hold."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from gearfmu.body import load_bodies
from gearfmu.commands.runs import finish
from gearfmu.report import html as report
from gearfmu.report import levels
from gearfmu.report.plots import distinct
from gearfmu.report.results import key_results, strict
from gearfmu.report.signals import lock_time, spans, window_of_interest
from gearfmu.stage.run.trace import Channel, Trace, write_columns
from gearfmu.stagefile.stage import load_stage

STEP, SAMPLES = 1e-4, 3000
AXIAL = {"fz": "N", "mx": "N.m", "my": "N.m"}
ALL = ("torque", "speed", "mesh", "mesh_detail", "bearing", "spectrum", "orders", "spectrogram")


def coupled_run() -> Trace:
    """A clutch that closes at 0.1 s on a stage with 16 teeth; the teeth are apart for the first 10 ms."""
    t = np.arange(SAMPLES) * STEP
    speed = 150 + 50 * np.clip(t / 0.1, 0, 1)
    phi = np.cumsum(speed) * STEP
    locked = t >= 0.1
    force = np.where(t < 0.01, 0.0, 3000 + 200 * np.sin(16 * phi) + 50 * np.sin(32 * phi))
    channels = {
        "pinion.clutch.capacity": Channel(250 * np.clip(t / 0.05, 0, 1), "N.m"),
        "pinion.clutch.tau": Channel(np.full(SAMPLES, 120.0), "N.m"),
        "pinion.clutch.slip": Channel(np.where(locked, 0, 200 - speed), "rad/s"),
        "pinion.clutch.locked": Channel(locked, ""),
        "pinion.gear.w": Channel(speed, "rad/s"),
        "wheel.gear.w": Channel(-speed / 1.5, "rad/s"),
        "mesh.force": Channel(force, "N"),
        "mesh.te": Channel(force / 2e8, "m"),
        "mesh.contact": Channel((force > 0).astype(int), ""),
        "mesh.impacts": Channel((force > 0).astype(int), ""),
    }
    for shaft, sign in (("pinion", 1), ("wheel", -1)):
        channels[f"bearing.{shaft}.fx"] = Channel(sign * 0.38 * force, "N")
        channels[f"bearing.{shaft}.fy"] = Channel(sign * 0.92 * force, "N")
    return Trace(t, channels, {"scene": "closure", "stage": "pair", "meshes": {"mesh": ("pinion", 16)}})


SUMMARY = {
    "scene": "closure",
    "stage": "pair",
    "outcome": "ok",
    "level": "standard",
    "n_dyn": 56,
    "slices": 5,
    "h": 5e-6,
    "H": 1e-4,
    "simulated_s": 0.3,
    "cpu_s": 0.06,
    "realtime_factor": 0.2,
    "coupling_error": 2e-4,
    "energy_residual": 1e-6,
    "hashes": {"model": "ab" * 32},
    "versions": {"gearfmu": "0.1.0"},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report")
    assert report.write(coupled_run(), SUMMARY, out) == out / "report.html"
    return out


def bare(text: str) -> str:
    """A page without the numbers, the sound, the pictures and Plotly's script that it carries packed."""
    text = re.sub(r'(<script type="text/plain"[^>]*>)[A-Za-z0-9+/=]*', r"\1", text)
    return re.sub(r"base64,[A-Za-z0-9+/=]+", "", text)


class Links(HTMLParser):
    """Collects every address and checks that tags nest."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [
            value or "" for name, value in attrs if name in ("src", "href", "xlink:href", "action", "data")
        ]
        if tag not in ("meta", "wbr", "img", "br", "input"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href", "xlink:href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_page_is_well_formed_and_names_no_outside_address(folder: Path) -> None:
    text = (folder / "report.html").read_text(encoding="utf-8")
    page = Links()
    page.feed(text)
    assert page.open == []
    assert "//" not in bare(text), "an address or a comment with two slashes"
    assert not re.search(r"@import|url\((?!#)", text)
    assert not re.search(r"\b(fetch|XMLHttpRequest|WebSocket|importScripts|sendBeacon)\b", bare(text))
    outside = [a for a in page.addresses if not a.startswith(("#", "data:", "data/"))]
    assert outside == []
    assert all((folder / a).is_file() for a in page.addresses if a.startswith("data/"))


def test_ids_are_unique_and_references_resolve(folder: Path) -> None:
    text = (folder / "report.html").read_text(encoding="utf-8")
    ids = re.findall(r' id="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= set(ids)


def test_every_plot_has_its_data(folder: Path) -> None:
    assert sorted(p.stem for p in (folder / "data").glob("*.csv")) == sorted(ALL)
    rows = list(csv.reader((folder / "data" / "mesh.csv").open(encoding="utf-8")))
    assert rows[0] == ["time_[s]", "mesh.force_[N]", "mesh.te_[m]", "mesh.contact"] and len(rows) == SAMPLES + 1
    assert [float(r[1]) for r in rows[1:]] == coupled_run()["mesh.force"].tolist()


def test_summary_is_strict_json_with_results(folder: Path) -> None:
    found = json.loads(
        (folder / "summary.json").read_text(encoding="utf-8"), parse_constant=lambda name: pytest.fail(name)
    )
    assert {**SUMMARY, "results": found["results"]} == found
    assert found["results"]["mesh_force_mean_N"] == pytest.approx(3000, rel=1e-3)
    assert found["results"]["lock_time_s"] == pytest.approx(0.1)
    assert found["results"]["contact_loss_percent"] == pytest.approx(100 / 30, rel=0.02)


def test_same_trace_same_bytes(folder: Path, tmp_path: Path) -> None:
    report.write(coupled_run(), SUMMARY, tmp_path)
    assert (tmp_path / "report.html").read_bytes() == (folder / "report.html").read_bytes()


@pytest.mark.parametrize("count", range(8))
def test_any_subset_of_channels_makes_a_report(tmp_path: Path, count: int) -> None:
    whole = coupled_run()
    chosen = np.random.default_rng(count).permutation(list(whole.channels))[: 2 * count]
    trace = Trace(whole.time, {name: whole.channels[name] for name in chosen}, {})
    page = report.write(trace, {}, tmp_path).read_text(encoding="utf-8")
    assert "not given" in page and page.endswith("</html>\n")


@pytest.mark.parametrize("samples", [1, 2, 20, 70])
def test_short_traces_make_a_report(tmp_path: Path, samples: int) -> None:
    whole = coupled_run()
    channels = {name: Channel(c.values[:samples], c.unit) for name, c in whole.channels.items()}
    report.write(Trace(whole.time[:samples], channels, whole.meta), SUMMARY, tmp_path)
    assert (tmp_path / "report.html").is_file()


def without_clutch() -> Trace:
    kept = {n: c for n, c in coupled_run().channels.items() if "clutch" not in n}
    kept["pinion.tau"] = Channel(np.full(SAMPLES, 120.0), "N.m")
    return Trace(coupled_run().time, kept, coupled_run().meta)


def uneven() -> Trace:
    whole = coupled_run()
    return Trace(whole.time + 2e-5 * np.sin(np.arange(SAMPLES)), whole.channels, whole.meta)


def axial() -> Trace:
    whole = coupled_run()
    loads = {f"bearing.pinion.{end}": Channel(0.3 * whole["mesh.force"], unit) for end, unit in AXIAL.items()}
    return Trace(whole.time, {**whole.channels, **loads}, whole.meta)


def fast() -> Trace:
    """16 teeth at 14 000 rpm mesh at 3.7 kHz; samples every 200 µs tell orders up to 2.25 kHz."""
    t = np.arange(SAMPLES) * 2 * STEP
    speed = np.full(SAMPLES, 14000 * np.pi / 30)
    channels = {"pinion.gear.w": Channel(speed, "rad/s"), "mesh.force": Channel(np.sin(16 * speed * t), "N")}
    return Trace(t, channels, {"meshes": {"mesh": ("pinion", 16)}})


def force_at(interval: float) -> Trace:
    t = np.arange(4000) * interval
    force = {"mesh.force": 1000 + np.sin(2 * np.pi * 800 * t), "mesh.force_mean": 1000 + np.cos(t)}
    return Trace(t, {name: Channel(values, "N") for name, values in force.items()}, {})


MARKED, UNMARKED, WARNED = "Dotted: mesh orders", "Mesh orders are not marked", '<p class="warning">'
SLIP, TILT = "<h2>Torques and slip</h2>", "<h2>Axial forces and tilting moments</h2>"
SAID: dict[str, tuple[Callable[[], Trace], tuple[str, ...], tuple[str, ...]]] = {  # run, what its page has and has not
    "locked": (coupled_run, ("<h1>pair, 1910 rpm<", "<p>closure</p>", SLIP, MARKED), (UNMARKED, 'id="axial"')),
    "run-up": (lambda: coupled_run().window(0, 0.09), (UNMARKED,), (MARKED,)),
    "uneven": (uneven, ("not evenly spaced", 'id="mesh"'), ('id="spectrum"',)),
    "no clutch": (without_clutch, ("<h2>Torques</h2>", "<h1>pair, 120 N·m, "), (SLIP,)),
    "axial": (axial, (TILT, 'id="axial"', "tilting moment on bearings in N·m"), ()),
    "coarse": (lambda: force_at(1e-4), (WARNED + "Sampled every 100 µs",), ()),
    "fine": (lambda: force_at(2e-5), (), (WARNED,)),
    "fast": (
        fast,
        (UNMARKED, "its mesh frequency, 3733 Hz and more, lies above 0.45 of the sampling rate, 2250 Hz",
         "communication step of 24 µs"),
        ('id="orders"',),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", SAID)
def test_a_page_says_what_its_run_holds_and_what_it_lacks(tmp_path: Path, case: str) -> None:
    run, words, absent = SAID[case]
    page = report.write(run(), SUMMARY, tmp_path).read_text(encoding="utf-8")
    assert [text for text in words if text not in page] == []
    assert [text for text in absent if text in page] == []


def test_named_failure_is_shown_as_such(tmp_path: Path) -> None:
    page = report.write(coupled_run(), {**SUMMARY, "outcome": "GK_PENETRATION"}, tmp_path).read_text(encoding="utf-8")
    assert '<span class="bad">GK_PENETRATION</span>' in page


def test_text_from_outside_cannot_become_markup(tmp_path: Path) -> None:
    nasty = "<script>alert(1)</script>"
    trace = Trace(np.arange(3.0), {f"{nasty[:8]}.w": Channel(np.zeros(3), "rad/s", nasty)}, {})
    said = {"scene": nasty, "stage": nasty, "outcome": nasty, "hashes": {nasty: nasty}}
    page = report.write(trace, said, tmp_path).read_text(encoding="utf-8")
    assert "<script>alert" not in page and "alert(1)&lt;/script&gt;" in page


def test_results_are_those_after_the_lock() -> None:
    trace = coupled_run()
    window = window_of_interest(trace)
    assert (window.start, window.reason) == (pytest.approx(0.1), "after the clutch has locked")
    assert key_results(trace)["mesh_force_rms_ac_N"] == pytest.approx(np.hypot(200, 50) / np.sqrt(2), rel=0.03)


def test_a_slow_swing_is_no_noise_in_a_transient_scene() -> None:
    """1 kN at 5 Hz under 10 N at 500 Hz: the 10 ms moving average takes the swing off, and leaves the whine."""
    t = np.arange(10000) * 1e-4
    force = 3000 + 1000 * np.sin(2 * np.pi * 5 * t) + 10 * np.sin(2 * np.pi * 500 * t)
    transient = key_results(Trace(t, {"mesh.force": Channel(force, "N")}, {}))["mesh_force_rms_ac_N"]
    steady = key_results(Trace(t, {"mesh.force": Channel(force, "N")}, {"settle": 0.1}))["mesh_force_rms_ac_N"]
    assert transient < 20 and steady == pytest.approx(1000 / np.sqrt(2), rel=0.02)


def test_a_clutch_that_slips_at_the_end_has_not_locked() -> None:
    t = np.arange(5.0)
    trace = Trace(t, {"x.clutch.locked": Channel(np.array([True, True, False, True, False]))}, {})
    assert lock_time(trace) is None
    assert spans(t, trace["x.clutch.locked"]) == [(0.0, 2.0), (3.0, 4.0)]


def test_strict_json_has_no_nan() -> None:
    assert strict({"a": np.float64("nan"), "b": [np.int32(3), np.inf], 4: np.array([1.5])}) == {
        "a": None,
        "b": [3, None],
        "4": [1.5],
    }


def test_a_signal_seen_twice_is_drawn_once() -> None:
    t = np.arange(4.0)
    trace = Trace(t, {"a.w": Channel(t, "rad/s"), "b.w": Channel(t.copy(), "rad/s"), "c.w": Channel(-t, "rad/s")}, {})
    assert distinct(trace, trace.channels) == ["a.w", "c.w"]


def test_a_run_says_where_its_time_went(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    meta = {"scene": "a", "outcome": "ok", "simulated_s": 0.1, "cpu_s": 2.0, "realtime_factor": 20.0}
    trace = Trace(np.arange(3.0), {"x.w": Channel(np.ones(3), "rad/s")}, meta)
    assert finish(trace, tmp_path, None, prepared=1.5) == 0
    assert "CPU time: model, FMU and start 1.5 s, simulation 2 s, report " in capsys.readouterr().out


# ---- the price list: read back as written, shown only with the bodies it was measured with ---------------------------
ROW = ("pair_loaded", "fast", 28, 5, 6.7, 0.0123, 0.04, 0.05, -0.001, 0.15)


def write_list(path: Path, bodies: str) -> None:
    write_columns(path, {name: np.array([value]) for name, value in zip(levels.COLUMNS, (*ROW, bodies), strict=True)})


def test_list_reads_back(tmp_path: Path) -> None:
    write_list(tmp_path / "l.csv", "ab+cd")
    assert levels.read_levels(tmp_path / "l.csv") == [dict(zip(levels.COLUMNS, (*ROW, "ab+cd"), strict=True))]
    (tmp_path / "other.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    assert levels.read_levels(tmp_path / "other.csv") == [] == levels.read_levels(tmp_path / "none.csv")


@pytest.mark.parametrize("fresh", [True, False])
def test_shown_only_with_its_bodies(tmp_path: Path, fresh: bool) -> None:
    shipped = load_stage("fzg_c/stage_relief")
    bodies = load_bodies(shipped)
    spec = shipped.model_copy(update={"source": tmp_path / "stage.toml"})
    made_with = levels.fingerprint(body.how.hash for body in bodies) if fresh else "0+0"
    write_list(levels.levels_path(spec), made_with)
    t = np.arange(50) * 1e-4
    trace = Trace(t, {"mesh.force": Channel(np.sin(t), "N")}, {})
    page = report.write(trace, {"level": "fast"}, tmp_path / "out", spec, bodies).read_text(encoding="utf-8")
    assert ("pair_loaded, fast ←" in page and "1.2 %" in page) == fresh
    assert ("has not been measured" in page) != fresh
