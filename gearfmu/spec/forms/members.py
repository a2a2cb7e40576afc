"""The reduced bodies of a stage, whichever way its file is written: toothed ones with their own module and angles, and
the carrier of a planetary set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

from gearfmu.geometry.carrier import CarrierGeometry
from gearfmu.geometry.planetary import HANDS
from gearfmu.spec.forms.general import GearBody, RingBody, Stage, ToothedBody
from gearfmu.spec.forms.pair import StageSpec
from gearfmu.spec.forms.planetary import CarrierSpec, MountsSpec, PlanetarySpec, RingSpec, SetGearSpec, SetSpec
from gearfmu.spec.forms.shapes import GearShape, carrier_geometry, gear_shape
from gearfmu.spec.tables.gear import GearSpec, PairSpec

CARRIER = "carrier"
Form: TypeAlias = StageSpec | Stage | PlanetarySpec  # what a stage file is read as


@dataclass(frozen=True)
class Member:
    """A toothed body of a stage.

    place : its table in the stage file, "gears.pinion", "sun", "bodies.wheel1". gear : with its own module and angles,
    the helix angle positive for a right-handed gear. mounts : of the ring of a planetary set.
    """

    place: str
    gear: ToothedBody
    mounts: MountsSpec | None = None

    @property
    def name(self) -> str:
        """Name of the body."""
        return self.gear.name

    @property
    def geometry(self) -> GearShape:
        """Its geometry in its own frame."""
        return gear_shape(self.gear)


@dataclass(frozen=True)
class CarrierMember:
    """The carrier of a planetary set, with the places of its bolts."""

    part: CarrierSpec
    geometry: CarrierGeometry


def members(spec: Form) -> dict[str, Member]:
    """Toothed bodies by name, in the order of the file; of a set sun, planet and ring."""
    if isinstance(spec, PlanetarySpec):
        sun, planet = (Member(gear.name, set_gear(gear, spec.set)) for gear in (spec.sun, spec.planet))
        found = [sun, planet, Member("ring", set_ring(spec.ring, spec.set), spec.ring.mounts)]
    elif isinstance(spec, StageSpec):
        hands = zip(spec.gears, (1, -1), strict=True)
        found = [Member(f"gears.{gear.name}", pair_gear(gear, spec.pair, hand)) for gear, hand in hands]
    else:
        found = [Member(f"bodies.{gear.name}", gear) for gear in spec.gears]
    return {member.name: member for member in found}


def member_of(spec: Form, name: str) -> Member:
    """The toothed body `name`. KeyError for a name that is none."""
    return members(spec)[name]


def carriers(spec: Form) -> dict[str, CarrierMember]:
    """Carriers by name: one of a planetary set, else none."""
    return {CARRIER: CarrierMember(spec.carrier, carrier_geometry(spec))} if isinstance(spec, PlanetarySpec) else {}


def carrier_of(spec: Form) -> CarrierMember:
    """The carrier of a planetary set. KeyError for a stage without one."""
    return carriers(spec)[CARRIER]


def body_names(spec: Form) -> tuple[str, ...]:
    """Names of the reduced bodies: toothed ones, then carriers. Shafts need no reduction."""
    own = [carrier.name for carrier in spec.carriers] if isinstance(spec, Stage) else list(carriers(spec))
    return *members(spec), *own


def pair_gear(gear: GearSpec, pair: PairSpec, hand: int) -> GearBody:
    """A gear of a pair in the terms of any stage; hand : sign of its helix angle over that of the pair."""
    return GearBody(**_fields(gear) | {"bearing": None}, **_angles(pair, hand))


def set_gear(gear: SetGearSpec, of: SetSpec, **changes: Any) -> GearBody:
    """Sun or planet in the terms of any stage."""
    return GearBody(**_fields(gear) | {"bearing": None} | changes, **_angles(of, HANDS[gear.name]))


def set_ring(ring: RingSpec, of: SetSpec) -> RingBody:
    """The ring of a set in the terms of any stage, where supports stand for its mounts."""
    return RingBody(**_fields(ring) | {"mounts": None}, kind="ring", **_angles(of, HANDS["ring"]))


def _fields(spec: GearSpec | SetGearSpec | RingSpec) -> dict[str, Any]:
    return {name: getattr(spec, name) for name in type(spec).model_fields}


def _angles(of: PairSpec | SetSpec, hand: int) -> dict[str, Any]:
    """Module and angles of a gear of a pair or set."""
    return {
        "normal_module": of.normal_module,
        "pressure_angle": of.pressure_angle,
        "helix_angle": hand * of.helix_angle + 0.0,
    }
