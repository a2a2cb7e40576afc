"""Gears, rings and shafts of a stage file, and the pair as a whole (ISO 21771 and REXS terms; SI floats).

Teeth need not be nominal: flanks may be modified, deviations measured or drawn, and the toothing may not run true. All
of that belongs to the stage and shapes no body: the finite elements have nominal flanks on nominal axes. Amounts are
lengths in the transverse section normal to the involute. A *relief* and a *crowning* take material away and are
positive; a *deviation* is positive where there is more material than nominal (ISO 1328-1:2013, ISO 21771:2007)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, field_validator, model_validator

from gearfmu.stagefile.reading.base import Count, LaterFields, Name, Quantity, Spec, Switch, Text, Whole, entry, refuse
from gearfmu.stagefile.tables.connections import Bearing, Diameter, GearBearing, Length, Misalignment, Ratio
from gearfmu.stagefile.tables.imported import ELSEWHERE, ImportSpec, RingImportSpec, SurfaceCoupling

Depth = Annotated[float, Quantity("flank_depth")]
Slope = Annotated[float, Quantity("flank_slope")]
# "quadratic" is what files of before 0.2 call a parabola
ReliefKind = Annotated[
    Literal["linear", "parabolic", "arc"], BeforeValidator(lambda kind: "parabolic" if kind == "quadratic" else kind)
]


class EndRelief(Spec):
    """Material taken off towards both ends of the face width."""

    amount: Depth = entry("end relief at either end of the face width, normal to the involute")
    length: Length = entry("length from either end over which it fades to nothing")
    kind: ReliefKind = entry("shape over that length", "parabolic")


class LeadSpec(Spec):
    """Flank modifications across the face width, on both flanks of every tooth (ISO 21771)."""

    slope: Slope = entry(
        "helix slope f_Hbeta over the whole face width, normal to the involute; positive: both flanks are "
        "turned like a right-hand helix (of a left-handed gear ISO 1328-1 counts it the other way)",
        0.0,
    )
    crowning: Depth = entry("lead crowning C_beta: depth at both ends of the face width, none at its middle", 0.0)
    end_relief: EndRelief | None = entry("end relief; none when the table is absent", None)


Angle = Annotated[float, Quantity("angle")]
Tilt = Annotated[float, Quantity("wobble")]
Relief = Annotated[float, Quantity("relief")]
Pitch = Annotated[float, Quantity("pitch_deviation")]
# the loader puts a roll in the place of these words
OuterRoll = Annotated[float, Quantity("roll", words=("outer_single_contact",))]
InnerRoll = Annotated[float, Quantity("roll", words=("inner_single_contact",))]
Part = Literal["pitch", "profile", "helix"]


class TipRelief(Spec):
    """Tip relief on both flanks of every tooth."""

    amount: Relief = entry("relief normal to the involute at the tip diameter")
    start_roll: OuterRoll = entry('roll length of its beginning, or "outer_single_contact"', "outer_single_contact")
    kind: ReliefKind = entry("shape over the roll length", "parabolic")


class RootRelief(Spec):
    """Root relief on both flanks of every tooth."""

    amount: Relief = entry("relief normal to the involute where the flank ends at its root (form diameter)")
    start_roll: InnerRoll = entry('roll length of its beginning, or "inner_single_contact"', "inner_single_contact")
    kind: ReliefKind = entry("shape over the roll length", "parabolic")


class ProfileSpec(Spec):
    """Modifications along the profile of both flanks of every tooth, over the usable flank from its form diameter to
    its tip."""

    slope: Slope = entry(
        "profile slope f_Halpha over the usable flank, none at its middle roll; positive: more material "
        "towards the tip",
        0.0,
    )
    crowning: Depth = entry("profile crowning C_alpha: depth at both ends of the usable flank, none at its middle", 0.0)


class DeviationClass(Spec):
    """Deviations drawn at random within a tolerance class of ISO 1328-1:2013, the same for the same seed."""

    tolerance_class: Annotated[Count, Whole("tolerance_class")] = entry("flank tolerance class A", alias="class")
    seed: Annotated[Count, Whole("seed")] = entry("seed of the draw; gears of one seed differ by their names", 1)
    use: Annotated[float, Quantity("share")] = entry("share of the tolerances that the draw uses up", 1.0)
    parts: tuple[Part, ...] = entry(
        "drawn deviations: pitch, profile slopes, helix slopes", ("pitch", "profile", "helix")
    )
    per_tooth: Switch = entry("slopes differ from tooth to tooth; false: one for each flank", True)


class Eccentricity(Spec):
    """The toothing's axis beside the axis of rotation."""

    amount: Annotated[float, Quantity("eccentricity")] = entry(
        "distance of the toothing's axis from the axis of rotation at mid-width"
    )
    angle: Angle = entry("direction of the toothing's axis, from tooth 0 (of a ring: space 0) counter-clockwise", 0.0)


