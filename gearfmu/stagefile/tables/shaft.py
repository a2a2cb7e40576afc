"""Shafts of a stage file: cylinders in order."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gearfmu.stagefile.reading.base import Name, Quantity, Spec, refuse
from gearfmu.stagefile.tables.gear import Diameter, Length, Material, ModalDamping


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
