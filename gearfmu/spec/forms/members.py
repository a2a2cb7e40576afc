"""The bodies of a stage that are reduced, one for every file: toothed ones, and the carrier of a planetary set."""

from __future__ import annotations

from dataclasses import dataclass

from gearfmu.geometry.carrier import CarrierGeometry
from gearfmu.spec.forms.general import RingBody, Stage, ToothedBody
from gearfmu.spec.forms.planetary import CarrierSpec, MountsSpec, PlanetarySpec
from gearfmu.spec.forms.shapes import GearShape, carrier_geometry, gear_shape


@dataclass(frozen=True)
class Member:
    """A toothed body.

    place : its table in the stage file, "gears.pinion", "sun", "bodies.wheel1". gear : under the name of its file.
    mounts : of the ring of a planetary set.
    """

    place: str
    gear: ToothedBody
    mounts: MountsSpec | None = None

    @property
    def name(self) -> str:
        """Name of the reduced body."""
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


def members(stage: Stage) -> dict[str, Member]:
    """Toothed bodies by the names of their files, in the order of the stage; of a set sun, planet and ring."""
    form = stage.written
    mounts = form.ring.mounts if isinstance(form, PlanetarySpec) else None
    first = {stage.file_of(gear.name): gear for gear in reversed(stage.gears)}
    return {
        name: Member(
            stage.table_of(gear.name),
            gear.model_copy(update={"name": name}),
            mounts if isinstance(gear, RingBody) else None,
        )
        for name, gear in reversed(first.items())
    }


def member_of(stage: Stage, name: str) -> Member:
    """The toothed body whose file is `name`. KeyError for a name that is none."""
    return members(stage)[name]


def carrier_of(stage: Stage) -> CarrierMember:
    """The carrier of a planetary set. KeyError for a stage that is none."""
    form = stage.written
    if not isinstance(form, PlanetarySpec):
        raise KeyError("carrier")
    return CarrierMember(form.carrier, carrier_geometry(form))
