"""Coupled frequencies of the shipped train – elastic helical gears, elastic shafts, seats, bearings, ports, both
meshes – and of pairs against a linear model that shares nothing with the kernel but which slices carry load
(`train_by_parts`). It knows slices by their width functions; what they yield of their own is in
tests/stage/test_slices.py."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from slices import by_functions_alone
from train_by_parts import Load, frequencies

from gearfmu.body import load_bodies
from gearfmu.modes.linear import EVERY, Linearised, linearised
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.run.limits import places_of
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage

COUNT = 60
FULL = pytest.mark.full
LIGHT = 0.1  # N·m: frequencies move with the place at which gears stand, in proportion to the load: 3e-4 at 1 N·m


def plain(stage: Stage) -> Stage:
    """Without profile and lead modification, so that under little load whole flanks touch."""
    bodies = {
        name: body.model_copy(update={"tip_relief": None, "lead": None}) if hasattr(body, "teeth") else body
        for name, body in stage.bodies.items()
    }
    return stage.model_copy(update={"bodies": bodies})


def at(model: StageModel, position: float) -> tuple[Linearised, list[Load], dict[str, float]]:
    """The kernel's linear model under LIGHT, the slices that carry it, angles of the rotors: the output stands where it
    is held, the others where the flanks that carry touch them."""
    kernel = model.kernel(**EVERY | {"effect.tip_contact": 0.0})
    kernel.prepare()
    system = linearised(model, LIGHT, position, kernel)
    rows = zip(system.linear.label, system.linear.force, strict=True)
    loads = [Load(*(int(number) for number in label), float(force)) for label, force in rows if label[0] >= 0]
    pitch = max((place.pitch for place in places_of(model)), key=abs)
    stage, turned = model.stage, {}
    turned[stage.rotor_of(stage.ports[model.shafts.output].body)] = -position * pitch
    for number, mesh in reversed(list(enumerate(stage.engagements))):
        pair, coast = mesh_shape(stage, mesh), any(x.flank for x in loads if x.mesh == number)
        a, b = (stage.rotor_of(name) for name in mesh.gears)
        through = mesh.backlash * math.cos(pair.alpha_wt) if coast else 0.0
        turned[a] = -(through + pair.gears[1].r_b * turned[b]) / pair.gears[0].r_b
    return system, loads, turned


def whole_width(loads: list[Load], slices: int) -> list[Load]:
    """All slices of a spur pair, of which the kernel holds those up to the middle for both halves."""
    halves = [replace(load, force=0.5 * load.force) for load in loads if 2 * load.slice + 1 < slices]
    others = [replace(load, slice=slices - 1 - load.slice) for load in halves]
    return [load for load in loads if 2 * load.slice + 1 == slices] + halves + others


@pytest.mark.parametrize(
    ("name", "position"),
    [pytest.param("two_stage", 1 / 8, marks=FULL), ("two_stage", 5 / 8), ("helical_demo", 3 / 8),
     ("fzg_c", 1 / 8), ("fzg_c", 5 / 8)],
)  # fmt: skip
def test_coupled_frequencies_are_those_of_the_stage_put_together_from_its_parts(name: str, position: float) -> None:
    """The 60 lowest, from the first torsion up to bending of shafts and gear bodies: within 1e-4 (7.0e-5). Contacts
    that yield 4 % more are seen, and tables of coast flanks without their allowance (5.2e-4). Of a spur pair the kernel
    knows the motion that is even over the width, the parts have the others between."""
    stage, bodies = plain(load_stage(name)), load_bodies(load_stage(name))
    system, loads, turned = at(by_functions_alone(assemble(stage, bodies)), position)
    spur = name == "fzg_c"
    if spur:
        loads = whole_width(loads, stage.slices)
    else:
        assert {load.mesh for load in loads} == set(range(len(stage.engagements)))
        assert {load.flank for load in loads if load.mesh} <= {1}
    mine, theirs = system.modes(COUNT)[0], frequencies(stage, bodies, loads, turned, 2 * COUNT + 10 if spur else COUNT)
    theirs = theirs[np.abs(theirs[:, None] / mine - 1).argmin(axis=0)]
    assert len(set(theirs)) == COUNT
    error = np.abs(mine / theirs - 1)
    print(f"{name}, {position:g} pitch, {len(loads)} slices, {mine[0]:.1f} to {mine[-1]:.0f} Hz: largest difference "
          f"{error.max():.1e} at {mine[error.argmax()]:.0f} Hz, of the 20 lowest {error[:20].max():.1e}")  # fmt: skip
    assert error.max() < 1e-4
    contact = np.diag(np.where(system.linear.label[:, 0] >= 0, 1.04, 1.0))
    softer = replace(system, linear=replace(system.linear, own=contact @ system.linear.own)).modes(COUNT)[0]
    assert np.abs(softer / theirs - 1).max() > 2 * error.max()
