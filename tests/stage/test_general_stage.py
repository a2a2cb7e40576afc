"""Phases of the teeth of a train, by the closed form at the places of its axes."""

from __future__ import annotations

import math
from itertools import combinations

import pytest

from gearfmu.errors import ModelError
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stagefile.forms.general import RotorSpec, Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage


@pytest.fixture(scope="module")
def train() -> Stage:
    return load_stage("two_stage")


def test_teeth_touch_in_every_engagement_at_angle_zero(train: Stage) -> None:
    """Drive gap of tooth 0 on tooth 0 is nothing, or a whole number of pitches."""
    phases = tooth_phases(train)
    for mesh in train.engagements:
        pair = mesh_shape(train, mesh)
        a, b = pair.gears
        (x, y), (u, v) = (train.rotors[train.rotor_of(gear)].axis for gear in mesh.gears)
        t = math.atan2(v - y, u - x) - pair.alpha_wt
        roll_a = a.r_b * (phases[mesh.gears[0]] + a.psi_b - t)
        roll_b = b.r_b * (phases[mesh.gears[1]] + b.psi_b - t - math.pi)
        assert math.remainder(pair.length - roll_a - roll_b, pair.base_pitch) == pytest.approx(0, abs=1e-12)


def test_a_ring_of_gears_whose_axes_do_not_fit_is_refused(train: Stage) -> None:
    """Three gears in a triangle, each with each: only certain places of the axes fit the teeth."""
    axes = {"pinion1": (0.0, 0.0), "wheel1": (0.1, 0.0), "third": (0.05, 0.14)}
    mesh, bodies = train.engagements[0], train.bodies
    triangle = {
        "bodies": bodies | {"third": bodies["wheel1"].model_copy(update={"name": "third"})},
        "rotors": {name: RotorSpec(axis=axis, bodies={name: 0.0}) for name, axis in axes.items()},
        "engagements": tuple(
            mesh.model_copy(update={"name": "-".join(gears), "gears": gears}) for gears in combinations(axes, 2)
        ),
    }
    with pytest.raises(ModelError, match="move an axis"):
        tooth_phases(train.model_copy(update=triangle))
