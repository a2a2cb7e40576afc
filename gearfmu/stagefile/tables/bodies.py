"""Gears and shafts of a stage file, and the pair as a whole (ISO 21771 and REXS terms; SI floats).

Teeth need not be nominal: flanks may be modified, deviations measured or drawn, and the toothing may not run true. All
of that belongs to the stage and shapes no body: the finite elements have nominal flanks on nominal axes. Amounts are
lengths in the transverse section normal to the involute. A *relief* and a *crowning* take material away and are
positive; a *deviation* is positive where there is more material than nominal (ISO 1328-1:2013, ISO 21771:2007)."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, cast

from pydantic import BeforeValidator, ConfigDict, Field, field_validator, model_validator

from gearfmu.quantities import kernel_limits
from gearfmu.stagefile.reading.base import Count, Name, Quantity, Spec, Switch, Text, Whole, refuse
from gearfmu.stagefile.tables.connections import Diameter, GearBearing, Length
from gearfmu.stagefile.tables.imported import ImportSpec

Depth = Annotated[float, Quantity("flank_depth")]
Slope = Annotated[float, Quantity("flank_slope")]
Parallelism = Annotated[float, Quantity("misalignment")]
# "quadratic" is what files of before 0.2 call a parabola
ReliefKind = Annotated[
    Literal["linear", "parabolic", "arc"], BeforeValidator(lambda kind: "parabolic" if kind == "quadratic" else kind)
]


class EndRelief(Spec):
    """Material taken off towards both ends of the face width."""

    amount: Depth = Field(description="end relief at either end of the face width, normal to the involute")
    length: Length = Field(description="length from either end over which it fades to nothing")
    kind: ReliefKind = Field(default="parabolic", description="shape over that length")


class LeadSpec(Spec):
    """Flank modifications across the face width, on both flanks of every tooth (ISO 21771)."""

    slope: Slope = Field(
        default=0.0,
        description="helix slope f_Hbeta over the whole face width, normal to the involute; positive: both flanks are "
        "turned like a right-hand helix (of a left-handed gear ISO 1328-1 counts it the other way)",
    )
    crowning: Depth = Field(
        default=0.0, description="lead crowning C_beta: depth at both ends of the face width, none at its middle"
    )
    end_relief: EndRelief | None = Field(default=None, description="end relief; none when the table is absent")


class Misalignment(Spec):
    """Parallelism errors of the axes of the unloaded pair (ISO/TR 10064-3), of the wheel's axis seen from the pinion's.

    In the frame of the stage: pinion's axis z, wheel on +x; errors count from the end at −z to that at +z.
    """

    out_of_plane: Parallelism = Field(
        default=0.0,
        description="f_SigmaBeta, deviation out of the common plane of the axes over the span; positive: at its +z end "
        "the wheel's axis lies further towards +y",
    )
    in_plane: Parallelism = Field(
        default=0.0,
        description="f_SigmaDelta, deviation in the common plane over the span; positive: the centre distance grows "
        "towards +z",
    )
    span: Length = Field(description="length L along the axes over which both are measured (bearing span)")

    @model_validator(mode="after")
    def _nearly_parallel(self) -> Misalignment:
        most = kernel_limits()["TILT"][1]
        tilt = math.hypot(self.out_of_plane, self.in_plane) / self.span
        if tilt > most:
            raise refuse(f"the axes tilt by {tilt:.3g} rad, at most {most:g} rad: smaller deviations or a longer span")
        return self


Angle = Annotated[float, Quantity("angle")]
Tilt = Annotated[float, Quantity("wobble")]
Relief = Annotated[float, Quantity("relief")]
Pitch = Annotated[float, Quantity("pitch_deviation")]
Roll = Quantity("roll", words=("outer_single_contact",))
InnerRoll = Quantity("roll", words=("inner_single_contact",))
Part = Literal["pitch", "profile", "helix"]


class TipRelief(Spec):
    """Tip relief on both flanks of every tooth."""

    amount: Relief = Field(description="relief normal to the involute at the tip diameter")
    start_roll: Annotated[float, Roll] = Field(
        default=cast(Any, "outer_single_contact"),  # the loader puts the roll in its place
        description='roll length of its beginning, or "outer_single_contact"',
    )
    kind: ReliefKind = Field(default="parabolic", description="shape over the roll length")


class RootRelief(Spec):
    """Root relief on both flanks of every tooth."""

    amount: Relief = Field(description="relief normal to the involute where the flank ends at its root (form diameter)")
    start_roll: Annotated[float, InnerRoll] = Field(
        default=cast(Any, "inner_single_contact"),  # the loader puts the roll in its place
        description='roll length of its beginning, or "inner_single_contact"',
    )
    kind: ReliefKind = Field(default="parabolic", description="shape over the roll length")


class ProfileSpec(Spec):
    """Modifications along the profile of both flanks of every tooth, over the usable flank from its form diameter to
    its tip."""

    slope: Slope = Field(
        default=0.0,
        description="profile slope f_Halpha over the usable flank, none at its middle roll; positive: more material "
        "towards the tip",
    )
    crowning: Depth = Field(
        default=0.0, description="profile crowning C_alpha: depth at both ends of the usable flank, none at its middle"
    )


class DeviationClass(Spec):
    """Deviations drawn at random within a tolerance class of ISO 1328-1:2013, the same for the same seed."""

    model_config = ConfigDict(populate_by_name=True)  # `class` is no name in Python

    tolerance_class: Annotated[Count, Whole("tolerance_class")] = Field(
        alias="class", description="flank tolerance class A"
    )
    seed: Annotated[Count, Whole("seed")] = Field(
        default=1, description="seed of the draw; gears of one seed differ by their names"
    )
    use: Annotated[float, Quantity("share")] = Field(
        default=1.0, description="share of the tolerances that the draw uses up"
    )
    parts: tuple[Part, ...] = Field(
        default=("pitch", "profile", "helix"),
        description="drawn deviations: pitch, profile slopes, helix slopes",
    )
    per_tooth: Switch = Field(default=True, description="slopes differ from tooth to tooth; false: one for each flank")


class Eccentricity(Spec):
    """The toothing's axis beside the axis of rotation."""

    amount: Annotated[float, Quantity("eccentricity")] = Field(
        description="distance of the toothing's axis from the axis of rotation at mid-width"
    )
    angle: Angle = Field(
        default=0.0, description="direction of the toothing's axis, from tooth 0 (of a ring: space 0) counter-clockwise"
    )


