"""What the page carries: numbers that read back, the traces of the run, little enough of it."""

from __future__ import annotations

import base64
import gzip
import json
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfmu.report import html as report
from gearfmu.report.names import plain
from gearfmu.report.packed import BYTE_LEVELS, BYTE_MISSING, COLUMNS, EXACT, LEVELS, MISSING, MOST, Pack, reduced
from gearfmu.stage.run.trace import Channel, Trace

LIMIT = 6_000_000  # bytes of a page
TIME = np.arange(20_000) * 2e-5


def unpacked(text: str) -> tuple[dict[str, Any], list[np.ndarray]]:
    """The structure and the arrays of a `Pack.text`, as the page's script reads them."""
    data = gzip.decompress(base64.b64decode(text))
    length = struct.unpack("<I", data[:4])[0]
    content, block = json.loads(data[4 : 4 + length]), data[4 + length :]
    return content, [_array(head, block) for head in content["arrays"]]


def _array(head: dict[str, Any], block: bytes) -> np.ndarray:
    n, kind = head["n"], head["kind"]
    if kind == "even":
        return np.asarray(head["start"] + head["step"] * np.arange(n))
    at = block[head["at"] :]
    if kind == "steps":
        low, high = np.frombuffer(at, np.uint8, 2 * n).reshape(2, n).astype(np.uint16)
        steps = np.cumsum(low + 256 * high, dtype=np.uint16)
        values = head["low"] + steps / LEVELS * (head["high"] - head["low"])
        return np.where(steps == MISSING, np.nan, values)
    if kind == "u1":
        steps = np.frombuffer(at, np.uint8, n)
        values = head["low"] + steps / BYTE_LEVELS * (head["high"] - head["low"])
        return np.where(steps == BYTE_MISSING, np.nan, values).reshape(-1, head["columns"])
    return np.frombuffer(at, f"<{kind}", n)


def numbers(page: str) -> tuple[dict, list[np.ndarray]]:
    """What the script of a page unpacks."""
    found = re.search(r'id="numbers">([^<]*)<', page)
    assert found is not None
    return unpacked(found[1])


def run() -> Trace:
    phase = 2 * np.pi * 530 * TIME
    force = 3000 + 400 * np.sin(phase) + 40 * np.random.default_rng(1).standard_normal(TIME.size)
    channels = {
        "mesh.force": Channel(force, "N"),
        "mesh.te": Channel(1e-5 + 2e-6 * np.cos(phase), "m"),
        "pinion.gear.w": Channel(np.full(TIME.size, 208.0), "rad/s"),
    }
    return Trace(TIME, channels, {"scene": "steady", "settle": 0.05, "meshes": {"mesh": ["pinion", 16]}})


@pytest.mark.parametrize("size", [1, 3, EXACT, EXACT + 1, 5000])
def test_a_curve_reads_back_within_half_a_step_of_its_range(size: int) -> None:
    values = np.random.default_rng(size).standard_normal(size)
    values[size // 2] = np.nan
    pack = Pack()
    number = pack.add(values)
    _, arrays = unpacked(pack.text({}))
    allowed = 0.0 if size <= EXACT else 0.51 * np.ptp(values[np.isfinite(values)]) / LEVELS
    assert np.array_equal(np.isnan(arrays[number]), np.isnan(values))
    assert np.nanmax(np.abs(arrays[number] - values), initial=0.0) <= allowed


def test_even_steps_take_no_room_and_equal_arrays_are_stored_once() -> None:
    pack = Pack()
    first, again = pack.add(TIME), pack.add(TIME.copy())
    content, arrays = unpacked(pack.text({"a": 1}))
    assert first == again and content["a"] == 1 and len(arrays) == 1 and "at" not in content["arrays"][0]
    assert np.allclose(arrays[0], TIME, rtol=0, atol=1e-12)


def test_maps_and_raw_arrays_read_back() -> None:
    pack, levels = Pack(), np.array([[0.0, 30.0, np.nan], [60.0, 90.0, -20.0]])
    raw = np.array([-127, 0, 127], np.int8)
    at_map, at_raw = pack.add_map(levels, 0.0, 90.0), pack.add_raw(raw)
    _, arrays = unpacked(pack.text({}))
    assert np.isnan(arrays[at_map][0, 2]) and np.array_equal(arrays[at_raw], raw)
    assert np.allclose(arrays[at_map][1], [60.0, 90.0, 0.0], atol=0.5 * 90 / 254)


def test_the_longest_curves_are_stored_by_their_envelope() -> None:
    x = np.linspace(0.0, 1.0, 3 * MOST)
    y = np.sin(1e5 * x) * x
    shown_x, shown_y = reduced(x, y)
    assert shown_x.size == shown_y.size == 2 * COLUMNS and np.all(np.diff(shown_x) >= 0)
    assert (shown_y.min(), shown_y.max()) == (y.min(), y.max())


def test_traces_in_the_page_are_those_of_the_run(tmp_path: Path) -> None:
    trace = run()
    page = report.write(trace, trace.meta, tmp_path).read_text(encoding="utf-8")
    content, arrays = numbers(page)
    force, error = content["figures"]["mesh"]
    for panel, channel, scale in ((force, "mesh.force", 1e-3), (error, "mesh.te", 1e6)):
        (curve,) = panel["curves"]
        wanted = scale * trace[channel]
        assert curve["name"] == plain(channel)
        assert np.allclose(arrays[curve["x"]], TIME, rtol=0, atol=1e-9)
        assert np.abs(arrays[curve["y"]] - wanted).max() <= 0.51 * np.ptp(wanted) / LEVELS
    groups = {panel["group"] for panel in (force, error, *content["figures"]["speed"])}
    assert groups == {"time"}, "these zoom together"


def test_a_page_is_light_and_tells_its_figures_to_those_who_do_not_see_them(tmp_path: Path) -> None:
    trace = run()
    path = report.write(trace, trace.meta, tmp_path)
    page = path.read_text(encoding="utf-8")
    assert path.stat().st_size < 0.5 * LIMIT
    charts = re.findall(r'class="chart" role="img" aria-label="([^"]*)"', page)
    assert len(charts) == len(re.findall(r'class="chart"', page)) >= 5
    wanted = f"mean {trace['mesh.force'].mean() * 1e-3:.4g}"
    assert any("Mesh force (mesh.force) from" in label and wanted in label for label in charts)
    assert "Transmission error <code>mesh.te</code>" in page


@pytest.mark.parametrize(
    "channel, words",
    [
        ("mesh.te", "Transmission error"),
        ("sun_planet1.force", "Mesh force, sun – planet 1"),
        ("bearing.pinion.fy_mean", "Bearing force y, pinion, mean over the step"),
        ("pinion.gear.w", "Speed of the pinion"),
        ("drive.tyres.tau", "Torque, tyres"),
        ("mesh.slice_3", "Force of slice 3"),
        ("what nobody knows", ""),
    ],
)
def test_plain_names(channel: str, words: str) -> None:
    assert plain(channel) == words
