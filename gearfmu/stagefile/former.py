"""Hashes of bodies as gearfmu 0.2 and 0.3 wrote them, by which their files are known again and adopted.

They name the fields of a pair, a set and a general stage one by one. Bodies of today: `stored.body_hash`."""

from __future__ import annotations

from typing import Any

from gearfmu.geometry.mesh import HANDS
from gearfmu.stagefile.forms.general import GearBody, RingBody, Stage
from gearfmu.stagefile.forms.planetary import CarrierBody, PlanetarySpec, RingSpec, SetGearSpec
from gearfmu.stagefile.stored import hash_of
from gearfmu.stagefile.tables.bodies import TOOTHING
from gearfmu.stagefile.tables.housing import HousingBody
from gearfmu.stagefile.tables.imported import import_inputs

ALGORITHM = 2


def former_hash(stage: Stage, name: str) -> str:
    """Hash that gearfmu 0.2 and 0.3 gave the body whose file is `name`; "" of a housing, which they did not know.
    SpecError for an imported file that is not there."""
    table = stage.by_file[name]
    if isinstance(table, HousingBody):
        return ""
    if isinstance(stage.written, PlanetarySpec):
        inputs = _set_inputs(stage.written, name)
    else:
        assert not isinstance(table, CarrierBody), "carriers are of sets"
        inputs = _ring_inputs(table) if isinstance(table, RingBody) else _gear_inputs(table)
        if table.imported is not None:
            inputs["body"].pop("mesh")
            inputs["import"] = import_inputs(table.imported)
    return hash_of(inputs | {"algorithm_version": ALGORITHM})


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


def _set_inputs(spec: PlanetarySpec, name: str) -> dict[str, Any]:
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
            carrier["import"] = import_inputs(spec.carrier.imported)
        return common | place | carrier | {"coupling": {c: spec.carrier.coupling_of(c) for c in couplings}}
    parts: dict[str, SetGearSpec | RingSpec] = dict(zip(HANDS, spec.gears, strict=True))
    part = parts[name]
    gear = part.model_dump(exclude={"name", "imported", "bearing"} | TOOTHING)
    if gear.get("mounts"):
        gear["mounts"].pop("damping_ratio")
    if name != "ring":
        gear["rack"].pop("addendum")  # the tip diameter says where the tooth ends
    if part.imported is not None:
        gear["body"].pop("mesh")
        gear["import"] = import_inputs(part.imported)
    return common | tooth | gear
