"""Sliding at a contact changes with the tilt of a gear as the motion of a point of a rigid body does: u + ω × r.
A point at the height z above mid-width moves by (z·ry, −z·rx) across the axis, whatever the kind of stage; so the rows
of both tilts are known by hand from those of x and y. Red where friction's moment about a diameter has the wrong
sign."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from inner import Inner
from kinds import KINDS

X, Y, PHI, Z, RX, RY = range(6)
SLICES = 5
ROUNDING = 1e-14  # m; levers are some 1e-2 m


# of the sets the helical one is quick
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.full) if n == "set" else n for n in KINDS])
def test_sliding_by_tilt_is_that_of_a_rigid_body(inner_library: Path, name: str) -> None:
    stage = KINDS[name].stage
    inner = Inner(inner_library, KINDS[name].model().blob, {"level": 0.0, "slices": SLICES, "effect.friction": 1.0})
    for e, mesh in enumerate(stage.engagements):
        _, _, middle, *rows = inner.rows(e, np.zeros(12)).T
        slide = np.moveaxis(np.reshape(rows[12:], (2, 6, -1)), 1, 0)  # motion, gear, contact
        assert slide.shape[2] >= SLICES and np.allclose(np.hypot(slide[X], slide[Y]), 1.0, rtol=0, atol=1e-12)
        spatial = bool(slide[RX].any())
        assert spatial or "helical" not in name, "gears of a planar model do not tilt"
        up = spatial * middle
        by_hand = np.array([-up * slide[Y], up * slide[X]])
        assert np.abs(slide[[RX, RY]] - by_hand).max() < ROUNDING, mesh.name
        assert not slide[Z].any()
