"""The picture of a loaded transmission error says what each torque does about its mean, the unloaded pair beside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu.report.te import peak_to_peak, write_flanks, write_plot
from gearfmu.stage.assembly.teeth import FlankField
from gearfmu.stage.run.te import TeResult
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import LeadSpec, ProfileSpec

POSITION = np.arange(16) / 16
TORQUE = np.array([50.0, 200.0])


def made(torque: np.ndarray, te: np.ndarray) -> TeResult:
    alike, found = np.ones(te.shape), ("",) * torque.size
    return TeResult(torque, POSITION, te, alike, alike, np.ones((torque.size, 16, 4)), np.ones((torque.size, 5)), found)


def of_set(te: np.ndarray, sharing: np.ndarray, failed: tuple[str, ...] = ("", "")) -> TeResult:
    none = np.zeros((2, 0))
    return TeResult(TORQUE, POSITION, te, none, te, none[..., None], none, failed, np.nan, sharing, np.ones((2, 16, 2)))


def test_every_torque_is_named_with_its_peak_to_peak_and_the_unloaded_one_beside(tmp_path: Path) -> None:
    swing = np.cos(2 * np.pi * POSITION)
    result = made(TORQUE, np.stack([30e-6 + 1.5e-6 * swing, 110e-6 + 0.25e-6 * swing]))
    write_plot(result, tmp_path / "te.svg", made(np.zeros(1), 2e-7 * swing[None]))
    seen = (tmp_path / "te.svg").read_text(encoding="utf-8")
    assert "50 N·m: 3 µm peak to peak, mean 30 µm" in seen
    assert "200 N·m: 0.5 µm peak to peak, mean 110 µm" in seen
    assert "without load: 0.4 µm peak to peak" in seen
    assert "harmonic of the mesh" in seen and "load per width over its mean" in seen


def test_a_set_has_its_load_factor_over_the_torque(tmp_path: Path) -> None:
    te, sharing = np.zeros((2, 16)), np.ones((2, 16, 2, 3))
    sharing[1, 4, 0] = (1.2, 0.9, 0.9)
    write_plot(of_set(te, sharing), tmp_path / "te.svg")
    seen = (tmp_path / "te.svg").read_text(encoding="utf-8")
    assert "mesh load factor K_γ" in seen and "planet 3" in seen


def test_rounding_is_no_error_of_transmission() -> None:
    assert peak_to_peak(np.array([0.0, 2e-12])) == "0 µm peak to peak"


def test_a_torque_without_equilibrium_is_a_row_with_its_reason() -> None:
    alike, sharing = np.ones((2, 16)), np.ones((2, 16, 2, 3))
    rows = of_set(alike, sharing, ("", "no static equilibrium")).rows
    assert rows[-1] == ("200.0 N·m", "no static equilibrium") and len(rows) == 1 + 2 + 1


# ---- flanks: drawn where they are not nominal, and of what was said --------------------------------------------------
def test_only_flanks_that_are_not_nominal_are_drawn(tmp_path: Path) -> None:
    for name, drawn in (("fzg_c", False), ("fzg_c/stage_relief", True)):
        path = tmp_path / f"{drawn}.png"
        assert write_flanks(load_stage(name), path) is drawn and path.exists() is drawn


def test_what_is_drawn_is_everything_that_is_said() -> None:
    """Tip relief of 15 µm to the tip circle, profile slope 4 µm and lead crowning 5 µm at the corners of a flank."""
    spec = load_stage("fzg_c/stage_relief")
    more = {"profile": ProfileSpec(slope=4e-6), "lead": LeadSpec(crowning=5e-6)}
    pinion = spec.written.gears[0].model_copy(update=more)
    stage = rewritten(spec, gears=(pinion, spec.written.gears[1]))
    gear = stage.gears[0]
    field = FlankField(gear, shape := gear_shape(gear))
    material = field.whole(np.array([-0.5, 0.0, 0.5]) * gear.face_width)
    start = float(pinion.tip_relief.start_roll)
    relief = 15e-6 * ((shape.s_tip - start) / (shape.s_a - start)) ** 2
    assert material.shape == (1, 2, 3, field.rolls.size)
    assert material[0, 0, :, 0] == pytest.approx([-7e-6, -2e-6, -7e-6])
    assert material[0, 1, :, -1] == pytest.approx([-3e-6 - relief, 2e-6 - relief, -3e-6 - relief])
