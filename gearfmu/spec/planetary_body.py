"""What the bodies of a planetary set depend on."""

from __future__ import annotations

from typing import Any

from gearfmu.spec.planetary import PlanetarySpec

SET_BODIES = ("sun", "planet", "ring", "carrier")


def set_body_inputs(spec: PlanetarySpec, name: str) -> dict[str, Any]:
    """Everything that shapes the body `name` of a set, in SI, and nothing else: not torque, backlash, load sharing."""
    s = spec.set
    common = {"kind": spec.kind, "body": name}
    tooth = {"normal_module": s.normal_module, "pressure_angle": s.pressure_angle, "helix_angle": s.helix_angle}
    if name == "carrier":
        place = {"planets": s.planets, "center_distance": s.center_distance, "seat": spec.planet.face_width}
        couplings = ["bore", *(f"bolt{k}" for k in range(s.planets))]
        carrier = spec.carrier.model_dump(exclude={"coupling"})
        return common | place | carrier | {"coupling": {c: spec.carrier.coupling_of(c) for c in couplings}}
    gear = spec.gears[SET_BODIES.index(name)].model_dump(exclude={"name"})
    if name != "ring":
        gear["rack"].pop("addendum")  # the tip diameter says where the tooth ends
    return common | tooth | gear
