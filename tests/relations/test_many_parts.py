"""Lines of contact in any number of parts: a helical stage finds its equilibrium, whatever yields."""

from __future__ import annotations

import numpy as np
import pytest
from kinds import KINDS

from gearfmu.stage.run.te import loaded_te

FAST = (("helical", "rigid gears"),)  # the others take eight seconds and more
POSITIONS = 3
YIELDS = {
    "all": {},
    "rigid gears": {"effect.elastic": 0.0},
    "straight contacts": {"effect.hertz": 0.0},
    "rigid gears, straight contacts": {"effect.elastic": 0.0, "effect.hertz": 0.0},
}


@pytest.mark.parametrize(
    ("name", "yields"),
    [
        pytest.param(name, yields, marks=() if (name, yields) in FAST else pytest.mark.full)
        for name in ("helical", "train", "helical_set")
        for yields in YIELDS
    ],
)
def test_any_number_of_parts_finds_equilibrium(name: str, yields: str) -> None:
    """5, 12 and 20 parts, more than any body has width functions: the mean transmission error is that of 12 within
    1 %. Sees: a search that does not end where parts of a line outnumber the width functions of its teeth."""
    kind = KINDS[name]
    found = [loaded_te(kind.model(), [kind.torque], POSITIONS, slices=float(n), **YIELDS[yields]) for n in (5, 12, 20)]
    means = np.array([result.te.mean() for result in found])
    assert np.isfinite(means).all()
    assert means[[0, 2]] == pytest.approx(means[1], rel=1e-2)
