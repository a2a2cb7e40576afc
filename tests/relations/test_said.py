"""Said = recorded: every number of a report, of summary.json and of the CSV files follows from the trace."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from kinds import KINDS, Kind, every
from said import Said

from gearfmu.report import html as report
from gearfmu.report import plots
from gearfmu.report.chart import Chart
from gearfmu.report.heading import of_set, phasing, planet_phases
from gearfmu.report.planets import LEAST_SPAN, planets, sharing
from gearfmu.report.run import Run
from gearfmu.report.signals import known_meshings, planet_set
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.stage import load_stage

ALL = every(full=("helical", "train", "helical_set"))
OF_STATICS = ("mesh_cycle", "contact")  # quasi-static, or of finite elements: not of the trace
OF_OTHERS = ("orders", "spectrogram")  # below, by demodulation
LENGTH = {"pair": 30e-3, "set": 2e-3, "helical_set": 2e-3}  # s; orders take 8 mesh periods


@cache
def trace_of(kind: Kind, scale: float) -> Trace:
    length = LENGTH.get(kind.name, 4e-3)
    trace = replace(kind, duration=length).run(kind.model(), scale=scale)
    trace.meta.update(settle=0.25 * length, stage=kind.name)
    return trace


def said(kind: Kind, folder: Path, scale: float = 1.0) -> Said:
    trace = trace_of(kind, scale)
    trace.save(folder / "trace.h5")
    report.write(trace, dict(trace.meta), folder, kind.stage)
    return Said(folder)


def alike(shown: str, value: float) -> bool:
    """A number with as many digits as are shown."""
    digits = max(len(re.sub(r"^[-0.]+|[.]|e.*", "", shown)), 1)
    return float(shown) == pytest.approx(value, rel=0.6 * 10.0 ** (1 - digits), abs=1e-9)


@pytest.mark.parametrize("kind", ALL)
def test_summary(kind: Kind, tmp_path: Path) -> None:
    found = said(kind, tmp_path)
    assert found.results.keys() >= {"energy_residual_of_port_work"}
    for key, value in found.results.items():
        assert value == pytest.approx(found.result(key), rel=1e-9, abs=1e-12), key
    require_tables(found)
    require_files(found)


def require_tables(found: Said) -> None:
    """The page: its table of results, or of a set its key numbers and planets; operating point; energy; octaves."""
    require_tiles(found)
    if "<h2>Results</h2>" in found.html:
        for row, key in zip(found.rows("Results")[1:], found.results, strict=False):
            value = found.result(key)
            assert alike(row[2], value) or float(row[2]) == 0.0 and abs(value) < 1e-3 * force_of(found), row
    else:
        require_set(found)
    residual = next(row[1] for row in found.rows("Accuracy and cost") if row[0].startswith("Energy residual"))
    assert alike(residual, found.result("energy_residual_of_port_work"))
    first = next(name for name in found.trace if re.fullmatch(r"\w+\.tau", name))
    torque, speed = found.trace.get(f"{first}_mean", found.trace[first]), found.trace[first.replace("tau", "gear.w")]
    stated = re.search(r"<h1>[^<]*?([\d.]+) N·m, (\d+) rpm", found.html)
    assert stated is not None
    assert float(stated[1]) == pytest.approx(np.abs(torque[found.late]).mean(), rel=6e-3)
    assert float(stated[2]) == pytest.approx(30 / np.pi * np.abs(speed[found.late]).mean(), rel=6e-3)
    if "<h2>Octave bands</h2>" in found.html:
        head, *rows = found.rows("Octave bands")
        for row, channel in zip(rows, octave_channels(found), strict=True):
            levels = found.octaves(channel)
            for band, shown in zip(head[1:], row[1:], strict=True):
                assert float(shown) == pytest.approx(levels[float(band)], abs=0.051), (channel, band)


def require_tiles(found: Said) -> None:
    """The numbers on top: of several meshes the largest."""
    tiles = re.findall(r"<div><b>([^<]*)<small>([^<]*)</small></b><span>([^<]*)</span></div>", found.html)
    known = {
        "mean mesh force": ("mesh_force_mean_N", 1e-3),
        "dynamic factor": ("dynamic_factor", 1.0),
        "alternating transmission error": ("te_rms_ac_um", 1.0),
        "of the samples with teeth apart": ("contact_loss_percent", 1.0),
    }
    for value, _, words in tiles:
        if (start := re.match("|".join(known), words)) is not None:
            end, scale = known[start[0]]
            largest = max(abs(found.result(key)) for key in found.results if key.endswith(end))
            assert alike(value, scale * largest), words
        elif words.startswith("largest share of a planet"):
            assert float(value) == pytest.approx(max(map(found.share, found.meshes)), abs=6e-4)
        else:
            assert words.startswith("alternating bearing force"), f"nobody recomputes {words}"
            loudest = max(found.result(key) for key in found.results if key.startswith("bearing_"))
            assert alike(value, loudest)


def force_of(found: Said) -> float:
    return max(float(np.abs(found.trace[f"{mesh}.force"]).max()) for mesh in found.meshes)


def octave_channels(found: Said) -> list[str]:
    """Bearing forces, then mesh forces, as means over the step; what cancels is left out."""
    names = [n for n in found.trace if re.fullmatch(r"bearing\.\w+\.f[xy]_mean", n)]
    names = sorted(names, key=lambda n: list(dict.fromkeys(m.split(".")[1] for m in names)).index(n.split(".")[1]))
    names += [f"{mesh}.force_mean" for mesh in found.meshes]
    return [n for n in names if np.abs(found.trace[n]).max() >= 1e-4 * force_of(found)]


def require_set(found: Said) -> None:
    """Key numbers and table of planets. Phasing is checked by hand below."""
    words = dict(found.rows("Key numbers")[1:])
    late = {name: values[found.late] for name, values in found.trace.items()}
    for name, shown in re.findall(r"(\w+) ([-\d.]+) N·m", words["Torques, mean"]):
        channel = f"{name}.tau_mean" if f"{name}.tau_mean" in late else f"bearing.{name}.mz_mean"
        assert float(shown) == pytest.approx(late[channel].mean(), rel=6e-4)
    for name, shown in re.findall(r"(\w+) ([-\d.]+) rpm", words["Speeds, mean"]):
        assert float(shown) == pytest.approx(30 / np.pi * late[f"{name}.gear.w"].mean(), rel=6e-4, abs=0.05)
    ratio = late["sun.gear.w"].mean() / late["carrier.gear.w"].mean()
    assert alike(words["Ratio, speed of the sun over that of the carrier"], ratio) or round(ratio, 3) == float(
        words["Ratio, speed of the sun over that of the carrier"]
    )
    for central in ("sun", "ring"):
        own = [mesh for mesh in found.meshes if mesh.startswith(f"{central}_")]
        most = words[f"K_γ at the {central}, largest mean share"].split()[0]
        assert float(most) == pytest.approx(max(map(found.share, own)), abs=6e-4)
        width = next(text for key, text in words.items() if key.startswith(f"K_Hβ at the {central}"))
        factors = [found.face_load_factor(mesh, found.late) for mesh in own]
        assert float(width.split()[0]) == pytest.approx(max(factors), abs=6e-4)
    for row, mesh in zip(found.rows("Planets")[1:], found.meshes, strict=True):
        force, te, planet = found.force(mesh)[found.late], 1e6 * late[f"{mesh}.te"], mesh.rpartition("_")[2]
        pin = np.hypot(late[f"pin.{planet}.fx"], late[f"pin.{planet}.fy"]).mean()
        for shown, value in zip(
            row[1:], (force.mean(), force.std(), found.share(mesh), te.mean(), te.std(), pin), strict=True
        ):
            assert float(shown) == pytest.approx(value, rel=6e-4), (mesh, row)


def require_files(found: Said) -> None:
    """Every column of every CSV file that is of the trace."""
    for path in sorted((found.folder / "data").glob("*.csv")):
        if path.stem.startswith((*OF_STATICS, *OF_OTHERS)):
            continue
        table = found.table(path.stem)
        for head, values in table.items():
            expected = found.column(head, table)
            assert expected is not None, f"{path.name}: nobody recomputes {head}"
            if "dB" in head:  # 0 Hz is rounding
                values, expected = np.maximum(values, -120.0), np.maximum(expected, -120.0)
            scale = np.nanmax(np.abs(expected))
            assert np.allclose(values, expected, rtol=1e-9, atol=1e-9 * scale, equal_nan=True), (path.name, head)


def test_orders_and_spectrogram_of_a_pair(tmp_path: Path) -> None:
    """Orders by demodulation over 8 mesh periods around each point (to 1 % of the largest: Hann weights without least
    squares); the loudest line of the spectrogram by one transform."""
    found = said(KINDS["pair"], tmp_path)
    angle = np.append(0.0, np.cumsum(0.5 * (found.trace["pinion.gear.w"][1:] + found.trace["pinion.gear.w"][:-1])))
    angle *= 16 * (found.time[1] - found.time[0])
    table = found.table("orders")
    assert len(table["time_[s]"]) > 2
    for at, time in enumerate(table["time_[s]"]):
        centre = np.interp(time, found.time, angle)
        inside = np.abs(angle - centre) < 8 * np.pi
        weight = np.cos((angle[inside] - centre) / 16) ** 2
        for channel in ("mesh.force_mean", "bearing.pinion.fy_mean"):
            values = found.trace[channel][inside]
            values = values - np.average(values, weights=weight)
            own = [abs(np.average(values * np.exp(-1j * k * angle[inside]), weights=weight)) for k in range(1, 6)]
            own /= np.sinc(np.arange(1, 6) * 533 * 2e-5) / np.sqrt(2)
            shown = [table[f"{channel}_order_{k}_rms_[N]"][at] for k in range(1, 6)]
            assert np.allclose(shown, own, atol=0.01 * max(own)), (channel, time)
    map_ = found.table("spectrogram")
    first = map_["time_[s]"] == map_["time_[s]"][0]
    levels = map_["level_[dB re 1 N]"][first]
    size = 2 * (levels.size - 1)
    values = found.trace["bearing.pinion.fy"][:size] if size < found.time.size else found.trace["bearing.pinion.fy"]
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(size) / size)
    line = np.abs(np.fft.rfft((values - np.average(values, weights=window)) * window)) / window.sum() * np.sqrt(2)
    assert levels[line.argmax()] == pytest.approx(20 * np.log10(line.max()), abs=0.6), (
        "a mean over the step or a sample"
    )


@pytest.mark.parametrize(("name", "scale"), [("pair", 1.0), ("pair", -1.0), ("set", 1.0), pytest.param(
    "train", 1.0, marks=pytest.mark.full), pytest.param("train", -1.0, marks=pytest.mark.full)])  # fmt: skip
def test_flanks_are_named_by_the_load(name: str, scale: float, tmp_path: Path) -> None:
    """A positive torque on the input is carried by drive flanks in every mesh, a negative one by coast flanks. Fault:
    flanks by the kernel's index, so that meshes of a driven train or set ran "on coast flanks"."""
    found = said(KINDS[name], tmp_path, scale)
    coast = [value for key, value in found.results.items() if key.endswith("coast_contact_percent")]
    assert len(coast) == len(found.meshes) and coast == [0.0 if scale > 0 else 100.0] * len(coast)
    assert ("Coast flanks carry in" in found.text) == (scale < 0)