class Wobble(Spec):
    """The toothing's axis tilted against the axis of rotation."""

    amount: Tilt = Field(description="angle between the two axes; they cross at mid-width")
    angle: Angle = Field(
        default=0.0,
        description="direction towards which the toothing's axis leans at its +z end, from tooth 0 (of a ring: space "
        "0) counter-clockwise",
    )


class Toothing(Spec):
    """What every toothed member may say about its teeth; also what is told of a gear that says nothing."""

    tip_relief: TipRelief | None = Field(default=None, description="tip relief; none when the table is absent")
    root_relief: RootRelief | None = Field(default=None, description="root relief; none when the table is absent")
    profile: ProfileSpec | None = Field(
        default=None, description="modifications along the profile; none when the table is absent"
    )
    lead: LeadSpec | None = Field(
        default=None, description="modifications across the face width; none when the table is absent"
    )
    topography: Text | None = Field(
        default=None,
        description="measured or designed flanks: CSV file (docs/howto-flanks.md), path relative to the stage file",
    )
    index_deviation: dict[Annotated[int, Whole("tooth_number")], Pitch] = Field(
        default={},
        description="pitch errors: individual index deviation F_pi (ISO 1328-1) by tooth number, or a list of all, arc "
        "on the reference circle, both flanks, positive counter-clockwise",
    )
    pitch_deviation: tuple[Pitch, ...] = Field(
        default=(),
        description="single pitch deviations f_pi of all pitches, the first from the last tooth to tooth 0; they are "
        "summed to index deviations",
    )
    deviations: DeviationClass | None = Field(
        default=None, description="deviations drawn within a tolerance class; none when the table is absent"
    )
    eccentricity: Eccentricity | None = Field(
        default=None, description="toothing beside the axis of rotation; on it when the table is absent"
    )
    wobble: Wobble | None = Field(
        default=None, description="toothing tilted against the axis of rotation; not when the table is absent"
    )

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
SurfaceCoupling = Literal["averaging", "rigid"]


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

    center_distance: Annotated[float, Quantity("center_distance")] = Field(description="centre distance a")
    normal_module: Module = Field(description="normal module m_n")
    pressure_angle: PressureAngle = Field(description="normal pressure angle of the basic rack")
    helix_angle: HelixAngle = Field(
        default=0.0,
        description="helix angle beta at the reference circle, -35 deg to 35 deg; positive: the pinion is right-handed "
        "and the wheel left-handed",
    )
    backlash: Backlash = Field(
        description="circumferential backlash j_wt of the assembled pair on the working pitch circle"
    )
    misalignment: Misalignment | None = Field(
        default=None, description="parallelism errors of the axes; parallel axes when the table is absent"
    )


class RackSpec(Spec):
    """Basic rack of the tool, in factors of the module (ISO 53)."""

    addendum: Factor = Field(default=1.0, description="addendum of the basic rack, factor of m")
    dedendum: Factor = Field(default=1.25, description="dedendum of the basic rack, factor of m")
    fillet_radius: Factor = Field(default=0.38, description="root fillet radius of the basic rack, factor of m")


class Material(Spec):
    """Linear elastic, isotropic."""

    youngs_modulus: Annotated[float, Quantity("youngs_modulus")] = Field(description="Young's modulus E")
    poisson_ratio: Annotated[float, Quantity("poisson_ratio")] = Field(description="Poisson's ratio")
    density: Annotated[float, Quantity("density")] = Field(description="density")


