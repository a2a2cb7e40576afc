"""What a stage file says about a planetary set: sun, planets, ring, carrier (ISO 21771 terms; SI floats)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Field, field_validator

from gearfmu.geometry.mesh import set_ratio
from gearfmu.stagefile.reading.base import Count, Name, Quantity, Spec, Text, Whole, named_tables
from gearfmu.stagefile.tables.bodies import (
    Backlash,
    BodySpec,
    Eccentricity,
    FaceWidth,
    Factor,
    HelixAngle,
    Material,
    ModalDamping,
    Module,
    PressureAngle,
    ProfileShift,
    RackSpec,
    Teeth,
    TipDiameter,
    TipEdge,
    Toothing,
)
from gearfmu.stagefile.tables.connections import (
    Bearing,
    ContactSpec,
    Diameter,
    LaterFields,
    Length,
    LevelSpec,
    Limits,
    PortSpec,
    Ratio,
    SupportSpec,
)
from gearfmu.stagefile.tables.housing import HousingBody
from gearfmu.stagefile.tables.imported import CarrierImportSpec, ImportSpec, RingImportSpec

PinError = Annotated[float, Quantity("pin_error")]
Pin = Annotated[int, Whole("pin")]
Elements = Annotated[Count, Whole("elements")]
ElementsTwo = Annotated[Count, Whole("elements_two")]
CouplingKind = Literal["rigid", "averaging"]


class SetSpec(Spec):
    """The set as a whole; sun–planet and planet–ring share centre distance, module and pressure angle."""

    planets: Annotated[Count, Whole("planets")] = Field(
        description="number of planets; equally spaced where `positions` is absent"
    )
    positions: tuple[Annotated[int, Whole("position")], ...] | None = Field(
        default=None,
        description="places of the planets in steps of 360 deg/(z_sun + z_ring), the only ones at which their teeth "
        "fit: ascending, the first 0",
    )
    center_distance: Annotated[float, Quantity("center_distance")] = Field(
        description="distance of planet and sun axes, the radius of the bolt circle"
    )
    normal_module: Module = Field(description="normal module m_n")
    pressure_angle: PressureAngle = Field(description="normal pressure angle")
    helix_angle: HelixAngle = Field(
        default=0.0,
        description="helix angle beta at the reference circle, -35 deg to 35 deg; positive: the sun is right-handed, "
        "planets and ring are left-handed",
    )
    backlash: Backlash = Field(description="circumferential backlash j_wt of either mesh on its working pitch circle")
    load_sharing: Annotated[float, Quantity("load_sharing")] = Field(
        default=1.35, description="mesh load factor K_gamma: most loaded planet over the mean (ISO 6336-1)"
    )
    pin_errors: dict[Pin, tuple[PinError, PinError]] = Field(
        default={},
        description="deviation of single pins from their places: number of the bolt (planet1 is on bolt 0) → radial, "
        "tangential",
    )
    planet_eccentricity: dict[Pin, Eccentricity] = Field(
        default={},
        description="eccentric toothings of single planets: number of the bolt → amount, angle; before that of all",
    )


class SetGearSpec(Toothing):
    """Sun or planet: an external gear."""

    model_config = ConfigDict(populate_by_name=True)  # `import` is no name in Python

    name: Name
    teeth: Teeth = Field(description="number of teeth z")
    profile_shift: ProfileShift = Field(default=0.0, description="profile shift coefficient x")
    tip_diameter: TipDiameter = Field(description="tip diameter d_a")
    face_width: FaceWidth = Field(description="face width b")
    bore_diameter: Diameter = Field(description="diameter of the bore")
    tip_edge_radius: TipEdge = Field(default=2e-4, description="radius of the tip edge rounding")
    rack: RackSpec = Field(default_factory=RackSpec, description="basic rack")
    material: Material = Field(description="material")
    modal_damping: ModalDamping = Field(default=0.01, description="damping ratio of the elastic modes")
    body: BodySpec = Field(description="mesh and reduction")
    bearing: Bearing | None = Field(
        default=None,
        description="of the sun: on the ground, however soft where it floats; of a planet: its pin; for motion",
    )
    imported: ImportSpec | None = Field(
        default=None, alias="import", description="finite elements made elsewhere; meshed here when the table is absent"
    )


class MountsSpec(LaterFields):
    """Elastic mounting of the ring: springs between equal patches of its rim and the ground, or a housing."""

    later = ("to", "node")

    points: Annotated[Count, Whole("mounts")] = Field(
        description="number of mounts, equally spaced from tooth space 0; one by one they hold the nearest tooth spaces"
    )
    stiffness: Annotated[float, Quantity("mount_stiffness")] = Field(
        description="stiffness of one mount, the same in all three directions"
    )
    damping_ratio: Ratio = Field(default=0.03, description="damping ratio D: c = 2 D sqrt(k m), of all mounts together")
    to: Name | None = Field(
        default=None, description="housing that holds the ring along and about its axis; the ground when absent"
    )
    node: Name | None = Field(default=None, description="seat of that housing")


class RingSpec(Toothing):
    """The internal gear. Its profile shift is positive outwards, as for the external gear that fills its spaces."""

    model_config = ConfigDict(populate_by_name=True)

    name: Name = "ring"
    teeth: Annotated[Count, Whole("ring_teeth")] = Field(description="number of teeth z")
    profile_shift: ProfileShift = Field(default=0.0, description="profile shift coefficient x, positive outwards")
    tip_diameter: TipDiameter = Field(description="tip diameter, the smallest of the ring")
    rim_diameter: Diameter = Field(description="outer diameter of the rim")
    face_width: FaceWidth = Field(description="face width b")
    tip_edge_radius: TipEdge = Field(default=2e-4, description="radius of the tip edge rounding")
    dedendum: Factor = Field(default=1.25, description="root depth below the reference circle, factor of m")
    fillet_radius: Factor = Field(
        default=0.3, description="root fillet, an arc tangent to flank and root circle, factor of m"
    )
    material: Material = Field(description="material")
    modal_damping: ModalDamping = Field(default=0.01, description="damping ratio of the elastic modes")
    mounts: MountsSpec | None = Field(default=None, description="elastic mounts; none when the table is absent")
    body: BodySpec = Field(description="mesh and reduction")
    imported: RingImportSpec | None = Field(
        default=None, alias="import", description="finite elements made elsewhere; meshed here when the table is absent"
    )


class CarrierMeshSpec(Spec):
    """Element counts of one bolt's sector (20-node hexahedra; half of it, mirrored)."""

    around: ElementsTwo = Field(default=4, description="elements around the bolt towards bore and rim, each half side")
    sides: ElementsTwo = Field(default=4, description="elements around the bolt towards the next bolt")
    bolt: Elements = Field(default=4, description="elements from the bolt's core outwards")
    disc: Elements = Field(default=8, description="elements from the bolt to the edges")
    plate: Elements = Field(default=6, description="elements through the plate")
    neck: Elements = Field(default=4, description="elements in the gap between plate and seat")
    length: Elements = Field(default=4, description="elements along the planet's seat")
    scale: Annotated[float, Quantity("scale")] = Field(default=1.0, description="factor on all counts")

    def scaled(self, count: int, least: int = 1) -> int:
        """`count` times the scale, rounded."""
        return max(least, round(self.scale * count))

    def growth(self, factor: float) -> float:
        """Growth of neighbouring elements, so that a scaled mesh is graded over the same length."""
        return factor ** (1 / self.scale)


