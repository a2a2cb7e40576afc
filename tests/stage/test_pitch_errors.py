"""Pitch errors by hand: a tooth out of its place by F_pi moves its flanks by F_pi cos α along their normals, towards
the other gear on one side and away from it on the other. Flanks and runout of sets."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gearfmu.body import Body, load_bodies
from gearfmu.geometry import PairGeometry
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stage.assembly.blob import read_blob
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stage.assembly.teeth import FlankField
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import gear_shape, planet_angles
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import expected_hash
from gearfmu.stagefile.tables.bodies import DeviationClass, Eccentricity, ProfileSpec, TipRelief

LIGHT, LOAD, POSITIONS = 1e-3, 302.0, 64
DEVIATION = 50e-6
ALONG_NORMAL = DEVIATION * math.cos(math.radians(20.0))
TEETH = (16, 24)


def with_deviations(spec: Stage, *tables: dict[int, float]) -> Stage:
    """The stage with index deviations (tooth → m) of pinion and wheel."""
    pairs = zip(spec.written.gears, tables, strict=True)
    gears = tuple(gear.model_copy(update={"index_deviation": table}) for gear, table in pairs)
    return rewritten(spec, gears=gears)


def light_te(spec: Stage, bodies: list[Body], *tables: dict[int, float], torque: float = LIGHT) -> np.ndarray:
    return loaded_te(assemble(with_deviations(spec, *tables), bodies), [torque], POSITIONS).te[0]


@pytest.mark.parametrize("gear", [0, 1])
def test_a_protruding_tooth_holds_the_pinion_back_while_it_is_in_mesh(
    gear: int, spec: Stage, bodies: list[Body]
) -> None:
    """Unloaded te is −F_pi cos α as long as tooth 0 is on its flank, 0 once only its neighbour is in mesh, and never
    below; in mesh for the contact ratio less the stretch at the other end where the neighbours have not come yet."""
    tables: list[dict[int, float]] = [{}, {}]
    tables[gear] = {0: DEVIATION}
    te = light_te(spec, bodies, *tables)
    held, free = np.abs(te + ALONG_NORMAL) < 2e-9, np.abs(te) < 2e-9
    assert held.sum() > 0.4 * POSITIONS and free.sum() > 0.3 * POSITIONS
    assert np.all(te > -ALONG_NORMAL - 2e-9) and np.all(te < 2e-9)
    assert held[0] and free[-1] and np.all(np.diff(held.astype(int)) <= 0) and np.all(np.diff(free.astype(int)) >= 0)


def test_coast_flanks_see_the_other_side(spec: Stage, bodies: list[Body], pair: PairGeometry) -> None:
    """The flank that leads on the drive side trails on the coast side: what protrudes there has a negative sign."""
    te = light_te(spec, bodies, {0: -DEVIATION}, {}, torque=-LIGHT)
    held = np.abs(te + pair.normal_backlash - ALONG_NORMAL) < 5e-9
    assert held.mean() > 0.4 and np.all(te < -pair.normal_backlash + ALONG_NORMAL + 5e-9)
    receding = light_te(spec, bodies, {0: DEVIATION}, {}, torque=-LIGHT)
    assert np.all(receding < -pair.normal_backlash + 5e-9)


def test_all_teeth_out_by_the_same_are_a_turned_gear(spec: Stage, bodies: list[Body], plain: StageModel) -> None:
    """But for the elastic rows, which stay with the teeth's nominal places and directions (F_pi/r = 1.4 mrad)."""
    tables = ({k: DEVIATION for k in range(TEETH[0])}, {})
    te = loaded_te(assemble(with_deviations(spec, *tables), bodies), [LOAD], 16).te[0]
    assert np.allclose(te + ALONG_NORMAL, loaded_te(plain, [LOAD], 16).te[0], rtol=0, atol=1e-7)


