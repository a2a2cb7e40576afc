"""What a reduced body depends on, and its fingerprint."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from gearfmu.geometry.planetary import HANDS
from gearfmu.spec.forms.general import GearBody, RingBody, Stage
from gearfmu.spec.forms.members import Member, member_of
from gearfmu.spec.forms.planetary import PlanetarySpec, RingSpec, SetGearSpec
from gearfmu.spec.tables.flanks import TOOTHING
from gearfmu.spec.tables.imported import import_inputs


def body_inputs(stage: Stage, name: str) -> dict[str, Any]:
    """Everything that shapes the body `name` of a stage, in SI, and nothing else.

    Backlash, what is said of the flanks (`flanks.Toothing`), misalignment, contact, ports, levels, names, torques and
    bearings do not. The helix angle is the gear's own, positive for a right-handed one. The same gear has the same
    inputs in a pair and in a general stage.

    The rack's addendum is left out too: the tip diameter says where the tooth ends. An imported body depends on the
    contents of its files, and not on the counts of our own mesh; SpecError when a file is missing.
    """
    if name in {housing.name for housing in stage.housings}:
        return _housing_inputs(stage, name)
    if isinstance(stage.written, PlanetarySpec):
        return _set_inputs(stage.written, name)
    member = member_of(stage, name)
    inputs = _ring_inputs(member.gear) if isinstance(member.gear, RingBody) else _gear_inputs(member.gear)
    return inputs | _imported_inputs(member, inputs["body"], stage.source)


def _gear_inputs(gear: GearBody) -> dict[str, Any]:
    inputs: dict[str, Any] = {
        "kind": "external_pair",
        "teeth": gear.teeth,
        "normal_module": gear.normal_module,
        "pressure_angle": gear.pressure_angle,
        "helix_angle": gear.helix_angle,
        "profile_shift": gear.profile_shift,
        "tip_diameter": gear.tip_diameter,
        "tip_edge_radius": gear.tip_edge_radius,
        "face_width": gear.face_width,
        "bore_diameter": gear.bore_diameter,
        "rack": {"dedendum": gear.rack.dedendum, "fillet_radius": gear.rack.fillet_radius},
        "material": gear.material.model_dump(),
        "modal_damping": gear.modal_damping,
        "body": gear.body.model_dump(),
    }
    return inputs | ({"bore_coupling": gear.bore_coupling} if gear.rigid_bore else {})


def _ring_inputs(ring: RingBody) -> dict[str, Any]:
    others = {"name", "kind", "mounts", "imported", "rim_coupling"} | TOOTHING
    inputs = {"kind": "ring"} | ring.model_dump(exclude=others)
    if not inputs["helix_angle"]:
        inputs.pop("helix_angle")  # files of spur rings are older than helical ones
    return inputs | ({"rim_coupling": ring.rim_coupling} if ring.rigid_bore else {})


def _housing_inputs(stage: Stage, name: str) -> dict[str, object]:
    """Everything that shapes a housing: not its name, nor what of it is dynamic."""
    housing = next(own for own in stage.housings if own.name == name)
    tables = housing.model_dump(exclude={"name", "imported", "reduced", "dynamic_to"})
    own = housing.table
    return tables | {own: import_inputs(housing.made_of, stage.source, f"bodies.{name}.{own}")}


def _set_inputs(spec: PlanetarySpec, name: str) -> dict[str, Any]:
    """Everything that shapes the body `name` of a set, in SI, and nothing else: not torque, backlash, load sharing,
    bearings, what is said of the flanks (`flanks.Toothing`), contact, ports, levels.

    An imported body depends on the contents of its files, not on our element counts; SpecError when a file is missing.
    """
    s, hand = spec.set, HANDS.get(name, 1)
    common = {"kind": spec.kind, "body": name}
    tooth = {
        "normal_module": s.normal_module,
        "pressure_angle": s.pressure_angle,
        "helix_angle": hand * s.helix_angle,
    }
    if name == "carrier":
        place: dict[str, Any] = {
            "planets": s.planets,
            "center_distance": s.center_distance,
            "seat": spec.planet.face_width,
        }
        if s.positions is not None:
            place["positions"] = [k / (spec.sun.teeth + spec.ring.teeth) for k in s.positions]
        couplings = ["bore", *(f"bolt{k}" for k in range(s.planets))]
        carrier = spec.carrier.model_dump(exclude={"coupling", "imported", "bearing"})
        if spec.carrier.imported is not None:
            carrier.pop("mesh")
            carrier["import"] = import_inputs(spec.carrier.imported, spec.source, "carrier.import")
        return common | place | carrier | {"coupling": {c: spec.carrier.coupling_of(c) for c in couplings}}
    parts: dict[str, SetGearSpec | RingSpec] = dict(zip(HANDS, spec.gears, strict=True))
    part = parts[name]
    gear = part.model_dump(exclude={"name", "imported", "bearing"} | TOOTHING)
    if gear.get("mounts"):
        gear["mounts"] = {key: gear["mounts"][key] for key in ("points", "stiffness")}
    if name != "ring":
        gear["rack"].pop("addendum")  # the tip diameter says where the tooth ends
    if part.imported is not None:
        gear["body"].pop("mesh")
        gear["import"] = import_inputs(part.imported, spec.source, f"{name}.import")
    return common | tooth | gear


def _imported_inputs(member: Member, body: dict[str, Any], source: Path) -> dict[str, Any]:
    """What finite elements made elsewhere add; the counts of our own mesh leave `body`."""
    if member.gear.imported is None:
        return {}
    body.pop("mesh")
    return {"import": import_inputs(member.gear.imported, source, f"{member.place}.import")}


def body_hash(inputs: dict[str, Any]) -> str:
    """SHA-256 (64 hex digits) of the inputs as JSON: sorted keys, floats in their shortest exact form, −0 as 0."""
    text = json.dumps(_plain(inputs), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value + 0.0 if isinstance(value, float) else value
