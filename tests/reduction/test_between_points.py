"""Compliance between the Chebyshev roll points: interpolated on both sides against loads placed there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator

from gearfmu.femesh.sector import gear_sector
from gearfmu.reduction.cyclic.flank import Points, tooth_flank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.stagefile.forms.shapes import gear_geometry, ring_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import MeshSpec

FZG, SET = load_stage("fzg_c"), load_stage("planetary54")
CASES = {
    "pinion": (FZG.gears[0], FZG.written.pair, gear_geometry, 20),
    "sun": (SET.written.sun, SET.written.set, gear_geometry, 12),
    "ring": (SET.written.ring, SET.written.set, ring_geometry, 12),
}


@pytest.mark.parametrize("name", ["pinion", "sun", pytest.param("ring", marks=pytest.mark.full)])
def test_compliance_between_roll_points_is_within_half_a_percent(name):
    gear, pair, made, elements = CASES[name]
    shape = made(gear, pair)
    flank, points = tooth_flank(shape, gear)
    fine, nodes = np.linspace(*flank.roll_range, 81), points.rolls
    mesh = MeshSpec(flank=elements, thickness=3, root=3, rim=2, width=2, thickness_grading=1.8)
    both = Points(np.concatenate([fine, nodes]), 1)
    body = SectorBody(gear_sector(shape, gear.face_width, mesh), gear.material, flank, both)
    table = static_tables(body, []).static_ff[0, :, :2, :, :, 0, 0]
    weights = BarycentricInterpolator(nodes, np.eye(len(nodes)))(fine)
    count = len(fine)
    for side in (0, 1):
        for offset in (0, 1):
            direct = table[side, offset, :count, :count]
            interpolated = weights @ table[side, offset, count:, count:] @ weights.T
            largest = table[0, 0, :count, :count].diagonal().max()
            assert np.abs(interpolated - direct).max() < 0.005 * largest
    own, guess = table[0, 0, :count, :count].diagonal(), (weights @ table[0, 0, count:, count:] @ weights.T).diagonal()
    assert np.abs(guess / own - 1).max() < 0.005
