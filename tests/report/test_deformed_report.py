"""Deformed gears in the report: pictures and film inside the page, their data, and why they may be missing."""

from __future__ import annotations

import base64
import csv
import io
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from gearfmu.body import load_bodies
from gearfmu.report import html as report
from gearfmu.stage.run.deformation import Deformation, GearMotion
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.stage import load_stage

CARRIER = 85.0


@pytest.fixture(scope="module")
def spec() -> Any:
    return load_stage("planetary54")


@pytest.fixture(scope="module")
def bodies(spec: Any) -> list[Any]:
    return load_bodies(spec)


@pytest.fixture(scope="module")
def run() -> Trace:
    time = np.linspace(0, 0.1, 1001)
    return Trace(time, {"carrier.gear.phi": Channel(CARRIER * time, "rad")}, {"scene": "set", "outcome": "ok"})


@pytest.fixture(scope="module")
def deformation(bodies: list[Any]) -> Deformation:
    """A pattern of four lobes that turns with the carrier: five frames, three of them pictures."""
    ring, time = bodies[2], np.linspace(0, 0.02, 5)
    first = int(np.flatnonzero((ring.flank.diameter == 4) & (ring.flank.part == 1))[0])
    turning = 4 * CARRIER * time
    amplitude = 5e-6 * np.column_stack([np.cos(turning), np.sin(turning)])
    motion = GearMotion(ring.how.hash, np.array([first, first + 1]) + 1, amplitude, np.zeros((5, 6)))
    return Deformation(time, np.array([1, 2, 4]), np.arange(5), {"ring": motion}, {"stage": "planetary54"})


def images(page: str) -> list[Image.Image]:
    return [
        Image.open(io.BytesIO(base64.b64decode(text))) for text in re.findall(r"data:image/png;base64,([^\"]*)", page)
    ]


def test_pictures_and_film_stand_in_the_page(
    run: Trace, deformation: Deformation, spec: Any, bodies: list[Any], tmp_path: Path
) -> None:
    page = report.write(run, run.meta, tmp_path, spec, bodies, deformation).read_text(encoding="utf-8")
    still, film = images(page)
    assert getattr(still, "n_frames", 1) == 1 and getattr(film, "n_frames", 1) == 5
    assert "Deformation of the ring, film" in page and "enlarged" in page
    assert not re.search(r'(src|href)="(?!data|#)', page)
    with open(tmp_path / "data" / "deformation_ring.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["time_[s]"]) for row in rows] == pytest.approx([0.005, 0.01, 0.02])
    assert [float(row["rms_nu4_[m]"]) for row in rows] == pytest.approx([5e-6] * 3)


def test_colours_follow_the_lobes(
    run: Trace, deformation: Deformation, spec: Any, bodies: list[Any], tmp_path: Path
) -> None:
    """A quarter of a period of the pattern later the picture is another one; a whole one later the same."""
    ring = deformation.gears["ring"]
    period = 2 * math.pi / (4 * CARRIER)
    time = period * np.array([0.0, 0.25, 1.0])
    turning = 4 * CARRIER * time
    amplitude = 5e-6 * np.column_stack([np.cos(turning), np.sin(turning)])
    motion = replace(ring, amplitude=amplitude, motion=np.zeros((3, 6)))
    three = Deformation(time, np.array([0]), np.arange(3), {"ring": motion}, {})
    stands = replace(run, channels={"carrier.gear.phi": Channel(np.zeros(run.time.size), "rad")})
    _, film = images(report.write(stands, stands.meta, tmp_path, spec, bodies, three).read_text(encoding="utf-8"))
    frames = []
    for number in range(3):
        film.seek(number)
        frames.append(np.asarray(film.convert("RGB"), float)[60:])  # below the title
    assert np.abs(frames[1] - frames[0]).mean() > 2 and np.abs(frames[2] - frames[0]).mean() < 0.05


def test_what_cannot_be_drawn_is_said(
    run: Trace, deformation: Deformation, spec: Any, bodies: list[Any], tmp_path: Path
) -> None:
    bare = [replace(body, picture=None) if body.name == "ring" else body for body in bodies]
    page = report.write(run, run.meta, tmp_path, spec, bare, deformation).read_text(encoding="utf-8")
    assert not images(page) and "gearfmu reduce STAGE --force" in page
    page = report.write(run, run.meta, tmp_path, deformation=deformation).read_text(encoding="utf-8")
    assert "bodies are not at hand" in page