class Wobble(Spec):
    """The toothing's axis tilted against the axis of rotation."""

    amount: Tilt = entry("angle between the two axes; they cross at mid-width")
    angle: Angle = entry(
        "direction towards which the toothing's axis leans at its +z end, from tooth 0 (of a ring: space "
        "0) counter-clockwise",
        0.0,
    )


class Toothing(Spec):
    """What every toothed member may say about its teeth; also what is told of a gear that says nothing."""

    tip_relief: TipRelief | None = entry("tip relief; none when the table is absent", None)
    root_relief: RootRelief | None = entry("root relief; none when the table is absent", None)
    profile: ProfileSpec | None = entry("modifications along the profile; none when the table is absent", None)
    lead: LeadSpec | None = entry("modifications across the face width; none when the table is absent", None)
    topography: Text | None = entry(
        "measured or designed flanks: CSV file (docs/howto-flanks.md), path relative to the stage file", None
    )
    index_deviation: dict[Annotated[int, Whole("tooth_number")], Pitch] = entry(
        "pitch errors: individual index deviation F_pi (ISO 1328-1) by tooth number, or a list of all, arc "
        "on the reference circle, both flanks, positive counter-clockwise",
        {},
    )
    pitch_deviation: tuple[Pitch, ...] = entry(
        "single pitch deviations f_pi of all pitches, the first from the last tooth to tooth 0; they are "
        "summed to index deviations",
        (),
    )
    deviations: DeviationClass | None = entry(
        "deviations drawn within a tolerance class; none when the table is absent", None
    )
    eccentricity: Eccentricity | None = entry(
        "toothing beside the axis of rotation; on it when the table is absent", None
    )
    wobble: Wobble | None = entry("toothing tilted against the axis of rotation; not when the table is absent", None)

    @field_validator("index_deviation", mode="before")
    @classmethod
    def _by_tooth(cls, value: Any) -> Any:
        return dict(enumerate(value)) if isinstance(value, (list, tuple)) else value

    @property
    def uneven(self) -> bool:
        """Whether flanks differ across the face width by more than their helix."""
        drawn = self.deviations is not None and "helix" in self.deviations.parts
        return self.lead is not None or self.topography is not None or self.wobble is not None or drawn


TOOTHING = frozenset(Toothing.model_fields)

Factor = Annotated[float, Quantity("rack_factor")]
Elements = Annotated[Count, Whole("elements")]
ElementsTwo = Annotated[Count, Whole("elements_two")]
CenterDistance = Annotated[float, Quantity("center_distance")]
Module = Annotated[float, Quantity("module")]
TipDiameter = Annotated[float, Quantity("tip_diameter")]
FaceWidth = Annotated[float, Quantity("face_width")]
TipEdge = Annotated[float, Quantity("tip_edge_radius")]
Backlash = Annotated[float, Quantity("backlash")]
PressureAngle = Annotated[float, Quantity("pressure_angle")]
HelixAngle = Annotated[float, Quantity("helix_angle")]
ProfileShift = Annotated[float, Quantity("profile_shift")]
Teeth = Annotated[Count, Whole("teeth")]
ModalDamping = Annotated[float, Quantity("modal_damping")]


class PairSpec(Spec):
    """The pair as a whole. Module, pressure angle, profile shift and basic rack are those of the normal section."""

    center_distance: CenterDistance = entry("centre distance a")
    normal_module: Module = entry("normal module m_n")
    pressure_angle: PressureAngle = entry("normal pressure angle of the basic rack")
    helix_angle: HelixAngle = entry(
        "helix angle beta at the reference circle, -35 deg to 35 deg; positive: the pinion is right-handed "
        "and the wheel left-handed",
        0.0,
    )
    backlash: Backlash = entry("circumferential backlash j_wt of the assembled pair on the working pitch circle")
    misalignment: Misalignment | None = entry(
        "parallelism errors of the axes; parallel axes when the table is absent", None
    )


