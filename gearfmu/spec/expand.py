"""Builders: a pair file in the terms of any stage."""

from __future__ import annotations

from typing import Any

from gearfmu.spec.gear import GearSpec
from gearfmu.spec.general import (
    EngagementSpec,
    GearBody,
    GeneralStage,
    PlacedPort,
    RingBody,
    RotorSpec,
    ShaftBody,
    SupportSpec,
)
from gearfmu.spec.stage import StageSpec


def as_general(spec: StageSpec | GeneralStage) -> GeneralStage:
    """The stage in the terms of any stage, whichever way its file is written."""
    return expand_pair(spec) if isinstance(spec, StageSpec) else spec


def expand_pair(spec: StageSpec) -> GeneralStage:
    """A pair in the terms of any stage: two rotors of one gear each, on an isotropic bearing at mid-width; pinion at
    the origin, wheel on +x."""
    pair, axes = spec.pair, ((0.0, 0.0), (spec.pair.center_distance, 0.0))
    angles: dict[str, Any] = {"normal_module": pair.normal_module, "pressure_angle": pair.pressure_angle}
    pinion, wheel = spec.gears
    bodies: dict[str, GearBody | RingBody | ShaftBody] = {}
    for gear, hand in zip(spec.gears, (1, -1), strict=True):
        known = {name: getattr(gear, name) for name in GearSpec.model_fields} | {"bearing": None}
        bodies[gear.name] = GearBody(**known, **angles, helix_angle=hand * pair.helix_angle + 0.0)
    return GeneralStage(
        name=spec.name,
        description=spec.description,
        source=spec.source,
        slices=spec.contact.slices,
        bodies=bodies,
        rotors={g.name: RotorSpec(axis=axis, bodies={g.name: 0.0}) for g, axis in zip(spec.gears, axes, strict=True)},
        engagements=(
            EngagementSpec(
                name="mesh",
                gears=(pinion.name, wheel.name),
                backlash=pair.backlash,
                damping=spec.contact.damping,
                torque_max=spec.torque_max,
                speed_max=spec.speed_max,
                misalignment=pair.misalignment,
            ),
        ),
        supports=tuple(
            SupportSpec(
                name=gear.name,
                body=gear.name,
                radial=gear.bearing.stiffness,
                axial=gear.bearing.axial,
                tilt=gear.bearing.tilt,
                damping_ratio=gear.bearing.damping_ratio,
            )
            for gear in spec.gears
        ),
        ports={g.name: PlacedPort(**dict(spec.ports[g.name]), body=g.name) for g in spec.gears},
        levels=spec.levels,
    )
