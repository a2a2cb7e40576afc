"""Hashes of bodies as gearfmu 0.2 and 0.3 wrote them, by which their files are known again and adopted.

Bodies of today: `stored.body_hash`."""

from __future__ import annotations

from typing import Any

from gearfmu.geometry.mesh import HANDS
from gearfmu.stagefile.forms.general import RingBody, Stage, ToothedBody
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
        inputs = _toothed_inputs(table, "bore_coupling", "rim_coupling", "mounts")
        if isinstance(table, RingBody):
            inputs |= {"rim_coupling": table.rim_coupling} if table.rigid_bore else {}
            if not inputs["helix_angle"]:
                inputs.pop("helix_angle")  # files of spur rings are older than helical ones
        else:
            inputs |= {"kind": "external_pair"} | ({"bore_coupling": table.bore_coupling} if table.rigid_bore else {})
    return hash_of(inputs | {"algorithm_version": ALGORITHM})


def _toothed_inputs(gear: ToothedBody | SetGearSpec | RingSpec, *others: str) -> dict[str, Any]:
    """Fields of a gear but for name, flanks, bearing and `others`; a field that is younger than 0.3 is one of these."""
    inputs = gear.model_dump(exclude={"name", "bearing", "imported", *others} | TOOTHING)
    if "rack" in inputs:
        inputs["rack"].pop("addendum")  # the tip diameter says where the tooth ends
    if gear.imported is not None:
        inputs["body"].pop("mesh")
        inputs["import"] = import_inputs(gear.imported)
    return inputs


def _set_inputs(spec: PlanetarySpec, name: str) -> dict[str, Any]:
    s, common = spec.set, {"kind": spec.kind, "body": name}
    if name == "carrier":
        place: dict[str, Any] = {
            "planets": s.planets, "center_distance": s.center_distance, "seat": spec.planet.face_width
        }  # fmt: skip
        if s.positions is not None:
            place["positions"] = [k / (spec.sun.teeth + spec.ring.teeth) for k in s.positions]
        couplings = ["bore", *(f"bolt{k}" for k in range(s.planets))]
        carrier = spec.carrier.model_dump(exclude={"coupling", "imported", "bearing"})
        if spec.carrier.imported is not None:
            carrier.pop("mesh")
            carrier["import"] = import_inputs(spec.carrier.imported)
        return common | place | carrier | {"coupling": {c: spec.carrier.coupling_of(c) for c in couplings}}
    parts: dict[str, SetGearSpec | RingSpec] = dict(zip(HANDS, spec.gears, strict=True))
    gear, helix = _toothed_inputs(parts[name]), HANDS[name] * s.helix_angle
    if gear.get("mounts"):
        gear["mounts"].pop("damping_ratio")
    tooth = {"normal_module": s.normal_module, "pressure_angle": s.pressure_angle, "helix_angle": helix}
    return common | tooth | gear
