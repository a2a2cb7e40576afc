"""Compliance between the Chebyshev roll points: interpolated on both sides against loads placed there."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from gearfmu.femesh import gear_sector
from gearfmu.geometry import GearGeometry
from gearfmu.reduction.flank import Points, ToothFlank
from gearfmu.reduction.sector import SectorBody
from gearfmu.reduction.statics import static_tables
from gearfmu.spec.gear import MeshSpec
from gearfmu.spec.stage import load_stage


def test_compliance_between_roll_points_is_within_half_a_percent():
    spec = load_stage("fzg_c")
    gear = spec.gears[0]
    shape = GearGeometry.of(gear, spec.pair)
    flank = ToothFlank(shape.r_b, shape.psi_b, shape.s_form, shape.s_tip, gear.face_width, gear.body.strip_half_width)
    fine, nodes = np.linspace(shape.s_form, shape.s_tip, 81), flank.chebyshev_rolls(gear.body.roll_points)
    mesh = MeshSpec(flank=20, thickness=3, root=3, rim=2, width=2, thickness_grading=1.8)
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