class CarrierSpec(Spec):
    """A plate with a bore, beside the planets, and a bolt for each of them, made of one piece."""

    model_config = ConfigDict(populate_by_name=True)

    bore_diameter: Diameter = Field(description="diameter of the bore")
    outer_diameter: Diameter = Field(description="outer diameter of the plate")
    thickness: Length = Field(description="thickness of the plate")
    gap: Length = Field(description="clearance between the plate and the planets' faces")
    bolt_diameter: Diameter = Field(
        description="diameter of the bolts; their seats are as long as the planets are wide"
    )
    coupling: dict[Name, CouplingKind] = Field(
        default={}, description='how "bore", "bolt0", "bolt1" … are held: rigid (RBE2) or averaging (RBE3)'
    )
    material: Material = Field(description="material")
    modal_damping: ModalDamping = Field(default=0.01, description="damping ratio of the elastic modes")
    method: Literal["krylov", "rubin", "craig_bampton", "modal"] = Field(
        default="krylov", description="method of reduction; every one ends in oscillators"
    )
    modes: Annotated[Count, Whole("carrier_modes")] = Field(default=120, description="number of oscillators stored")
    mesh: CarrierMeshSpec = Field(default_factory=CarrierMeshSpec, description="element counts")
    bearing: Bearing | None = Field(default=None, description="between its bore and the ground; for motion")
    imported: CarrierImportSpec | None = Field(
        default=None, alias="import", description="finite elements made elsewhere; meshed here when the table is absent"
    )

    def coupling_of(self, interface: str) -> str:
        """Kind of coupling of "bore", "bolt0" …; rigid where the file says nothing."""
        return self.coupling.get(interface, "rigid")


class CarrierBody(CarrierSpec):
    """A planet carrier. Its nodes are "bore" and "bolt0", "bolt1" …; builders write it, from a file of kind
    planetary_set, with the places of its bolts."""

    name: Name = Field(description="name of the carrier")
    kind: Literal["carrier"] = Field(description="kind of body")
    circle: Annotated[float, Quantity("center_distance")] = Field(default=0.0, description="radius of the bolt circle")
    seat_length: FaceWidth = Field(default=0.0, description="length of the planets' seats")
    bolts: tuple[Annotated[float, Quantity("bolt_place")], ...] = Field(
        default=(), description="places of the bolts, in turns from +x"
    )


class PlanetarySpec(LaterFields):
    """A planetary set as its file gives it; SI floats. `source` is that file."""

    later = ("bodies", "supports")

    name: Name = Field(description="name of the stage")
    description: Text = Field(default="", description="one line about the stage")
    source: Path
    kind: Literal["planetary_set"] = Field(description="kind of stage")
    torque_max: Annotated[float, Quantity("torque_max")] = Field(
        description="largest carrier torque the model is made for"
    )
    set: SetSpec = Field(description="the set")
    sun: SetGearSpec = Field(description="sun")
    planet: SetGearSpec = Field(description="one planet; all are equal")
    ring: RingSpec = Field(description="ring")
    carrier: CarrierSpec = Field(description="carrier")
    speed_max: Annotated[float, Quantity("speed_max")] | None = Field(
        default=None, description="largest speed of the carrier; for motion"
    )
    contact: ContactSpec | None = Field(default=None, description="tooth contact; for motion")
    ports: dict[Name, PortSpec] = Field(
        default={},
        description="ports: carrier and sun, input first; a third, ring, holds the ring, which stands without it",
    )
    levels: LevelSpec = Field(default_factory=LevelSpec, description="cut frequencies")
    bodies: dict[Name, HousingBody] = Field(default={}, description="a housing on which the ring stands, by its name")
    supports: tuple[SupportSpec, ...] = Field(default=(), description="feet of the housing")

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
