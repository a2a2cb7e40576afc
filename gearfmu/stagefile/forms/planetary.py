"""What a stage file says about a planetary set as a whole, and its carrier (ISO 21771 terms; SI floats)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import field_validator

from gearfmu.geometry.mesh import set_ratio
from gearfmu.stagefile.reading.base import Count, LaterFields, Name, Quantity, Spec, Text, Whole, entry, named_tables
from gearfmu.stagefile.tables.bodies import (
    Backlash,
    CenterDistance,
    Counts,
    Eccentricity,
    Elements,
    ElementsTwo,
    FaceWidth,
    HelixAngle,
    Material,
    ModalDamping,
    Module,
    PressureAngle,
    RingSpec,
    SetGearSpec,
)
from gearfmu.stagefile.tables.connections import (
    Bearing,
    ContactSpec,
    Diameter,
    Length,
    LevelSpec,
    Limits,
    PortSpec,
    SupportSpec,
)
from gearfmu.stagefile.tables.housing import HousingBody, Method
from gearfmu.stagefile.tables.imported import ELSEWHERE, CarrierImportSpec

PinError = Annotated[float, Quantity("pin_error")]
Pin = Annotated[int, Whole("pin")]


class SetSpec(Spec):
    """The set as a whole; sun–planet and planet–ring share centre distance, module and pressure angle."""

    planets: Annotated[Count, Whole("planets")] = entry("number of planets; equally spaced where `positions` is absent")
    positions: tuple[Annotated[int, Whole("position")], ...] | None = entry(
        "places of the planets in steps of 360 deg/(z_sun + z_ring), the only ones at which their teeth "
        "fit: ascending, the first 0",
        None,
    )
    center_distance: CenterDistance = entry("distance of planet and sun axes, the radius of the bolt circle")
    normal_module: Module = entry("normal module m_n")
    pressure_angle: PressureAngle = entry("normal pressure angle")
    helix_angle: HelixAngle = entry(
        "helix angle beta at the reference circle, -35 deg to 35 deg; positive: the sun is right-handed, "
        "planets and ring are left-handed",
        0.0,
    )
    backlash: Backlash = entry("circumferential backlash j_wt of either mesh on its working pitch circle")
    load_sharing: Annotated[float, Quantity("load_sharing")] = entry(
        "mesh load factor K_gamma: most loaded planet over the mean (ISO 6336-1)", 1.35
    )
    pin_errors: dict[Pin, tuple[PinError, PinError]] = entry(
        "deviation of single pins from their places: number of the bolt (planet1 is on bolt 0) → radial, tangential", {}
    )
    planet_eccentricity: dict[Pin, Eccentricity] = entry(
        "eccentric toothings of single planets: number of the bolt → amount, angle; before that of all", {}
    )


class CarrierMeshSpec(Counts):
    """Element counts of one bolt's sector (20-node hexahedra; half of it, mirrored)."""

    around: ElementsTwo = entry("elements around the bolt towards bore and rim, each half side", 4)
    sides: ElementsTwo = entry("elements around the bolt towards the next bolt", 4)
    bolt: Elements = entry("elements from the bolt's core outwards", 4)
    disc: Elements = entry("elements from the bolt to the edges", 8)
    plate: Elements = entry("elements through the plate", 6)
    neck: Elements = entry("elements in the gap between plate and seat", 4)
    length: Elements = entry("elements along the planet's seat", 4)
    scale: Annotated[float, Quantity("scale")] = entry("factor on all counts", 1.0)


class CarrierSpec(Spec):
    """A plate with a bore, beside the planets, and a bolt for each of them, made of one piece."""

    bore_diameter: Diameter = entry("diameter of the bore")
    outer_diameter: Diameter = entry("outer diameter of the plate")
    thickness: Length = entry("thickness of the plate")
    gap: Length = entry("clearance between the plate and the planets' faces")
    bolt_diameter: Diameter = entry("diameter of the bolts; their seats are as long as the planets are wide")
    coupling: dict[Name, Literal["rigid", "averaging"]] = entry(
        'how "bore", "bolt0", "bolt1" … are held: rigid (RBE2) or averaging (RBE3)', {}
    )
    material: Material = entry("material")
    modal_damping: ModalDamping = entry("damping ratio of the elastic modes", 0.01)
    method: Method = entry("method of reduction; every one ends in oscillators", "krylov")
    modes: Annotated[Count, Whole("carrier_modes")] = entry("number of oscillators stored", 120)
    mesh: CarrierMeshSpec = entry("element counts", default_factory=CarrierMeshSpec)
    bearing: Bearing | None = entry("between its bore and the ground; for motion", None)
    imported: CarrierImportSpec | None = entry(ELSEWHERE, None, alias="import")

    def coupling_of(self, interface: str) -> str:
        """Kind of coupling of "bore", "bolt0" …; rigid where the file says nothing."""
        return self.coupling.get(interface, "rigid")


class CarrierBody(CarrierSpec):
    """A planet carrier. Its nodes are "bore" and "bolt0", "bolt1" …; builders write it, from a file of kind
    planetary_set, with the places of its bolts."""

    name: Name = entry("name of the carrier")
    kind: Literal["carrier"] = entry("kind of body")
    circle: CenterDistance = entry("radius of the bolt circle", 0.0)
    seat_length: FaceWidth = entry("length of the planets' seats", 0.0)
    bolts: tuple[Annotated[float, Quantity("bolt_place")], ...] = entry("places of the bolts, in turns from +x", ())


class PlanetarySpec(LaterFields):
    """A planetary set as its file gives it; SI floats. `source` is that file."""

    later = ("bodies", "supports")

    name: Name = entry("name of the stage")
    description: Text = entry("one line about the stage", "")
    source: Path
    kind: Literal["planetary_set"] = entry("kind of stage")
    torque_max: Annotated[float, Quantity("torque_max")] = entry("largest carrier torque the model is made for")
    set: SetSpec = entry("the set")
    sun: SetGearSpec = entry("sun")
    planet: SetGearSpec = entry("one planet; all are equal")
    ring: RingSpec = entry("ring")
    carrier: CarrierSpec = entry("carrier")
    speed_max: Annotated[float, Quantity("speed_max")] | None = entry("largest speed of the carrier; for motion", None)
    contact: ContactSpec | None = entry("tooth contact; for motion", None)
    ports: dict[Name, PortSpec] = entry(
        "ports: carrier and sun, input first; a third, ring, holds the ring, which stands without it", {}
    )
    levels: LevelSpec = entry("cut frequencies", default_factory=LevelSpec)
    bodies: dict[Name, HousingBody] = entry("a housing on which the ring stands, by its name", {})
    supports: tuple[SupportSpec, ...] = entry("feet of the housing", ())

    @field_validator("bodies", mode="before")
    @classmethod
    def _named(cls, value: object) -> object:
        return named_tables(value)

    @property
    def limits(self) -> Limits:
        """Torque and speed of the carrier that the model is made for."""
        return (self.torque_max, "N*m"), (self.speed_max, "rad/s")

    @property
    def mesh_torque(self) -> float:
        """Torque (N·m) on the sun in its mesh with the most loaded planet at torque_max, K_γ T_s/N."""
        sun = self.torque_max / set_ratio(self.sun.teeth, self.ring.teeth)
        return self.set.load_sharing * sun / self.set.planets

    @property
    def gears(self) -> tuple[SetGearSpec, SetGearSpec, RingSpec]:
        """Sun, planet, ring."""
        return self.sun, self.planet, self.ring
