"""What the bodies of a planetary set depend on."""

from __future__ import annotations

from typing import Any

from gearfmu.geometry.planetary import HANDS
from gearfmu.spec.forms.planetary import PlanetarySpec, RingSpec, SetGearSpec
from gearfmu.spec.tables.flanks import TOOTHING
from gearfmu.spec.tables.imported import import_inputs


def set_body_inputs(spec: PlanetarySpec, name: str) -> dict[str, Any]:
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
        gear["mounts"].pop("damping_ratio")
    if name != "ring":
        gear["rack"].pop("addendum")  # the tip diameter says where the tooth ends
    if part.imported is not None:
        gear["body"].pop("mesh")
        gear["import"] = import_inputs(part.imported, spec.source, f"{name}.import")
    return common | tooth | gear
