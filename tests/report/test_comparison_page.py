"""Runs compared in one page."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import gearfmu as gf
from gearfmu.commands.runs import compare as compare_verb
from gearfmu.errors import GearfmuError
from gearfmu.stage.run.trace import Channel, Trace

TIME = np.arange(10_000) * 2e-5
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