# ---- planetary sets --------------------------------------------------------------------------------------------------
def test_a_set_has_no_chart_of_forces_that_cancel_and_a_line_for_shares_that_differ_by_rounding(tmp_path: Path) -> None:
    """Bearing forces of 1e-5 of the mesh force have no chart, no level and no tile. A pair is no set."""
    trace = trace_of(KINDS["set"], 1.0)
    quiet = Channel(1e-5 * trace["sun_planet1.force"], "N")
    still = {name: quiet for name in trace.channels if re.fullmatch(r"bearing\.\w+\.[fm].*", name)}
    trace = Trace(trace.time, {**trace.channels, **still}, trace.meta)
    report.write(trace, trace.meta, tmp_path)
    assert "alternating bearing force" not in (tmp_path / "report.html").read_text(encoding="utf-8")
    figures = "axial energy pin planets set_force set_force_detail set_speed sharing spectrum torque".split()
    assert sorted(path.stem for path in (tmp_path / "data").glob("*.csv")) == figures, "no bearing"
    header = (tmp_path / "data" / "spectrum.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "bearing" not in header and "sun_planet1" in header
    own = planet_set(trace, known_meshings(trace))
    assert own is not None
    alike = {f"{central}_{planet}.{end}": trace.channels[f"sun_planet1.{end}"]
             for central in own.meshes for planet in own.planets for end in ("force", "force_mean")}  # fmt: skip
    for chart in (sharing, planets):
        plot = chart(Run(Trace(trace.time, {**trace.channels, **alike}, trace.meta), {}), own)
        assert isinstance(plot.picture, Chart)
        limits = [panel.limits or (0.0, 0.0) for panel in plot.picture.panels if "share" in panel.label]
        assert limits and all(high - low == pytest.approx(LEAST_SPAN) for low, high in limits)
    pair = Trace(trace.time, trace.channels, trace.meta | {"meshes": {"sun_planet1": ["sun", 18]}})
    assert planet_set(pair, known_meshings(pair)) is None


def test_energy_that_the_balance_leaves_is_told_of_what_passed_through() -> None:
    """1.02 J of twice 600 N·m × 85 rad/s × 0.2 s."""
    time = np.linspace(0.0, 0.2, 101)
    energies = {name: 0.0 * time for name in ("work", "stored", "dissipated")} | {"residual": 5.1 * time}
    channels = {f"energy.{name}": Channel(values, "J") for name, values in energies.items()}
    for name, torque, speed in (("carrier", 600.0, 85.0), ("sun", -150.0, 340.0)):
        channels[f"drive.{name}.tau"] = Channel(np.full(time.size, torque), "N.m")
        channels[f"drive.{name}.work"] = Channel(torque * speed * time, "J")
    plot = plots.energy(Trace(time, channels, {}))
    assert plot is not None and "5.0e-05 of the energy" in plot.caption
    assert "drive.carrier.work_[J]" in plot.columns


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
    found = planet_phases(stage, [name for name in stage.rotors if name.startswith("planet")], ["sun", "ring"])
    assert {phasing(own) for own in found.values()} == {words}
    told = dict(of_set(Run(trace_of(KINDS["set"], 1.0), {}, load_stage("planetary54"))))
    assert told["Planets at the sun"] == told["Planets at the ring"] == "counter-phased (0, ½, 0, ½ of a pitch)"
