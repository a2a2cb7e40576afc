"""What a reduced body depends on, and its fingerprint."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from gearfmu.spec.flanks import TOOTHING
from gearfmu.spec.imported import import_inputs
from gearfmu.spec.planetary import RingSpec
from gearfmu.spec.stage import StageSpec


def body_inputs(spec: StageSpec, gear_index: int) -> dict[str, Any]:
    """Everything that shapes the body of a gear, in SI, and nothing else.

    Backlash, what is said of the flanks (`flanks.Toothing`), misalignment, contact, ports, levels, names and bearings
    do not. The helix angle is the gear's own, positive for a right-handed one: that of the wheel is minus the pair's.

    The rack's addendum is left out too: the tip diameter says where the tooth ends. An imported body depends on the
    contents of its files, and not on the counts of our own mesh; SpecError when a file is missing.
    """
    gear, pair = spec.gears[gear_index], spec.pair
    if isinstance(gear, RingSpec):
        return _ring_inputs(spec, gear)
    inputs: dict[str, Any] = {
        "kind": spec.kind,
        "teeth": gear.teeth,
        "normal_module": pair.normal_module,
        "pressure_angle": pair.pressure_angle,
        "helix_angle": -pair.helix_angle if gear_index else pair.helix_angle,
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
    if gear.rigid_bore:
        inputs["bore_coupling"] = gear.bore_coupling
    if gear.imported is not None:
        inputs["import"] = import_inputs(gear.imported, spec.source, f"{gear_table(spec, gear.name)}.import")
        inputs["body"].pop("mesh")
    return inputs


def gear_table(spec: Any, name: str) -> str:
    """The table of a gear in its stage file: "gears.pinion", in a general stage "bodies.pinion"."""
    return f"{getattr(spec, 'tables', 'gears')}.{name}"


def _ring_inputs(spec: StageSpec, ring: RingSpec) -> dict[str, Any]:
    """`body_inputs` of the ring of a general stage."""
    others = {"name", "kind", "mounts", "imported", "rim_coupling"} | TOOTHING
    inputs = {"kind": "ring"} | ring.model_dump(exclude=others)
    if not inputs["helix_angle"]:
        inputs.pop("helix_angle")  # files of spur rings are older than helical ones
    if getattr(ring, "rigid_bore", False):  # a ring of a general stage
        inputs["rim_coupling"] = "rigid"
    if ring.imported is not None:
        inputs["import"] = import_inputs(ring.imported, spec.source, f"bodies.{ring.name}.import")
        inputs["body"].pop("mesh")
    return inputs


def body_hash(inputs: dict[str, Any]) -> str:
    """SHA-256 (64 hex digits) of the inputs as JSON: sorted keys, floats in their shortest exact form, −0 as 0."""
    text = json.dumps(_plain(inputs), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value + 0.0 if isinstance(value, float) else value
