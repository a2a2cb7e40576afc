"""Flanks and runout of sets: the same fields, whatever the stage is made of."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gearfmu.body import load_bodies
from gearfmu.stage import assemble
from gearfmu.stage.assembly.blob import read_blob
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stage.assembly.teeth import FlankField
from gearfmu.stage.run.te import loaded_te
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import gear_shape, planet_angles
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import DeviationClass, Eccentricity, ProfileSpec, TipRelief

TORQUE = 600.0


@pytest.fixture(scope="module")
def spec() -> Stage:
    return load_stage("planetary54")


@pytest.fixture(scope="module")
def parts(spec: Stage) -> list[Any]:
    return load_bodies(spec)


def in_set(spec: Stage, **fields: Any) -> Stage:
    return rewritten(spec, set=spec.written.set.model_copy(update=fields))


@pytest.mark.full
def test_an_eccentric_planet_at_one_angle_is_a_pin_out_of_its_place(spec: Stage, parts: list[Any]) -> None:
    """At angle 0 of all gears: toothing and pin error are the same place of the teeth of planet 2, so that forces of
    all meshes are the same. Only the moment that the force has about the other axis differs, e/r_b."""
    e, direction, bolt = 20e-6, 1.1, planet_angles(spec.written)[1]
    phase = tooth_phases(spec)["planet2"]
    eccentric = in_set(spec, planet_eccentricity={1: Eccentricity(amount=e, angle=bolt + direction - phase)})
    pinned = in_set(spec, pin_errors={1: (e * math.cos(direction), e * math.sin(direction))})
    plain, found, expected = (loaded_te(assemble(s, parts), [TORQUE], 1) for s in (spec, eccentric, pinned))
    change = np.abs(expected.sharing - plain.sharing).max()
    assert change > 0.02 and np.abs(found.sharing - expected.sharing).max() < 0.01 * change
    assert found.te == pytest.approx(expected.te, abs=0.01 * np.abs(expected.te - plain.te).max())


def test_every_gear_of_a_set_takes_deviations(spec: Stage) -> None:
    """Sun, planets and ring of one class and seed: planets differ; the flanks of a ring are counted from its tip, the
    small roll, to its root."""
    drawn = DeviationClass(tolerance_class=6, seed=3)
    profile = ProfileSpec(slope=4e-6, crowning=1e-6)
    fields = {"deviations": drawn, "profile": profile}
    own = {name: getattr(spec.written, name).model_copy(update=fields) for name in ("sun", "planet", "ring")}
    stage = rewritten(spec, **own)
    first, second, ring = (
        FlankField(stage.bodies[name], gear_shape(stage.bodies[name])) for name in ("planet1", "planet2", "ring")
    )
    assert not np.allclose(first.index(), second.index(), atol=1e-7)
    assert ring.material().shape[0] == spec.written.ring.teeth and not stage.even
    at_root, at_tip = ring.profile(np.array([ring.shape.s_form, ring.shape.s_tip]))
    assert (at_root, at_tip) == (pytest.approx(-3e-6), pytest.approx(1e-6))


@pytest.mark.full
def test_relief_of_a_ring_opens_its_mesh(spec: Stage, parts: list[Any]) -> None:
    """Linear and parabolic relief at the ring's tips, from single contact on: a table for one, numbers for the other;
    both let planets carry later, by less than what they take away."""
    plain, errors = assemble(spec, parts), []
    for kind in ("linear", "parabolic"):
        ring = spec.written.ring.model_copy(update={"tip_relief": TipRelief(amount=20e-6, kind=kind)})
        model = assemble(rewritten(spec, ring=ring), parts)
        sections, number = read_blob(model.blob), [g.name for g in model.stage.gears].index("ring")
        assert (f"flank{number}" in sections) is (kind == "linear")
        errors.append(loaded_te(model, [TORQUE], 2).te[0] - loaded_te(plain, [TORQUE], 2).te[0])
    linear, parabolic = np.abs(errors)
    assert 0.1e-6 < parabolic.max() < linear.max() < 20e-6
