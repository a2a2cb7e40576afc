"""The fingerprint of a body: what changes it, and what must not."""

from __future__ import annotations

import json
from typing import Any

import pytest

from gearfmu.stagefile.forms.expand import expand
from gearfmu.stagefile.forms.pair import StageSpec
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import body_inputs, expected_hash, hash_of
from gearfmu.stagefile.tables.bodies import (
    BodySpec,
    DeviationClass,
    Eccentricity,
    EndRelief,
    LeadSpec,
    ProfileSpec,
    RootRelief,
    Wobble,
)
from gearfmu.stagefile.tables.connections import Misalignment

STAGE = load_stage("fzg_c").written


def with_field(field: str, value: Any, stage: StageSpec = STAGE) -> StageSpec:
    """The file's tables with one field replaced ("gears.0.teeth")."""
    parts: list[Any] = [int(part) if part.isdigit() else part for part in field.split(".")]

    def put(owner: Any, rest: list[Any]) -> Any:
        if not rest:
            return value
        key = rest[0]
        if isinstance(owner, tuple):
            return tuple(put(item, rest[1:]) if k == key else item for k, item in enumerate(owner))
        if isinstance(owner, dict):
            return owner | {key: put(owner[key], rest[1:])}
        assert key in type(owner).model_fields
        return owner.model_copy(update={key: put(getattr(owner, key), rest[1:])})

    return put(stage, parts)


def fingerprint(form: StageSpec, index: int = 0) -> str:
    names = [gear.name for gear in form.gears]
    ports = dict(zip(names, form.ports.values(), strict=True))
    return expected_hash(expand(form.model_copy(update={"ports": ports})), names[index])


SHAPING = [
    ("gears.0.teeth", 17),
    ("gears.0.profile_shift", 0.2),
    ("gears.0.tip_diameter", 82e-3),
    ("gears.0.face_width", 15e-3),
    ("gears.0.bore_diameter", 31e-3),
    ("gears.0.bore_coupling", "rigid"),
    ("gears.0.tip_edge_radius", 0.1e-3),
    ("gears.0.rack.dedendum", 1.3),
    ("gears.0.rack.fillet_radius", 0.3),
    ("gears.0.material.youngs_modulus", 207e9),
    ("gears.0.material.density", 7800.0),
    ("gears.0.material.poisson_ratio", 0.29),
    ("gears.0.modal_damping", 0.02),
    ("gears.0.body.strip_half_width", 0.61234e-3),
    ("gears.0.body.modes", 1999),
    ("gears.0.body.roll_points", 199),
    ("gears.0.body.width_functions", 19),
    ("gears.0.body.mesh.scale", 7.5),
    ("gears.0.body.mesh.rim", 99),
    ("pair.normal_module", 4.4e-3),
    ("pair.pressure_angle", 0.4),
    ("pair.helix_angle", 0.2),
]
OTHERS = [
    ("name", "x"),
    ("description", "x"),
    ("torque_max", 1.0),
    ("speed_max", 1.0),
    ("pair.backlash", 0.0),
    ("pair.center_distance", 92e-3),
    ("gears.0.name", "x"),
    ("gears.0.rack.addendum", 1.1),
    ("gears.1.teeth", 25),
    ("gears.0.bearing.stiffness", 1e8),
    ("gears.0.index_deviation", {3: 50e-6}),
    ("gears.0.lead", LeadSpec(slope=5e-6, crowning=3e-6, end_relief=EndRelief(amount=4e-6, length=1e-3))),
    ("gears.0.root_relief", RootRelief(amount=5e-6)),
    ("gears.0.profile", ProfileSpec(slope=5e-6, crowning=3e-6)),
    ("gears.0.topography", "flanks.csv"),
    ("gears.0.pitch_deviation", (1e-6, -1e-6) * 8),
    ("gears.0.deviations", DeviationClass(tolerance_class=6)),
    ("gears.0.eccentricity", Eccentricity(amount=5e-6)),
    ("gears.0.wobble", Wobble(amount=1e-4)),
    ("pair.misalignment", Misalignment(out_of_plane=5e-6, in_plane=-5e-6, span=0.1)),
    ("contact.slices", 1),
    ("contact.damping", 0.0),
    ("ports.pinion.k", 1.0),
    ("levels.fast_cut", 1e3),
]


@pytest.mark.parametrize(("field", "value"), SHAPING + OTHERS)
def test_what_shapes_the_body_alone_changes_its_hash(field: str, value: Any) -> None:
    assert (fingerprint(with_field(field, value)) != fingerprint(STAGE)) == ((field, value) in SHAPING)


def test_every_field_of_a_gear_is_in_one_of_the_two_lists() -> None:
    """A new field must be put into one of them, or it would silently not count."""
    named = {field.split(".")[2] for field, _ in SHAPING + OTHERS if field.startswith("gears.0")}
    elsewhere = {"tip_relief", "imported"}  # below, and tests/imports
    assert named | elsewhere == set(type(STAGE.gears[0]).model_fields)


def test_the_hand_of_a_gear_is_part_of_its_body() -> None:
    """Pinion and wheel of one pair are of opposite hand, and turning the pair's hand round changes both bodies."""
    right, left = with_field("pair.helix_angle", 0.2), with_field("pair.helix_angle", -0.2)
    assert [body_inputs(gear)["helix_angle"] for gear in expand(right).gears] == [0.2, -0.2]
    assert all(fingerprint(right, k) != fingerprint(left, k) for k in (0, 1))


def test_tip_relief_shares_the_bodies() -> None:
    relieved = load_stage("fzg_c/stage_relief").written
    assert [fingerprint(relieved, k) for k in (0, 1)] == [fingerprint(STAGE, k) for k in (0, 1)]
    assert fingerprint(STAGE, 0) != fingerprint(STAGE, 1)


def test_default_counts_are_those_of_the_shipped_bodies() -> None:
    """A stage file that says nothing but the strip gets the mesh on which the shipped pair is converged."""
    bare = with_field("gears.0.body", BodySpec(strip_half_width=STAGE.gears[0].body.strip_half_width))
    assert fingerprint(bare) == fingerprint(STAGE)


def test_hash_is_of_the_values_not_of_their_spelling() -> None:
    inputs = body_inputs(expand(STAGE).by_file["pinion"])
    assert hash_of(json.loads(json.dumps(inputs))) == hash_of(dict(reversed(inputs.items())))
    assert hash_of(inputs | {"profile_shift": -0.0}) == hash_of(inputs | {"profile_shift": 0.0})
    assert hash_of({"a": 0.1}) == "9e3d5635fc1c09ff15c19f1089a0bfe03fbd8329cca722f9a2227060ac77dcaa"  # {"a":0.1}