def test_bodies_and_models_without_deviations_are_what_they_were(
    spec: Stage, bodies: list[Body], plain: StageModel
) -> None:
    changed = with_deviations(spec, {3: DEVIATION}, {})
    assert [expected_hash(changed, name) for name in ("pinion", "wheel")] == [
        expected_hash(spec, name) for name in ("pinion", "wheel")
    ]
    assert assemble(changed, bodies).hash != plain.hash
    none, own = (read_blob(m.blob) for m in (assemble(with_deviations(spec, {3: 0.0}, {}), bodies), plain))
    assert all(np.array_equal(none[name], own[name]) for name in own if name not in ("made_of", "guid"))


# ---- flanks and runout of sets: the same fields, whatever the stage is made of ---------------------------------------
TORQUE = 600.0  # N·m on the carrier


@pytest.fixture(scope="module")
def of_set() -> Stage:
    return load_stage("planetary54")


@pytest.fixture(scope="module")
def parts(of_set: Stage) -> list[Any]:
    return load_bodies(of_set)


def in_set(of_set: Stage, **fields: Any) -> Stage:
    return rewritten(of_set, set=of_set.written.set.model_copy(update=fields))


@pytest.mark.full
def test_an_eccentric_planet_at_one_angle_is_a_pin_out_of_its_place(of_set: Stage, parts: list[Any]) -> None:
    """At angle 0 of all gears: toothing and pin error are the same place of the teeth of planet 2, so that forces of
    all meshes are the same. Only the moment that the force has about the other axis differs, e/r_b."""
    e, direction, bolt = 20e-6, 1.1, planet_angles(of_set.written)[1]
    phase = tooth_phases(of_set)["planet2"]
    eccentric = in_set(of_set, planet_eccentricity={1: Eccentricity(amount=e, angle=bolt + direction - phase)})
    pinned = in_set(of_set, pin_errors={1: (e * math.cos(direction), e * math.sin(direction))})
    plain, found, expected = (loaded_te(assemble(s, parts), [TORQUE], 1) for s in (of_set, eccentric, pinned))
    change = np.abs(expected.sharing - plain.sharing).max()
    assert change > 0.02 and np.abs(found.sharing - expected.sharing).max() < 0.01 * change
    assert found.te == pytest.approx(expected.te, abs=0.01 * np.abs(expected.te - plain.te).max())


def test_every_gear_of_a_set_takes_deviations(of_set: Stage) -> None:
    """Sun, planets and ring of one class and seed: planets differ; the flanks of a ring are counted from its tip, the
    small roll, to its root."""
    drawn = DeviationClass(tolerance_class=6, seed=3)
    profile = ProfileSpec(slope=4e-6, crowning=1e-6)
    fields = {"deviations": drawn, "profile": profile}
    own = {name: getattr(of_set.written, name).model_copy(update=fields) for name in ("sun", "planet", "ring")}
    stage = rewritten(of_set, **own)
    first, second, ring = (
        FlankField(stage.bodies[name], gear_shape(stage.bodies[name])) for name in ("planet1", "planet2", "ring")
    )
    assert not np.allclose(first.index(), second.index(), atol=1e-7)
    assert ring.material().shape[0] == of_set.written.ring.teeth and not stage.even
    at_root, at_tip = ring.profile(np.array([ring.shape.s_form, ring.shape.s_tip]))
    assert (at_root, at_tip) == (pytest.approx(-3e-6), pytest.approx(1e-6))


@pytest.mark.full
def test_relief_of_a_ring_opens_its_mesh(of_set: Stage, parts: list[Any]) -> None:
    """Linear and parabolic relief at the ring's tips, from single contact on: a table for one, numbers for the other;
    both let planets carry later, by less than what they take away."""
    plain, errors = assemble(of_set, parts), []
    for kind in ("linear", "parabolic"):
        ring = of_set.written.ring.model_copy(update={"tip_relief": TipRelief(amount=20e-6, kind=kind)})
        model = assemble(rewritten(of_set, ring=ring), parts)
        sections, number = read_blob(model.blob), [g.name for g in model.stage.gears].index("ring")
        assert (f"flank{number}" in sections) is (kind == "linear")
        errors.append(loaded_te(model, [TORQUE], 2).te[0] - loaded_te(plain, [TORQUE], 2).te[0])
    linear, parabolic = np.abs(errors)
    assert 0.1e-6 < parabolic.max() < linear.max() < 20e-6
