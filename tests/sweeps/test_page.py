"""The page of a sweep shows every result over the keys, the points and the failures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gearfmu.sweeps.page import write_page
from gearfmu.sweeps.table import SweepTable, column


def swept(tmp_path: Path) -> SweepTable:
    """Torque × relief; the last point failed."""
    torque, relief = np.repeat([50.0, 100.0], 2), np.tile([1e-5, 2e-5], 2)
    columns = {
        "point": np.arange(4), "torque_Nm": torque, "stage.relief_m": relief,
        "outcome": column(["ok", "ok", "ok", "SpecError"]), "message": column(["", "", "", "amount = 2 mm: too much"]),
        "trace": column([""] * 4), "te_pp_um": np.array([1.25, 2.5, 3.75, np.nan]),
        "bearing_wheel_rms_ac_N": np.array([1.0, 10.0, 100.0, np.nan]), "price": np.full(4, 0.5),
    }  # fmt: skip
    position = np.tile(np.arange(4) / 4, 3)
    curves = {"point": np.repeat([0, 1, 2], 4), "position": position, "te_um": 5 + np.tile([0.0, 2.0, 0.0, 1.0], 3)}
    return SweepTable(columns, ("torque_Nm", "stage.relief_m"), tmp_path, curves)


def test_the_page_has_figures_points_and_failures(tmp_path: Path) -> None:
    table = swept(tmp_path)
    text = write_page(table, "fzg_c/stage_relief", tmp_path).read_text(encoding="utf-8")
    assert "<h1>fzg_c/stage_relief over torque, stage.relief_m" in text and "4 points, 1 failed" in text
    assert "torque_Nm = 100, stage.relief_m = 2e-05: SpecError: amount = 2 mm: too much" in text
    for title in ("Transmission error over the mesh cycle", "Transmission error, peak to peak", "Alternating forces"):
        assert f"<h2>{title}</h2>" in text
    assert "2 µm" in text and "<td>1.25" not in text and '<td class="n">1.25</td>' in text
    assert table.files[0].name in text and table.files[1].name in text


def test_a_sweep_without_results_has_a_page_with_its_reasons(tmp_path: Path) -> None:
    whole = swept(tmp_path)
    columns = {name: values[3:] for name, values in whole.columns.items()}
    text = write_page(SweepTable(columns, whole.axes, tmp_path), "pair", tmp_path).read_text(encoding="utf-8")
    assert "1 points, 1 failed" in text.replace("1 point,", "1 points,") and "too much" in text