class MeshSpec(Spec):
    """Element counts of the sector mesh (20-node hexahedra; half a tooth) and how they are graded.

    The defaults are the counts on which the loaded transmission error of the shipped pair is converged to 1 %
    (docs/decisions/bodies.md).
    """

    flank: Annotated[Count, Whole("elements_two")] = Field(
        default=20, description="elements along the flank, equal in arc length"
    )
    thickness: Annotated[Count, Whole("elements")] = Field(default=5, description="elements across half the tooth")
    root: Annotated[Count, Whole("elements_two")] = Field(
        default=6, description="elements along root fillet and half the root land"
    )
    rim: Annotated[Count, Whole("elements")] = Field(
        default=4,
        description="elements from root to bore; more are taken where the rim is too high for the growth below",
    )
    width: Annotated[Count, Whole("elements")] = Field(default=6, description="elements across the face width")
    thickness_grading: Annotated[float, Quantity("grading")] = Field(
        default=1.6, description="growth of elements from the surface inwards"
    )
    rim_grading: Annotated[float, Quantity("rim_grading")] = Field(
        default=1.5, description="largest growth of elements from the root to the bore"
    )
    scale: Annotated[float, Quantity("scale")] = Field(
        default=1.0, description="factor on all counts; the gradings keep their shape"
    )

    def scaled(self, count: int, least: int = 1) -> int:
        """`count` times the scale, rounded."""
        return max(least, round(self.scale * count))

    def growth(self, grading: float) -> float:
        """Growth per element at this scale: scale 2 divides the elements of scale 1 within the same series."""
        return float(grading ** (1 / self.scale))


class BodySpec(Spec):
    """How the gear's body is meshed and reduced; with geometry and material it decides the reduced body."""

    strip_half_width: Annotated[float, Quantity("strip_half_width")] = Field(
        description="half-width, in arc length, of the load patch on the flank; at least 1.5 Hertz half-widths"
    )
    modes: Annotated[Count, Whole("modes")] = Field(default=400, description="number of elastic modes stored")
    roll_points: Annotated[Count, Whole("roll_points")] = Field(
        default=28, description="Chebyshev points along the flank"
    )
    width_functions: Annotated[Count, Whole("width_functions")] = Field(
        default=5, description="Legendre functions across the face width"
    )
    mesh: MeshSpec = Field(default_factory=MeshSpec, description="element counts")


class GearSpec(Toothing):
    """One gear; `name` is also its shaft's name."""

    model_config = ConfigDict(populate_by_name=True)  # `import` is no name in Python

    name: Name = Field(description="name of gear and shaft")
    teeth: Teeth = Field(description="number of teeth z")
    profile_shift: ProfileShift = Field(description="profile shift coefficient x")
    tip_diameter: TipDiameter = Field(description="tip diameter d_a")
    face_width: FaceWidth = Field(description="face width b")
    bore_diameter: Diameter = Field(description="diameter of the bore")
    bore_coupling: SurfaceCoupling = Field(
        default="averaging",
        description="how the bore meets its node: averaging (RBE3, the bore may deform) or rigid (RBE2, a stiff shaft)",
    )
    tip_edge_radius: TipEdge = Field(default=2e-4, description="radius of the tip edge rounding")
    rack: RackSpec = Field(default_factory=RackSpec, description="basic rack")
    material: Material = Field(description="material")
    modal_damping: ModalDamping = Field(default=0.01, description="damping ratio of the elastic modes")
    bearing: GearBearing = Field(description="bearing")
    body: BodySpec = Field(description="mesh and reduction")
    imported: ImportSpec | None = Field(
        default=None, alias="import", description="finite elements made elsewhere; meshed here when the table is absent"
    )

    @model_validator(mode="after")
    def _one_coupling(self) -> GearSpec:
        if self.imported is not None and self.rigid_bore:
            raise refuse('finite elements made elsewhere have their own: write bore_coupling = "rigid" under import')
        return self

    @property
    def rigid_bore(self) -> bool:
        """Whether the bore's surface moves as one rigid body."""
        return self.bore_coupling == "rigid"


class ShaftSection(Spec):
    """A cylinder of a shaft."""

    length: Length = Field(description="length along the axis")
    outer_diameter: Diameter = Field(description="outer diameter")
    bore_diameter: Annotated[float, Quantity("bore")] = Field(default=0.0, description="diameter of the bore; 0: solid")

    @model_validator(mode="after")
    def _hollow(self) -> ShaftSection:
        if self.bore_diameter >= self.outer_diameter:
            raise refuse("the bore is not smaller than the outer diameter: make it smaller")
        return self


class ShaftBody(Spec):
    """A shaft: a Timoshenko beam of cylinders, from its place in +z."""

    name: Name = Field(description="name of the shaft")
    kind: Literal["shaft"] = Field(description="kind of body")
    sections: Annotated[tuple[ShaftSection, ...], Field(min_length=1)] = Field(description="cylinders, in order")
    material: Material = Field(description="material")
    modal_damping: ModalDamping = Field(default=0.01, description="damping ratio of the elastic modes")
    stored_to: Annotated[float, Quantity("stored_to")] = Field(
        default=150e3, description="modes below are stored, the others are static"
    )

    @property
    def length(self) -> float:
        """m."""
        return sum(section.length for section in self.sections)
