"""A contact's gap and its sliding change with the motion of its gears as the motion of one point of a rigid body: u +
ω × r. The point follows from the two rows of the turning; the rows of both tilts and of the axial motion are then known
by hand, whatever the kind of stage. Red where friction's moment about a diameter has the wrong sign."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from inner import Inner
from kinds import KINDS

X, Y, PHI, Z, RX, RY = range(6)
SLICES = 5
ROUNDING = 1e-12  # of the largest entry of a row, in m where it is a lever; 1e-15 is found


@pytest.mark.parametrize("name", KINDS)
def test_rows_of_a_contact_are_those_of_a_point_of_a_rigid_body(inner_library: Path, name: str) -> None:
    model = KINDS[name].model()
    stage = KINDS[name].stage
    inner = Inner(inner_library, model.blob, {"slices": SLICES, "effect.friction": 1.0})
    for e, mesh in enumerate(stage.engagements):
        width = min(stage.bodies[gear].face_width for gear in mesh.gears)
        seen = 0
        for flank, strip, share, *rows in inner.rows(e, np.zeros(12)):
            if share < 1.0:
                continue  # its middle lies elsewhere
            seen += 1
            up = ((strip + 0.5) / SLICES - 0.5) * width
            for w in (0, 1):
                gap, slide = np.reshape(rows, (2, 2, 6))[:, w]
                moments = np.array([[-n[X], n[Y]] for n in (gap, slide)])[:, ::-1]  # of r about the axis: x n_y − y n_x
                x, y = np.linalg.solve(moments, [gap[PHI], slide[PHI]])
                for n in (gap, slide):
                    by_hand = [y * n[Z] - up * n[Y], up * n[X] - x * n[Z]]
                    assert np.abs(n[[RX, RY]] - by_hand).max() < ROUNDING, (mesh.name, flank, strip, w)
                assert slide[Z] == 0.0 and np.hypot(slide[X], slide[Y]) == pytest.approx(1.0, abs=1e-12)
        assert seen > SLICES
