"""The verb modes: table, files, messages."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh
from verbs import call

import gearfmu as gf
from gearfmu.body.sector import body_sector
from gearfmu.commands import shared
from gearfmu.fem import solids
from gearfmu.femesh.carrier import whole_carrier
from gearfmu.modes.bodies import body_modes, uncoupled_carrier_modes
from gearfmu.stagefile.forms.shapes import carrier_geometry
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage


@pytest.fixture(autouse=True)
def no_lines_of_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow machine takes more than the time between two of them."""
    monkeypatch.setattr(shared, "_EVERY", 1e9)


@pytest.fixture(scope="module")
def coarse_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """planetary54 with few elements in its sun."""
    path = tmp_path_factory.mktemp("set") / "stage.toml"
    path.write_text(f'base = "{find_stage("planetary54")}"\n[sun.body.mesh]\nscale = 0.25\n', encoding="utf-8")
    return path


def test_a_body_with_its_files(coarse_set: Path, tmp_path: Path) -> None:
    code, out, err = call("modes", coarse_set, "--body", "sun", "--count", 3, "--out", tmp_path / "new" / "out")
    assert (code, err) == (0, "")
    with open(tmp_path / "new" / "out" / "sun_modes.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert sum(int(row["modes_of_this_frequency"]) for row in rows) >= 3
    assert all(f"{float(row['frequency_Hz']):.1f}" in out for row in rows)
    expected = {"sun_modes.csv", "sun_sheet.png"}
    expected |= {f"sun_mode_{int(row['mode']):02d}.{kind}" for row in rows for kind in ("png", "vtu")}
    assert {path.name for path in (tmp_path / "new" / "out").iterdir()} == expected


def test_the_whole_stage(tmp_path: Path) -> None:
    code, out, err = call("modes", "fzg_c", "--torque", "302 N*m", "--count", 7, "--out", tmp_path)
    assert (code, err) == (0, "") and "linearised at 302 N·m, 12 positions" in out
    assert "mode 4 meets mesh order 3 at 4687, 4 at 3515, 5 at" in out and "mode 6 meets mesh order 6 at 5394" in out
    assert {path.name for path in tmp_path.iterdir()} == {"fzg_c_frequencies.csv", "fzg_c_campbell.png"}
    with open(tmp_path / "fzg_c_frequencies.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["mode"]) for row in rows] == list(range(1, 8))
    assert all(float(row["lowest_Hz"]) <= float(row["frequency_Hz"]) <= float(row["highest_Hz"]) for row in rows)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("fzg_c", "--body", "gear"), 100, "no body 'gear'; the stage has pinion, wheel"),
        (("planetary54", "--body", "pinion"), 100, "the stage has sun, planet, ring, carrier"),
        (("planetary54", "--body", "sun", "--mounted"), 100, "only the ring of a planetary set has mounts"),
        (("fzg_c", "--mounted"), 100, "goes with --body ring"),
        (("fzg_c", "--body", "pinion", "--torque", "1 N*m"), 100, "have no torque"),
        (("fzg_c", "--torque", "0 N*m"), 100, "must not be 0"),
        (("fzg_c", "--torque", "302"), 100, "--torque"),
    ],
)
def test_messages(arguments: tuple, code: int, message: str, tmp_path: Path) -> None:
    given, out, err = call("modes", *arguments, "--out", tmp_path / "out")
    assert given == code and message in " ".join(err.replace("│", " ").split()) and out == ""
    assert not (tmp_path / "out").exists()


def test_a_carrier_without_couplings_is_that_of_its_finite_elements() -> None:
    """By one sector, against the whole body; the couplings of its bolts and bore stiffen it."""
    spec, scale = load_stage("planetary54"), 0.25
    found = uncoupled_carrier_modes(spec, 5, scale=scale)
    own = np.concatenate([[mode.frequency] * len(mode.numbers) for mode in found.modes])
    mesh = whole_carrier(carrier_geometry(spec.bodies["carrier"]), body_sector(spec, "carrier", scale))
    k, m = solids.assemble(mesh.nodes, {"hexahedron20": mesh.elements}, spec.written.carrier.material)
    values = eigsh(k.tocsc(), 6 + len(own), m.tocsc(), sigma=-((2 * np.pi * 300) ** 2), return_eigenvectors=False)
    whole = np.sort(np.sqrt(np.abs(values)))[6:] / (2 * np.pi)
    assert own == pytest.approx(whole, rel=1e-6)
    assert body_modes(spec, "carrier", 1, scale=scale).modes[0].frequency > 1.2 * own[0]


# ---- frf -------------------------------------------------------------------------------------------------------------
def errors(path: Path) -> dict[str, list[float]]:
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    found: dict[str, list[float]] = {}
    for row in rows:
        found.setdefault(row["method"], []).append(float(row["error"]))
    return found


@pytest.mark.full
def test_gear_of_a_pair_reduced_free_with_sizes_of_their_own(tmp_path) -> None:
    options = ["--scale", 0.3, "--lines", 12, "--free", "--methods", "modal:10, rubin:90", "--out", tmp_path]
    code, out, err = call("frf", "fzg_c", "pinion", *options)
    assert code == 0, err
    found = errors(tmp_path / "pinion_frf.csv")
    assert set(found) == {"modal", "rubin"} and all(len(values) == 12 for values in found.values())
    assert "reduced free, judged with bore held" in out and found["rubin"][0] < 1e-6 < found["modal"][0]


def test_the_function_is_the_verb(tmp_path) -> None:
    """A method with fewer vectors than asked for says so. 24 inputs: four whole blocks of the five that 100 vectors
    would begin."""
    methods = ["rubin:24", "modal", "krylov:100"]
    options = ["--scale", 0.2, "--lines", 5, "--methods", ",".join(methods), "--size", 30, "--out", tmp_path]
    code, out, err = call("frf", "planetary54", "carrier", *options)
    assert code == 0, err
    assert "krylov has 96 vectors where 100 were asked for: it takes whole blocks of one vector per input" in out
    assert "rubin has" not in out
    found = gf.frf("planetary54", "carrier", methods, size=30, lines=5, scale=0.2, band=("50 Hz", 1e4))
    assert {t.method: pytest.approx(t.error, rel=1e-4) for t in found.trials} == errors(tmp_path / "carrier_frf.csv")
    assert found.rows[0] == "bolt0.ux" and [t.size for t in found.trials] == [24, 30, 96]
    assert {p.name for p in tmp_path.iterdir()} == {
        "carrier_H.npz",
        *(f"carrier_frf.{s}" for s in ("csv", "svg", "png")),
    }
    held = np.load(tmp_path / "carrier_H.npz")
    assert held["H_reference"].shape == (5, 24, 24) and held["rows"][0] == "bolt0.ux" and held["length_m"] == 0.045
    off = np.linalg.norm(held["H_rubin_24"] - held["H_reference"], axis=(1, 2))
    share = off / np.linalg.norm(held["H_reference"], axis=(1, 2))
    assert share == pytest.approx(found.trials[0].error, rel=1e-3, abs=1e-12)
