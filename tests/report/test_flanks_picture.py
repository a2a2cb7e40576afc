"""The picture of flanks: drawn where they are not nominal, and of what was said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu.report.te import write_flanks
from gearfmu.stage.assembly.teeth import FlankField
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import LeadSpec, ProfileSpec


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
