"""A pair file and a planetary set in the terms of any stage, and stages whose files say something else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.geometry.mesh import HANDS
from gearfmu.stagefile.forms.general import (
    OF_BOTH,
    EngagementSpec,
    Form,
    GearBody,
    Origin,
    PlacedPort,
    RingBody,
    RotorSpec,
    Stage,
)
from gearfmu.stagefile.forms.pair import StageSpec
from gearfmu.stagefile.forms.planetary import PlanetarySpec, SetSpec
from gearfmu.stagefile.forms.shapes import planet_angles, set_carrier, with_relief_rolls
from gearfmu.stagefile.reading.base import Spec
from gearfmu.stagefile.tables.bodies import GearSpec, PairSpec, RingSpec, SetGearSpec
from gearfmu.stagefile.tables.connections import Bearing, ContactSpec, PortSpec, RollingMount, SupportSpec

CARRIER = "carrier"


def expand(form: Form | Stage) -> Stage:
    """The stage that a file says, which keeps what is written there. ValueError where axes are too near for its
    meshes (`laid_out` makes such a stage too)."""
    stage = laid_out(form)
    if not isinstance(form, PlanetarySpec):
        return stage
    rolled = with_relief_rolls(stage)
    rolled._origin = stage._origin
    return rolled


def laid_out(form: Form | Stage) -> Stage:
    """The stage that a file says, whatever is wrong with it: reliefs begin where the file says, if in words."""
    if isinstance(form, PlanetarySpec):
        return _expanded_set(form)
    return form if isinstance(form, Stage) else _expanded_pair(form)


def rewritten(stage: Stage, **fields: Any) -> Stage:
    """The stage as if its file had other fields: those of `stage.written`."""
    return expand(stage.written.model_copy(update=fields))


def with_ports(stage: Stage, ports: Mapping[str, PortSpec]) -> Stage:
    """The stage with other ports of the same names, at the places where they were."""
    own = {
        name: old.model_copy(update=_fields(PortSpec, ports[name])) if name in ports else old
        for name, old in stage.written.ports.items()
    }
    return rewritten(stage, ports=own)


def with_bores(stage: Stage, coupling: str) -> Stage:
    """The stage with the bores of all its gears "averaging" or "rigid"; those of imported bodies too. Rims of rings and
    shafts stay as they are. SpecError for a planetary set, whose gears keep averaging bores."""
    form = stage.written
    if isinstance(form, PlanetarySpec):
        remedy = "the gears of a planetary set keep averaging bores: leave it away"
        raise SpecError.of(stage.source, "bore", coupling, remedy)
    if isinstance(form, Stage):
        gears = {gear.name: _coupled(gear, coupling) for gear in form.gears if not isinstance(gear, RingBody)}
        return rewritten(stage, bodies=form.bodies | gears)
    return rewritten(stage, gears=tuple(_coupled(gear, coupling) for gear in form.gears))


def _expanded_pair(spec: StageSpec) -> Stage:
    """A pair in the terms of any stage: two rotors of one gear each, on an isotropic bearing at mid-width; pinion at
    the origin, wheel on +x."""
    pair, axes = spec.pair, ((0.0, 0.0), (spec.pair.center_distance, 0.0))
    pinion, wheel = spec.gears
    stage = Stage(
        **_said_alike(spec),
        slices=spec.contact.slices,
        nodal=spec.contact.nodal,
        bodies={gear.name: gear for gear in pair_gears(pair, spec.gears)},
        rotors={g.name: RotorSpec(axis=axis, bodies={g.name: 0.0}) for g, axis in zip(spec.gears, axes, strict=True)},
        engagements=(
            EngagementSpec(
                name="mesh",
                gears=(pinion.name, wheel.name),
                backlash=pair.backlash,
                torque_max=spec.torque_max,
                speed_max=spec.speed_max,
                misalignment=pair.misalignment,
                **_contact(spec.contact),
            ),
        ),
        supports=tuple(_held(gear.name, gear.bearing) for gear in spec.gears),
        ports={g.name: _placed(spec.ports[g.name], body=g.name) for g in spec.gears},
    )
    places = {f"bodies.{gear.name}": f"gears.{gear.name}" for gear in spec.gears}
    places |= {f"supports.{gear.name}": f"gears.{gear.name}.bearing" for gear in spec.gears}
    places |= {f"supports.{gear.name}.bearing": f"gears.{gear.name}.bearing.rolling" for gear in spec.gears}
    places |= {f"rotors.{wheel.name}.axis": "pair.center_distance", "engagements.mesh.backlash": "pair.backlash"}
    stage._origin = Origin(spec, places)
    return stage


def _expanded_set(spec: PlanetarySpec) -> Stage:
    """A planetary set in the terms of any stage: carrier on the ground, sun, planets and ring in the axes of the
    carrier, in which they roll like gears on fixed axes; planets on the carrier's bolts. Sun and ring rest on isotropic
    springs, which are constant in any axes: of the ring, all its mounts together, smeared round its rim. With a port of
    its own the ring turns in them, held by the port. A housing stands in the axes of the ground: it holds the ring in
    the two directions that are the same in both, along and about its axis.

    What a set needs to move and does not say is 0 or left out, and refused by `Stage.require_motion`.
    """
    missing = tuple(motion_problems(spec))
    planets = [f"planet{k + 1}" for k in range(spec.set.planets)]
    bodies: dict[str, Any] = {"sun": _set_gear(spec.sun, spec.set)}
    for k, name in enumerate(planets):
        eccentricity = spec.set.planet_eccentricity.get(k, spec.planet.eccentricity)
        bodies[name] = _set_gear(spec.planet, spec.set, name=name, eccentricity=eccentricity)
    bodies["ring"] = RingBody(
        **_fields(RingSpec, spec.ring) | {"mounts": None}, kind="ring", **_angles(spec.set, HANDS["ring"])
    )
    bodies |= spec.bodies
    bodies[CARRIER] = set_carrier(spec)
    cut: dict[str, Any] = {} if spec.contact is None else {"slices": spec.contact.slices, "nodal": spec.contact.nodal}
    stage = Stage(
        **_said_alike(spec),
        bodies=bodies,
        rotors=_set_rotors(spec, planets),
        engagements=_set_meshes(spec, planets),
        supports=_set_supports(spec, planets),
        ports={
            name: _placed(port, body=name, node="bore" if name == "carrier" else None)
            for name, port in spec.ports.items()
        },
        **cut,
    )
    shared = dict.fromkeys(planets, "planet")
    places = {f"bodies.{name}": shared.get(name, name) for name in (*bodies, "planet") if name not in spec.bodies}
    own = [k for k in spec.set.planet_eccentricity if k < len(planets)]
    places |= {f"bodies.{planets[k]}.eccentricity": f"set.planet_eccentricity.{k}" for k in own}
    places |= {f"rotors.{name}.axis": "set.center_distance" for name in (*planets, "ring")}
    places |= {f"engagements.sun_{name}.backlash": "set.backlash" for name in planets}
    stage._origin = Origin(spec, places, shared, missing)
    return stage


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
    z_s, z_p, z_r = (gear.teeth for gear in spec.gears)
    common = _contact(spec.contact) | {"backlash": spec.set.backlash}
    torque, relative = spec.mesh_torque, (spec.speed_max or 0.0) * z_r  # teeth past a planet in the carrier's axes
    moves = spec.contact is not None and spec.speed_max is not None
    made = EngagementSpec if moves else partial(EngagementSpec.model_construct, misalignment=None)
    return tuple(
        made(name=f"sun_{p}", gears=("sun", p), torque_max=torque, speed_max=relative / z_s, **common) for p in planets
    ) + tuple(
        made(name=f"ring_{p}", gears=(p, "ring"), torque_max=torque * z_p / z_s, speed_max=relative / z_p, **common)
        for p in planets
    )


def _set_supports(spec: PlanetarySpec, planets: list[str]) -> tuple[SupportSpec, ...]:
    sun, pin, carrier, mounts = spec.sun.bearing, spec.planet.bearing, spec.carrier.bearing, spec.ring.mounts
    if not (sun and pin and carrier and mounts):
        return ()
    all_mounts, radius = mounts.points * mounts.stiffness, spec.ring.rim_diameter / 2
    torsion = None if "ring" in spec.ports else all_mounts * radius**2
    ring = SupportSpec(
        name="ring",
        body="ring",
        radial=all_mounts,
        axial=all_mounts,
        tilt=all_mounts * radius**2 / 2,
        torsion=torsion,
        damping_ratio=mounts.damping_ratio,
    )
    along = {"name": "ring_seat", "to": mounts.to, "node": mounts.node, "radial": None, "tilt": None}
    held = [ring]
    if mounts.to is not None:
        held = [ring.model_copy(update={"axial": None, "torsion": None}), ring.model_copy(update=along)]
    return (
        _held("sun", sun),
        *(_held(name, pin, to="carrier", node=f"bolt{k}") for k, name in enumerate(planets)),
        _held("carrier", carrier, node="bore"),
        *held,
        *spec.supports,
    )


def _held(body: str, bearing: Bearing | RollingMount, **where: Any) -> SupportSpec:
    if isinstance(bearing, RollingMount):
        held: dict[str, Any] = {"bearing": bearing.rolling, "span": bearing.span, "carries": bearing.carries}
    else:
        held = {"radial": bearing.stiffness, "axial": bearing.axial, "tilt": bearing.tilt}
    return SupportSpec(name=body, body=body, damping_ratio=bearing.damping_ratio, **held, **where)


def _coupled(gear: Any, coupling: str) -> Any:
    if gear.imported is None:
        return gear.model_copy(update={"bore_coupling": coupling})
    return gear.model_copy(update={"imported": gear.imported.model_copy(update={"bore_coupling": coupling})})


def pair_gears(pair: PairSpec, gears: Sequence[GearSpec]) -> list[GearBody]:
    """The gears of a pair in the terms of any stage: helix angles of opposite hands."""
    hands = zip(gears, (1, -1), strict=True)
    return [GearBody(**_fields(GearSpec, gear) | {"bearing": None}, **_angles(pair, hand)) for gear, hand in hands]


def _set_gear(gear: SetGearSpec, of: SetSpec, **changes: Any) -> GearBody:
    """Sun or planet in the terms of any stage."""
    return GearBody(**_fields(SetGearSpec, gear) | {"bearing": None} | changes, **_angles(of, HANDS[gear.name]))


def _said_alike(spec: StageSpec | PlanetarySpec) -> dict[str, Any]:
    return {name: value for name, value in spec if name in OF_BOTH}


def _contact(contact: ContactSpec | None) -> dict[str, Any]:
    """What a mesh has of the tooth contact of a file; nothing where a set says nothing of it."""
    return {name: None if contact is None else dict(contact)[name] for name in ("damping", "friction", "film")}


def _placed(port: PortSpec, **where: Any) -> PlacedPort:
    return PlacedPort(**_fields(PortSpec, port), **where)


def _fields(kind: type[Spec], spec: Spec) -> dict[str, Any]:
    return {name: getattr(spec, name) for name in kind.model_fields}


def _angles(of: PairSpec | SetSpec, hand: int) -> dict[str, Any]:
    """Module and angles of a gear of a pair or set."""
    return {
        "normal_module": of.normal_module,
        "pressure_angle": of.pressure_angle,
        "helix_angle": hand * of.helix_angle + 0.0,
    }
