"""The report of a planetary set on a made-up trace: planets side by side, shares, sidebands, and nothing for pairs."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from gearfmu.report import html as report
from gearfmu.report import plots
from gearfmu.report.chart import Chart
from gearfmu.report.heading import of_set, phasing, planet_phases
from gearfmu.report.planets import LEAST_SPAN, planets, sharing
from gearfmu.report.run import Run
from gearfmu.report.signals import known_meshings, planet_set
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.stage import load_stage

STEP, SAMPLES, CARRIER = 2e-5, 10001, 85.0
MESH = 54 * CARRIER / (2 * np.pi)  # Hz
SHARES = (1.1, 0.9, 1.05, 0.95)
FIGURES = "set_speed torque set_force set_force_detail planets sharing pin energy spectrum".split()


def set_run() -> Trace:
    """Four planets with shares of 1.1, 0.9, 1.05, 0.95 that ripple at the mesh frequency in alternating phase; the
    force of the ring on its mounts stands still in the axes of the carrier."""
    t = np.arange(SAMPLES) * STEP
    channels, meshes = {}, {}
    ripple = np.cos(2 * np.pi * MESH * t)
    for k, share in enumerate(SHARES):
        planet, force = f"planet{k + 1}", share * 1000.0 + (-1) ** k * 50.0 * ripple
        channels[f"{planet}.gear.w"] = Channel(np.full(SAMPLES, -170.0) + 0.01 * k, "rad/s")
        channels[f"pin.{planet}.fx"], channels[f"pin.{planet}.fy"] = (Channel(f * force, "N") for f in (0.6, 0.8))
        for central, gear, sign in (("sun", "sun", -1), ("ring", planet, 1)):
            channels[f"{central}_{planet}.force"] = Channel(sign * force, "N")
            channels[f"{central}_{planet}.te"] = Channel(sign * 1e-8 * force, "m")
            channels[f"{central}_{planet}.contact"] = Channel(np.full(SAMPLES, sign), "")
            meshes[f"{central}_{planet}"] = [gear, 18, "carrier"]
    channels["carrier.gear.w"] = Channel(np.full(SAMPLES, CARRIER), "rad/s")
    channels["carrier.gear.phi"] = Channel(CARRIER * t, "rad")
    channels["sun.gear.w"] = Channel(np.full(SAMPLES, 4 * CARRIER), "rad/s")
    channels["bearing.ring.fx"] = Channel(100.0 * ripple, "N")
    channels["bearing.ring.fy"] = Channel(np.zeros(SAMPLES), "N")
    for name, torque, speed in (("carrier", 600.0, CARRIER), ("sun", -150.0, 4 * CARRIER)):
        channels[f"drive.{name}.tau"] = Channel(np.full(SAMPLES, torque), "N.m")
        channels[f"drive.{name}.work"] = Channel(torque * speed * t, "J")
    for name in ("work", "stored", "dissipated", "residual"):
        channels[f"energy.{name}"] = Channel(np.zeros(SAMPLES), "J")
    return Trace(t, channels, {"scene": "set", "stage": "set", "outcome": "ok", "settle": 0.02, "meshes": meshes})


def test_forces_that_cancel_are_no_result(tmp_path: Path) -> None:
    """A ring whose forces cancel to 1e-6 of the mesh force has no chart, no level and no tile."""
    trace = set_run()
    quiet = {name: Channel(1e-5 * trace[name], "N") for name in ("bearing.ring.fx", "bearing.ring.fy")}
    trace = Trace(trace.time, {**trace.channels, **quiet}, trace.meta)
    report.write(trace, trace.meta, tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "alternating bearing force" not in text
    assert sorted(path.stem for path in (tmp_path / "data").glob("*.csv")) == sorted(FIGURES), "no bearing"
    header = (tmp_path / "data" / "spectrum.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "bearing.ring" not in header and "sun_planet1" in header


def test_shares_that_differ_by_rounding_are_a_line() -> None:
    trace = set_run()
    own = planet_set(trace, known_meshings(trace))
    assert own is not None
    alike = {f"{central}_{planet}.force": trace.channels["sun_planet1.force"]
             for central in own.meshes for planet in own.planets}  # fmt: skip
    for chart in (sharing, planets):
        plot = chart(Run(Trace(trace.time, {**trace.channels, **alike}, trace.meta), {}), own)
        assert isinstance(plot.picture, Chart)
        limits = [panel.limits or (0.0, 0.0) for panel in plot.picture.panels if "share" in panel.label]
        assert limits and all(high - low == pytest.approx(LEAST_SPAN) for low, high in limits)


def test_a_pair_is_no_set() -> None:
    trace = set_run()
    trace.meta["meshes"] = {"sun_planet1": ["sun", 18]}
    assert planet_set(trace, known_meshings(trace)) is None


def test_energy_that_the_balance_leaves_is_told_of_what_passed_through() -> None:
    trace = set_run()
    channels = {**trace.channels, "energy.residual": Channel(np.linspace(0.0, 1.02, SAMPLES), "J")}
    plot = plots.energy(Trace(trace.time, channels, trace.meta))
    assert plot is not None and "5.0e-05 of the energy" in plot.caption
    rows = list(csv.reader(",".join(plot.columns).splitlines()))
    assert "drive.carrier.work_[J]" in rows[0]


@pytest.mark.parametrize(
    ("teeth", "places", "words"),
    [
        (24, (0, 1, 2, 3), "in phase"),  # 24/4 is whole
        (18, (0, 1, 2, 3), "counter-phased"),  # 4½: every second planet half a pitch behind
        (26, (0, 1, 2, 3), "counter-phased"),
        (25, (0, 1, 2, 3), "sequentially phased"),  # 6¼
        (26, (0, 4 / 3, 8 / 3), "sequentially phased"),  # 8⅔
        (25, (0, 0.96, 2, 2.96), "counter-phased"),  # in opposite pairs: 0, 6, 12½, 18½
        (25, (0, 1, 2), "unequally phased"),  # 0, 6¼, 12½: first harmonics do not cancel
    ],
)
def test_phasing_of_planets_by_hand(teeth: int, places: tuple[float, ...], words: str) -> None:
    """Teeth of the sun times the place of each planet (here in quarters of a turn), in pitches behind the first."""
    phases = [(teeth * place / 4) % 1.0 for place in places]
    assert phasing(phases) == words


@pytest.mark.parametrize(("file", "words"), [("planetary54", "counter-phased"), ("helical_set", "sequentially phased")])
def test_phasing_is_a_key_number_of_a_set(file: str, words: str) -> None:
    stage = load_stage(file)
    planets = [name for name in stage.rotors if name.startswith("planet")]
    found = planet_phases(stage, planets, ["sun", "ring"])
    assert {phasing(own) for own in found.values()} == {words}
    told = dict(of_set(Run(set_run(), {}, load_stage("planetary54"))))
    assert told["Planets at the sun"] == told["Planets at the ring"] == "counter-phased (0, ½, 0, ½ of a pitch)"