class RackSpec(Spec):
    """Basic rack of the tool, in factors of the module (ISO 53)."""

    addendum: Factor = entry("addendum of the basic rack, factor of m", 1.0)
    dedendum: Factor = entry("dedendum of the basic rack, factor of m", 1.25)
    fillet_radius: Factor = entry("root fillet radius of the basic rack, factor of m", 0.38)


class Material(Spec):
    """Linear elastic, isotropic."""

    youngs_modulus: Annotated[float, Quantity("youngs_modulus")] = entry("Young's modulus E")
    poisson_ratio: Annotated[float, Quantity("poisson_ratio")] = entry("Poisson's ratio")
    density: Annotated[float, Quantity("density")] = entry("density")


class Counts(Spec):
    """Element counts of a mesh, which a field `scale` multiplies."""

    if TYPE_CHECKING:
        scale: float

    def scaled(self, count: int, least: int = 1) -> int:
        """`count` times the scale, rounded."""
        return max(least, round(self.scale * count))

    def growth(self, grading: float) -> float:
        """Growth per element at this scale: scale 2 divides the elements of scale 1 within the same series."""
        return float(grading ** (1 / self.scale))


class MeshSpec(Counts):
    """Element counts of the sector mesh (20-node hexahedra; half a tooth) and how they are graded.

    The defaults are the counts on which the loaded transmission error of the shipped pair is converged to 1 %
    (docs/decisions/bodies.md).
    """

    flank: ElementsTwo = entry("elements along the flank, equal in arc length", 20)
    thickness: Elements = entry("elements across half the tooth", 5)
    root: ElementsTwo = entry("elements along root fillet and half the root land", 6)
    rim: Elements = entry(
        "elements from root to bore; more are taken where the rim is too high for the growth below", 4
    )
    width: Elements = entry("elements across the face width", 6)
    thickness_grading: Annotated[float, Quantity("grading")] = entry("growth of elements from the surface inwards", 1.6)
    rim_grading: Annotated[float, Quantity("rim_grading")] = entry(
        "largest growth of elements from the root to the bore", 1.5
    )
    scale: Annotated[float, Quantity("scale")] = entry("factor on all counts; the gradings keep their shape", 1.0)


class BodySpec(Spec):
    """How the gear's body is meshed and reduced; with geometry and material it decides the reduced body."""

    strip_half_width: Annotated[float, Quantity("strip_half_width")] = entry(
        "half-width, in arc length, of the load patch on the flank; at least 1.5 Hertz half-widths"
    )
    modes: Annotated[Count, Whole("modes")] = entry("number of elastic modes stored", 400)
    roll_points: Annotated[Count, Whole("roll_points")] = entry("Chebyshev points along the flank", 28)
    width_functions: Annotated[Count, Whole("width_functions")] = entry("Legendre functions across the face width", 5)
    mesh: MeshSpec = entry("element counts", default_factory=MeshSpec)


class GearSpec(Toothing):
    """One gear; `name` is also its shaft's name."""

    name: Name = entry("name of gear and shaft")
    teeth: Teeth = entry("number of teeth z")
    profile_shift: ProfileShift = entry("profile shift coefficient x")
    tip_diameter: TipDiameter = entry("tip diameter d_a")
    face_width: FaceWidth = entry("face width b")
    bore_diameter: Diameter = entry("diameter of the bore")
    bore_coupling: SurfaceCoupling = entry(
        "how the bore meets its node: averaging (RBE3, the bore may deform) or rigid (RBE2, a stiff shaft)", "averaging"
    )
    tip_edge_radius: TipEdge = entry("radius of the tip edge rounding", 2e-4)
    rack: RackSpec = entry("basic rack", default_factory=RackSpec)
    material: Material = entry("material")
    modal_damping: ModalDamping = entry("damping ratio of the elastic modes", 0.01)
    bearing: GearBearing = entry("bearing")
    body: BodySpec = entry("mesh and reduction")
    imported: ImportSpec | None = entry(ELSEWHERE, None, alias="import")

    @model_validator(mode="after")
    def _one_coupling(self) -> GearSpec:
        if self.imported is not None and self.rigid_bore:
            raise refuse('finite elements made elsewhere have their own: write bore_coupling = "rigid" under import')
        return self

    @property
    def rigid_bore(self) -> bool:
        """Whether the bore's surface moves as one rigid body."""
        return self.bore_coupling == "rigid"


