"""What is off costs nothing: at most 5 % more instructions than a kernel compiled without it. The benchmark
evidence.price.effects_cost, which makes the table, fails where a run with the effect off has other bits, too."""

from __future__ import annotations

import math

from gearfmu.stage.effects import EFFECTS, costs

MOST = 0.05


def test_every_effect_has_its_measured_cost() -> None:
    """The table in the package, which the documentation shows."""
    found = costs()
    assert list(found) == [effect.name for effect in EFFECTS]
    for cost in found.values():
        assert math.isfinite(cost.share) and -MOST < cost.price_of_off <= MOST, cost
