"""The verb frf: table, CSV and chart of reduction methods on a body of a shipped stage, on a coarse mesh."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from verbs import call

import gearfmu as gf


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