class SetGearSpec(Toothing):
    """Sun or planet: an external gear."""

    name: Name
    teeth: Teeth = entry("number of teeth z")
    profile_shift: ProfileShift = entry("profile shift coefficient x", 0.0)
    tip_diameter: TipDiameter = entry("tip diameter d_a")
    face_width: FaceWidth = entry("face width b")
    bore_diameter: Diameter = entry("diameter of the bore")
    tip_edge_radius: TipEdge = entry("radius of the tip edge rounding", 2e-4)
    rack: RackSpec = entry("basic rack", default_factory=RackSpec)
    material: Material = entry("material")
    modal_damping: ModalDamping = entry("damping ratio of the elastic modes", 0.01)
    body: BodySpec = entry("mesh and reduction")
    bearing: Bearing | None = entry(
        "of the sun: on the ground, however soft where it floats; of a planet: its pin; for motion", None
    )
    imported: ImportSpec | None = entry(ELSEWHERE, None, alias="import")


class MountsSpec(LaterFields):
    """Elastic mounting of the ring: springs between equal patches of its rim and the ground, or a housing."""

    later = ("to", "node")

    points: Annotated[Count, Whole("mounts")] = entry(
        "number of mounts, equally spaced from tooth space 0; one by one they hold the nearest tooth spaces"
    )
    stiffness: Annotated[float, Quantity("mount_stiffness")] = entry(
        "stiffness of one mount, the same in all three directions"
    )
    damping_ratio: Ratio = entry("damping ratio D: c = 2 D sqrt(k m), of all mounts together", 0.03)
    to: Name | None = entry("housing that holds the ring along and about its axis; the ground when absent", None)
    node: Name | None = entry("seat of that housing", None)


class RingSpec(Toothing):
    """The internal gear. Its profile shift is positive outwards, as for the external gear that fills its spaces."""

    name: Name = "ring"
    teeth: Annotated[Count, Whole("ring_teeth")] = entry("number of teeth z")
    profile_shift: ProfileShift = entry("profile shift coefficient x, positive outwards", 0.0)
    tip_diameter: TipDiameter = entry("tip diameter, the smallest of the ring")
    rim_diameter: Diameter = entry("outer diameter of the rim")
    face_width: FaceWidth = entry("face width b")
    tip_edge_radius: TipEdge = entry("radius of the tip edge rounding", 2e-4)
    dedendum: Factor = entry("root depth below the reference circle, factor of m", 1.25)
    fillet_radius: Factor = entry("root fillet, an arc tangent to flank and root circle, factor of m", 0.3)
    material: Material = entry("material")
    modal_damping: ModalDamping = entry("damping ratio of the elastic modes", 0.01)
    mounts: MountsSpec | None = entry("elastic mounts; none when the table is absent", None)
    body: BodySpec = entry("mesh and reduction")
    imported: RingImportSpec | None = entry(ELSEWHERE, None, alias="import")


class ShaftSection(Spec):
    """A cylinder of a shaft."""

    length: Length = entry("length along the axis")
    outer_diameter: Diameter = entry("outer diameter")
    bore_diameter: Annotated[float, Quantity("bore")] = entry("diameter of the bore; 0: solid", 0.0)

    @model_validator(mode="after")
    def _hollow(self) -> ShaftSection:
        if self.bore_diameter >= self.outer_diameter:
            raise refuse("the bore is not smaller than the outer diameter: make it smaller")
        return self


class ShaftBody(Spec):
    """A shaft: a Timoshenko beam of cylinders, from its place in +z."""

    name: Name = entry("name of the shaft")
    kind: Literal["shaft"] = entry("kind of body")
    sections: Annotated[tuple[ShaftSection, ...], Field(min_length=1)] = entry("cylinders, in order")
    material: Material = entry("material")
    modal_damping: ModalDamping = entry("damping ratio of the elastic modes", 0.01)
    stored_to: Annotated[float, Quantity("stored_to")] = entry("modes below are stored, the others are static", 150e3)

    @property
    def length(self) -> float:
        """m."""
        return sum(section.length for section in self.sections)
