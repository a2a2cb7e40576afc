"""The geometry of what a stage file declares: toothed bodies, a carrier, pairs, a set, and the engagements of any
stage."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias, TypeVar

from gearfmu.geometry import GearGeometry, PairGeometry
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.geometry.mesh import (
    HANDS,
    CarrierGeometry,
    PlanetaryGeometry,
    RingMesh,
    common_width,
    contact_modulus,
    half_width,
)
from gearfmu.stagefile.forms.general import EngagementSpec, GearBody, RingBody, Stage, ToothedBody
from gearfmu.stagefile.forms.planetary import CarrierBody, CarrierSpec, PlanetarySpec, SetSpec
from gearfmu.stagefile.tables.bodies import GearSpec, PairSpec, RingSpec, SetGearSpec, Toothing

GearShape = GearGeometry | InternalGearGeometry
MeshShape = PairGeometry | RingMesh
Loaded: TypeAlias = GearSpec | SetGearSpec | RingSpec  # has a material and a face width
Tooth = TypeVar("Tooth", bound=Toothing)
Rack: TypeAlias = PairSpec | SetSpec | GearBody | RingBody  # has normal module, pressure angle and helix angle


def gear_geometry(gear: GearSpec | SetGearSpec, rack: Rack, hand: int = 0) -> GearGeometry:
    """An external gear. hand: sign of its helix angle over that of `rack`, needed where that is helical."""
    assert hand or not rack.helix_angle, "which gear of a helical pair is meant?"
    m = rack.normal_module
    return GearGeometry(
        z=gear.teeth, m=m, alpha=rack.pressure_angle, x=gear.profile_shift, r_a=gear.tip_diameter / 2,
        r_bore=gear.bore_diameter / 2, tip_edge=gear.tip_edge_radius,
        h_fp=gear.rack.dedendum * m, rho_fp=gear.rack.fillet_radius * m, beta=hand * rack.helix_angle + 0.0,
    )  # fmt: skip


def ring_geometry(ring: RingSpec, rack: Rack, hand: int = 0) -> InternalGearGeometry:
    """An internal gear. hand: as of `gear_geometry`."""
    assert hand or not rack.helix_angle, "of which hand is the ring?"
    m, beta = rack.normal_module, hand * rack.helix_angle + 0.0
    return InternalGearGeometry(
        z=ring.teeth, m=m, alpha=rack.pressure_angle, x=ring.profile_shift, r_a=ring.tip_diameter / 2,
        r_f=m * (ring.teeth / 2 / math.cos(beta) + ring.profile_shift + ring.dedendum), r_rim=ring.rim_diameter / 2,
        tip_edge=ring.tip_edge_radius, fillet=ring.fillet_radius * m, beta=beta,
    )  # fmt: skip


def gears_in_mesh(pair: PairSpec, gears: Sequence[GearSpec]) -> PairGeometry:
    """Pinion and wheel at their centre distance. ValueError where the axes are too near."""
    pinion, wheel = (gear_geometry(gear, pair, hand) for gear, hand in zip(gears, (1, -1), strict=True))
    return PairGeometry(gears=(pinion, wheel), a=pair.center_distance, backlash=pair.backlash)


def set_geometries(spec: PlanetarySpec) -> tuple[GearGeometry, GearGeometry, InternalGearGeometry]:
    """Sun, planet and ring of a set."""
    sun, planet = (gear_geometry(gear, spec.set, HANDS[gear.name]) for gear in (spec.sun, spec.planet))
    return sun, planet, ring_geometry(spec.ring, spec.set, HANDS["ring"])


def set_geometry(spec: PlanetarySpec) -> PlanetaryGeometry:
    """The two meshes of a set and the places of its planets. ValueError where axes are too near."""
    sun, planet, ring = set_geometries(spec)
    a, backlash = spec.set.center_distance, spec.set.backlash
    return PlanetaryGeometry(
        PairGeometry((sun, planet), a, backlash), RingMesh((planet, ring), a, backlash), planet_angles(spec)
    )


def planet_angles(spec: PlanetarySpec) -> tuple[float, ...]:
    """Angles (rad) of the planets with the carrier at 0, the first 0: as `positions` say, or 2πk/N."""
    if spec.set.positions is None:
        return tuple(2 * math.pi * k / spec.set.planets for k in range(spec.set.planets))
    return tuple(2 * math.pi * place / (spec.sun.teeth + spec.ring.teeth) for place in spec.set.positions)


def set_carrier(spec: PlanetarySpec) -> CarrierBody:
    """The carrier of a set with the places of its bolts, as fractions of a turn: equal on every machine, as cosines are
    not."""
    steps, count = spec.set.positions, spec.sun.teeth + spec.ring.teeth
    if steps is None:
        steps, count = tuple(range(spec.set.planets)), spec.set.planets
    own = {name: getattr(spec.carrier, name) for name in CarrierSpec.model_fields}
    bolts, circle, seat = tuple(step / count for step in steps), spec.set.center_distance, spec.planet.face_width
    return CarrierBody(**own, circle=circle, seat_length=seat, bolts=bolts, name="carrier", kind="carrier")


def carrier_geometry(carrier: CarrierBody) -> CarrierGeometry:
    """The geometry of a carrier."""
    return CarrierGeometry(
        angles=tuple(2 * math.pi * bolt for bolt in carrier.bolts), a=carrier.circle, r_bore=carrier.bore_diameter / 2,
        r_o=carrier.outer_diameter / 2, r_bolt=carrier.bolt_diameter / 2, thickness=carrier.thickness,
        gap=carrier.gap, seat=carrier.seat_length,
    )  # fmt: skip


def gear_shape(gear: ToothedBody) -> GearShape:
    """The geometry of a toothed body in its own frame."""
    return ring_geometry(gear, gear, 1) if isinstance(gear, RingBody) else gear_geometry(gear, gear, 1)


def mesh_shape(stage: Stage, mesh: EngagementSpec) -> MeshShape:
    """The engagement by itself; its `gears` are A and B. ValueError where the axes are too near."""
    a, b = (gear_shape(toothed(stage, name)) for name in mesh.gears)
    distance = centre_distance(stage, mesh)
    assert isinstance(a, GearGeometry), "gear A is external"
    if isinstance(b, InternalGearGeometry):
        return RingMesh((a, b), distance, mesh.backlash)
    return PairGeometry((a, b), distance, mesh.backlash)


def largest_half_width(gears: Sequence[Loaded], mesh: MeshShape, torque: float) -> float:
    """Largest Hertz half-width b (m) along the path of contact.

    One tooth pair carries the whole torque (N·m) on gear A over the common face width. Of helical flanks the normal
    force and the length of its line of contact both grow by 1/cos β_b, the radius of curvature normal to it too.
    """
    first, (a, b) = mesh.gears[0], (gear.material for gear in gears)
    e_star = contact_modulus((a.youngs_modulus, b.youngs_modulus), (a.poisson_ratio, b.poisson_ratio))
    load = torque / first.r_b / common_width(gears)
    return half_width(load, mesh.largest_relative_radius() / math.cos(first.beta_b), e_star)


def with_rolls(gear: Tooth, mesh: MeshShape, index: int) -> Tooth:
    """The same gear with points of single contact turned into rolls. mesh: in which it is gear `index`."""
    points = {"tip_relief": mesh.outer_single_contact, "root_relief": mesh.inner_single_contact}
    found: dict[str, Any] = {}
    for field, relief in (("tip_relief", gear.tip_relief), ("root_relief", gear.root_relief)):
        if relief is not None and isinstance(relief.start_roll, str):
            found[field] = relief.model_copy(update={"start_roll": points[field](index)})
    return gear.model_copy(update=found) if found else gear


def with_relief_rolls(stage: Stage) -> Stage:
    """The same stage with points of single contact turned into rolls, those of a gear's first engagement."""
    bodies = dict(stage.bodies)
    for mesh in reversed(stage.engagements):
        for index, name in enumerate(mesh.gears):
            bodies[name] = with_rolls(toothed(stage, name), mesh_shape(stage, mesh), index)
    return stage.model_copy(update={"bodies": bodies})


def toothed(stage: Stage, name: str) -> ToothedBody:
    """The toothed body of that name."""
    body = stage.bodies[name]
    assert isinstance(body, ToothedBody)
    return body


def face_width(stage: Stage, mesh: EngagementSpec) -> float:
    """Common face width (m) of an engagement."""
    return common_width(toothed(stage, name) for name in mesh.gears)


def centre_distance(stage: Stage, mesh: EngagementSpec) -> float:
    """Distance (m) of the axes of an engagement."""
    (x, y), (u, v) = (stage.rotors[stage.rotor_of(gear)].axis for gear in mesh.gears)
    return math.hypot(u - x, v - y)
