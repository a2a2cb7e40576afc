"""Springs that hold the bodies of a stage: bearings and seats."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from gearfmu.spec.reading.base import Name, Quantity, refuse
from gearfmu.spec.tables.bearings import CatalogueName, LaterFields, Ratio, Side
from gearfmu.spec.tables.gear import Length

Place = Annotated[float, Quantity("place")]
RadialSpring = Annotated[float, Quantity("bearing_stiffness", words=("rigid",))]
AxialSpring = Annotated[float, Quantity("axial_stiffness", words=("rigid",))]
TiltSpring = Annotated[float, Quantity("tilt_stiffness", words=("rigid",))]


class SupportSpec(LaterFields):
    """A spring between a body and the ground, or two bodies: a bearing, a seat. Directions without stiffness are
    free. A rolling bearing has its own stiffness."""

    later = ("bearing", "span", "carries")

    name: Name = Field(description="name of the support")
    body: Name = Field(description="body that is held")
    to: Name | None = Field(default=None, description="body that holds it; the ground when absent")
    at: Place | None = Field(default=None, description="place along the axis; a gear's mid-width when absent")
    node: Name | None = Field(
        default=None, description="node of a carrier: bore, bolt0, bolt1 …; of a housing: name of a seat or foot"
    )
    radial: RadialSpring | None = Field(default=None, description="stiffness along x and y")
    axial: AxialSpring | None = Field(default=None, description="stiffness along the axis")
    tilt: TiltSpring | None = Field(default=None, description="stiffness against tilting about x and y")
    torsion: TiltSpring | None = Field(default=None, description="stiffness against twist; between bodies of one rotor")
    bearing: CatalogueName | None = Field(
        default=None, description="rolling bearing in place of the stiffnesses: name of a table [bearings.NAME]"
    )
    span: Length | None = Field(
        default=None, description="distance of two such bearings, mirrored, on a stiff piece of shaft; one when absent"
    )
    carries: Side | None = Field(
        default=None,
        description="axial force of the shaft that an angular contact bearing (of two the left) carries",
    )
    damping_ratio: Ratio = Field(
        default=0.03, description="damping ratio D: c = 2 D sqrt(k m), m: mass of the rotor, or its moment of inertia"
    )

    @model_validator(mode="after")
    def _holds(self) -> SupportSpec:
        if all(value is None for value in (self.radial, self.axial, self.tilt, self.torsion, self.bearing)):
            raise refuse('a support needs a stiffness: radial, axial, tilt or torsion, e.g. radial = "3e8 N/m"')
        return self
