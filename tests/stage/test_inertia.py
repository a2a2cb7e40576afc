"""Sizes of the terms of turning axes in a stage."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import small_gear

from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.stage.run.inertia import gear_inertia, largest_speeds
from gearfmu.stagefile.stage import load_stage


def test_speeds_are_those_of_the_fastest_the_stage_may_turn() -> None:
    pair = largest_speeds(load_stage("fzg_c"))
    assert pair["wheel"] / pair["pinion"] == pytest.approx(-16 / 24)
    of_set = largest_speeds(load_stage("planetary54"))
    assert [of_set[name] for name in ("carrier", "sun", "planet1", "ring")] == pytest.approx(
        [300.0, 1200.0, -600.0, 0.0]
    )


def test_sizes_of_a_small_gear() -> None:
    """Of first and second order in the speed; ΔJ/J by a force is by reciprocity what its place moves outward."""
    body, force = small_gear.coarse(), 1e4
    modes = elastic_modes(body, 16)
    shown = SimpleNamespace(
        spin=modes.spin,
        frequency=modes.frequency,
        modes=modes.frequency.size,
        inertia=body.inertia[3:, 3:],
        toothed=SimpleNamespace(part=modes.part, roll=np.zeros(4), static=np.full((2, 2, 12, 4, 4, 3, 3), 1e-9)),
    )
    slow, fast = (gear_inertia("gear", shown, speed, force, 1e6) for speed in (500.0, 1000.0))
    assert slow is not None and fast is not None
    assert fast.whirl / slow.whirl == pytest.approx(2.0) and fast.stiffening / slow.stiffening == pytest.approx(4.0)
    assert fast.growth / slow.growth == pytest.approx(4.0) and fast.by_load == slow.by_load
    assert slow.deflection == pytest.approx(1e-5)
    polar = body.inertia[5, 5]
    assert fast.by_load == pytest.approx(2 * fast.growth / 1000.0**2 * force / polar)
    assert 1e-9 < fast.by_speed < 1e-3
    assert gear_inertia("gear", SimpleNamespace(spin=None, modes=0), 1.0, 1.0, 1.0) is None
