"""What a stage file says about one gear and about the pair (ISO 21771 and REXS terms; SI floats)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from gearfmu.stagefile.reading.base import Count, Name, Quantity, Spec, Whole, refuse
from gearfmu.stagefile.tables.bearings import Bearing as Bearing
from gearfmu.stagefile.tables.bearings import Diameter as Diameter
from gearfmu.stagefile.tables.bearings import GearBearing
from gearfmu.stagefile.tables.bearings import Ratio as Ratio
from gearfmu.stagefile.tables.flanks import Toothing
from gearfmu.stagefile.tables.imported import ImportSpec
from gearfmu.stagefile.tables.lead import Length as Length
from gearfmu.stagefile.tables.lead import Misalignment

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
