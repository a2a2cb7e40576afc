"""Hashes of bodies as gearfmu 0.2 and 0.3 wrote them, by which their files are known again and adopted.

Bodies of today: `stored.body_hash`."""

from __future__ import annotations

from typing import Any

from gearfmu.geometry.mesh import HANDS
from gearfmu.stagefile.forms.general import RingBody, Stage
from gearfmu.stagefile.forms.planetary import CarrierBody, PlanetarySpec
from gearfmu.stagefile.stored import hash_of, shaping
from gearfmu.stagefile.tables.bodies import TOOTHING, RingSpec, SetGearSpec
from gearfmu.stagefile.tables.housing import HousingBody

ALGORITHM = 2
_LATER = {"name", "bearing"} | TOOTHING  # fields of a gear that did not count, or are younger than 0.3


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
        inputs = shaping(table, _LATER | {"bore_coupling", "rim_coupling", "mounts"})
        if isinstance(table, RingBody):
            inputs |= {"rim_coupling": table.rim_coupling} if table.rigid_bore else {}
            if not inputs["helix_angle"]:
                inputs.pop("helix_angle")  # files of spur rings are older than helical ones
        else:
            inputs |= {"kind": "external_pair"} | ({"bore_coupling": table.bore_coupling} if table.rigid_bore else {})
    return hash_of(inputs | {"algorithm_version": ALGORITHM})


def _set_inputs(spec: PlanetarySpec, name: str) -> dict[str, Any]:
    s, common = spec.set, {"kind": spec.kind, "body": name}
    if name == "carrier":
        place: dict[str, Any] = {
            "planets": s.planets, "center_distance": s.center_distance, "seat": spec.planet.face_width
        }  # fmt: skip
        if s.positions is not None:
            place["positions"] = [k / (spec.sun.teeth + spec.ring.teeth) for k in s.positions]
        couplings = ["bore", *(f"bolt{k}" for k in range(s.planets))]
        carrier = shaping(spec.carrier, {"coupling", "bearing"})
        return common | place | carrier | {"coupling": {c: spec.carrier.coupling_of(c) for c in couplings}}
    parts: dict[str, SetGearSpec | RingSpec] = dict(zip(HANDS, spec.gears, strict=True))
    gear, helix = shaping(parts[name], _LATER), HANDS[name] * s.helix_angle
    if gear.get("mounts"):
        gear["mounts"].pop("damping_ratio")
    tooth = {"normal_module": s.normal_module, "pressure_angle": s.pressure_angle, "helix_angle": helix}
    return common | tooth | gear
