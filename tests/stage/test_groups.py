"""The ground group of the pair: statics against the same bodies put together another way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from dense import OnGear, answer, group_answer, relative

from gearfmu.stage.assembly.groups import mount
from gearfmu.stage.assembly.layout import stage_layout
from gearfmu.stage.assembly.teeth import ROLLS

LOADS = [
    (0, 0, 5, 0),
    (0, 0, 30, 1),
    (1, 0, 40, 0),
    (-1, 0, 11, 2),
    (2, 1, 20, 0),
    (0, 1, 5, 0),
]  # tooth, flank, roll, function
ANISOTROPIC = np.array([[4.0e-9, 1.5e-9], [1.5e-9, 2.5e-9]])


@pytest.fixture(scope="module")
def layout(spec, bodies):
    return stage_layout(spec, bodies)


def with_compliance(layout, compliance):
    return replace(layout, supports=[replace(s, compliance=compliance) for s in layout.supports])


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize(
    "compliance", [np.eye(2) / 3e8, ANISOTROPIC, np.zeros((2, 2))], ids=["isotropic", "anisotropic", "held"]
)
def test_statics_are_those_of_free_body_and_springs(layout, bodies, pair, index, compliance):
    springs = with_compliance(layout, compliance)
    group, own = mount(springs), slice(2 * index, 2 * index + 2)
    for angle in (0.0, 0.77, 3.9):
        gear = OnGear(index, bodies[index], pair.gears[index], LOADS, angle, np.arange(0, 5, 2), ROLLS)
        want, want_force = answer(springs, gear.free(springs))
        have, have_force = group_answer(group, gear.read(group))
        assert relative(have, want) < 1e-8
        assert np.abs(have_force[own] - want_force[own]).max() < 1e-8 * np.abs(want_force).max()
        assert np.abs(np.delete(have_force, own, axis=0)).max() < 1e-12
