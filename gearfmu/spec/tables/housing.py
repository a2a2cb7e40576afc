"""A housing: finite elements made elsewhere, in the axes of the stage, with the places where it is loaded and felt."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from gearfmu.spec.reading.base import Count, Name, Quantity, Spec, Text, Whole, refuse
from gearfmu.spec.tables.gear import Material, ModalDamping
from gearfmu.spec.tables.imported import FilesSpec

Method = Literal["krylov", "rubin", "craig_bampton", "modal"]
Coupling = Literal["averaging", "rigid"]
MOST_SENSORS = 85  # three outputs each, of 255
LONGEST = 20  # characters of a sensor's name, with which its outputs begin


class HousingImportSpec(FilesSpec):
    """The finite elements of a housing, in the stage's axes: the seats lie on the axes of their shafts."""

    seats: Annotated[dict[Name, Text], Field(min_length=1)] = Field(
        description="node sets of the bearings' seats, by the names that supports give as node"
    )
    feet: dict[Name, Text] = Field(default={}, description="node sets of the feet, by the names of their nodes")
    sensors: dict[Name, Text] = Field(
        default={}, description="node sets whose mean acceleration is an output, one node each or a patch"
    )
    skin: Text = Field(
        default="", description="node set of the outer surface, which radiates; none is stored when absent"
    )
    seat_coupling: Coupling = Field(
        default="averaging", description="averaging (RBE3, a seat may deform) or rigid (RBE2) master nodes of the seats"
    )
    foot_coupling: Coupling = Field(default="rigid", description="the same of the feet")

    @model_validator(mode="after")
    def _named_apart(self) -> HousingImportSpec:
        if twice := sorted(set(self.seats) & set(self.feet)):
            raise refuse(f"seats and feet share the name {twice[0]}: give every node its own")
        if len(self.sensors) > MOST_SENSORS:
            raise refuse(f"{len(self.sensors)} sensors, at most {MOST_SENSORS} are outputs: leave some away")
        if long := [name for name in self.sensors if len(name) > LONGEST]:
            raise refuse(f"the name of the sensor {long[0]} has more than {LONGEST} characters: shorten it")
        return self


class HousingBody(Spec):
    """A housing that stands: bearings sit on its seats, its feet on the ground ([[supports]])."""

    model_config = ConfigDict(populate_by_name=True)

    name: Name = Field(description="name of the housing")
    kind: Literal["housing"] = Field(description="kind of body")
    material: Material = Field(description="material")
    modal_damping: ModalDamping = Field(default=0.01, description="damping ratio of the elastic modes")
    method: Method = Field(default="rubin", description="method of reduction; every one ends in oscillators")
    modes: Annotated[Count, Whole("carrier_modes")] = Field(default=200, description="number of oscillators stored")
    dynamic_to: Annotated[float, Quantity("stored_to")] = Field(
        default=10e3, description="oscillators above are compliance in every run"
    )
    imported: HousingImportSpec = Field(alias="import", description="finite elements made elsewhere")

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes at which it is loaded: seats, then feet."""
        return (*self.imported.seats, *self.imported.feet)
