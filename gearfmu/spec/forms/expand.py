"""Builders: a pair file and a planetary set in the terms of any stage."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeVar

from gearfmu.errors import Problem, SpecError
from gearfmu.spec.forms.general import (
    CarrierBody,
    EngagementSpec,
    PlacedPort,
    RotorSpec,
    Stage,
    SupportSpec,
)
from gearfmu.spec.forms.general_checks import with_relief_rolls
from gearfmu.spec.forms.members import CARRIER, Form, body_names, members, set_gear, set_ring
from gearfmu.spec.forms.pair import StageSpec
from gearfmu.spec.forms.planetary import CarrierSpec, PlanetarySpec
from gearfmu.spec.forms.planetary_checks import mesh_torque
from gearfmu.spec.forms.shapes import planet_angles
from gearfmu.spec.tables.bearings import Bearing, RollingMount

Body = TypeVar("Body")


def as_general(spec: Form) -> Stage:
    """The stage in the terms of any stage, whichever way its file is written. SpecError: `expand_set`."""
    if isinstance(spec, PlanetarySpec):
        return expand_set(spec)
    return expand_pair(spec) if isinstance(spec, StageSpec) else spec


def expand_pair(spec: StageSpec) -> Stage:
    """A pair in the terms of any stage: two rotors of one gear each, on an isotropic bearing at mid-width; pinion at
    the origin, wheel on +x."""
    pair, axes = spec.pair, ((0.0, 0.0), (spec.pair.center_distance, 0.0))
    pinion, wheel = spec.gears
    return Stage(
        name=spec.name,
        description=spec.description,
        source=spec.source,
        slices=spec.contact.slices,
        nodal=spec.contact.nodal,
        bodies={name: member.gear for name, member in members(spec).items()},
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
                friction=spec.contact.friction,
                film=spec.contact.film,
            ),
        ),
        supports=tuple(_held(gear.name, gear.bearing) for gear in spec.gears),
        bearings=spec.bearings,
        operating=spec.operating,
        ports={g.name: PlacedPort(**dict(spec.ports[g.name]), body=g.name) for g in spec.gears},
        levels=spec.levels,
    )


def expand_set(spec: PlanetarySpec) -> Stage:
    """A planetary set in the terms of any stage: carrier on the ground, sun, planets and ring in the axes of the
    carrier, in which they roll like gears on fixed axes; planets on the carrier's bolts. Sun and ring rest on isotropic
    springs, which are constant in any axes: of the ring, all its mounts together, smeared round its rim. With a port of
    its own the ring turns in them, held by the port.

    SpecError for what a set needs to move and does not say.
    """
    if problems := motion_problems(spec):
        raise SpecError(problems)
    assert spec.contact is not None
    planets = [f"planet{k + 1}" for k in range(spec.set.planets)]
    bodies: dict[str, Any] = {"sun": set_gear(spec.sun, spec.set)}
    for k, name in enumerate(planets):
        eccentricity = spec.set.planet_eccentricity.get(k, spec.planet.eccentricity)
        bodies[name] = set_gear(spec.planet, spec.set, name=name, eccentricity=eccentricity)
    bodies["ring"] = set_ring(spec.ring, spec.set)
    carrier = {name: getattr(spec.carrier, name) for name in CarrierSpec.model_fields}
    bodies["carrier"] = CarrierBody(**carrier, name="carrier", kind="carrier")
    stage = Stage(
        name=spec.name,
        description=spec.description,
        source=spec.source,
        slices=spec.contact.slices,
        nodal=spec.contact.nodal,
        bodies=bodies,
        rotors=_set_rotors(spec, planets),
        engagements=_set_meshes(spec, planets),
        supports=_set_supports(spec, planets),
        ports={
            name: PlacedPort(**dict(port), body=name, node="bore" if name == "carrier" else None)
            for name, port in spec.ports.items()
        },
        levels=spec.levels,
    )
    return with_relief_rolls(stage)


def spread(spec: Form, bodies: Sequence[Body]) -> dict[str, Body]:
    """One of `bodies` (or of what stands for them, such as their hashes), in the order of `body_names`, for every body
    of `as_general(spec)` by name: the planets of a set share one."""
    own = dict(zip(body_names(spec), bodies, strict=True))
    if isinstance(spec, PlanetarySpec):
        planets = {f"planet{k + 1}": own["planet"] for k in range(spec.set.planets)}
        return {"sun": own["sun"], **planets, "ring": own["ring"], CARRIER: own[CARRIER]}
    return own


def motion_problems(spec: PlanetarySpec) -> list[Problem]:
    """What a set needs to move and does not say."""
    example = 'stiffness = "3e8 N/m", axial = "1e8 N/m", tilt = "1e5 N*m/rad"'
    given: dict[str, tuple[Any, str]] = {
        "speed_max": (spec.speed_max, 'speed_max = "300 rad/s"'),
        "contact": (spec.contact, 'damping = "50e3 N*s/m^2"'),
        "ring.mounts": (spec.ring.mounts, 'points = 6, stiffness = "1e8 N/m"'),
    }
    held = {"sun": spec.sun.bearing, "planet": spec.planet.bearing, "carrier": spec.carrier.bearing}
    given |= {f"{name}.bearing": (bearing, example) for name, bearing in held.items()}
    for name, bearing in held.items():
        for field in ("axial", "tilt") if bearing is not None else ():
            given[f"{name}.bearing.{field}"] = (getattr(bearing, field), example)
    found = [
        Problem(str(spec.source), field, "missing", f"a set needs it to move: write {how}")
        for field, (value, how) in given.items()
        if value is None
    ]
    if set(spec.ports) - {"ring"} != {"carrier", "sun"}:
        remedy = (
            "a set is driven and loaded at carrier and sun, and may be held at the ring: write [ports.carrier] and "
            "[ports.sun], e.g. kind"
        )
        found.append(Problem(str(spec.source), "ports", ", ".join(spec.ports) or "missing", f'{remedy} = "torque"'))
    return found


def _set_rotors(spec: PlanetarySpec, planets: list[str]) -> dict[str, RotorSpec]:
    rotors = {"sun": RotorSpec(axis=(0.0, 0.0), bodies={"sun": 0.0}, carried_by="carrier")}
    angles = planet_angles(spec)
    for k, name in enumerate(planets):
        c, s = math.cos(angles[k]), math.sin(angles[k])
        radial, tangential = spec.set.pin_errors.get(k, (0.0, 0.0))
        rotors[name] = RotorSpec(
            axis=(spec.set.center_distance * c, spec.set.center_distance * s),
            offset=(radial * c - tangential * s, radial * s + tangential * c),
            bodies={name: 0.0},
            carried_by="carrier",
        )
    rotors["ring"] = RotorSpec(
        axis=(0.0, 0.0), bodies={"ring": 0.0}, carried_by="carrier", stands="ring" not in spec.ports
    )
    rotors["carrier"] = RotorSpec(axis=(0.0, 0.0), bodies={"carrier": 0.0})
    return rotors


def _set_meshes(spec: PlanetarySpec, planets: list[str]) -> tuple[EngagementSpec, ...]:
    assert spec.contact is not None and spec.speed_max is not None
    z_s, z_p, z_r = (gear.teeth for gear in spec.gears)
    contact = {name: getattr(spec.contact, name) for name in ("damping", "friction", "film")}
    common: dict[str, Any] = {"backlash": spec.set.backlash, **contact}
    torque, relative = mesh_torque(spec), spec.speed_max * z_r  # teeth past a planet in the carrier's axes
    return tuple(
        EngagementSpec(name=f"sun_{p}", gears=("sun", p), torque_max=torque, speed_max=relative / z_s, **common)
        for p in planets
    ) + tuple(
        EngagementSpec(
            name=f"ring_{p}", gears=(p, "ring"), torque_max=torque * z_p / z_s, speed_max=relative / z_p, **common
        )
        for p in planets
    )


def _set_supports(spec: PlanetarySpec, planets: list[str]) -> tuple[SupportSpec, ...]:
    sun, pin, carrier, mounts = spec.sun.bearing, spec.planet.bearing, spec.carrier.bearing, spec.ring.mounts
    assert sun and pin and carrier and mounts
    all_mounts, radius = mounts.points * mounts.stiffness, spec.ring.rim_diameter / 2
    return (
        _held("sun", sun),
        *(_held(name, pin, to="carrier", node=f"bolt{k}") for k, name in enumerate(planets)),
        _held("carrier", carrier, node="bore"),
        SupportSpec(
            name="ring",
            body="ring",
            radial=all_mounts,
            axial=all_mounts,
            tilt=all_mounts * radius**2 / 2,
            torsion=None if "ring" in spec.ports else all_mounts * radius**2,
            damping_ratio=mounts.damping_ratio,
        ),
    )


def _held(body: str, bearing: Bearing | RollingMount, **where: Any) -> SupportSpec:
    if isinstance(bearing, RollingMount):
        return SupportSpec(
            name=body, body=body, bearing=bearing.rolling, span=bearing.span, carries=bearing.carries,
            damping_ratio=bearing.damping_ratio,
        )  # fmt: skip
    return SupportSpec(
        name=body, body=body, radial=bearing.stiffness, axial=bearing.axial, tilt=bearing.tilt,
        damping_ratio=bearing.damping_ratio, **where,
    )  # fmt: skip
