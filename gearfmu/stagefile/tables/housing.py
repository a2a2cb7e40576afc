"""A housing: finite elements made elsewhere, or a superelement, in the axes of the stage, with the places where it is
loaded and felt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from gearfmu.stagefile.reading.base import Count, LaterFields, Name, Quantity, Text, Whole, entry, refuse
from gearfmu.stagefile.tables.bodies import Material, ModalDamping
from gearfmu.stagefile.tables.imported import FilesSpec, SourceSpec, SurfaceCoupling

Method = Literal["krylov", "rubin", "craig_bampton", "modal"]
Label = Annotated[int, Strict(), Whole("label")]
MOST_SENSORS = 85  # three outputs each, of 255
LONGEST = 20  # characters of a sensor's name, with which its outputs begin


class HousingImportSpec(FilesSpec):
    """The finite elements of a housing, in the stage's axes: the seats lie on the axes of their shafts."""

    seats: Annotated[dict[Name, Text], Field(min_length=1)] = entry(
        "node sets of the bearings' seats, by the names that supports give as node"
    )
    feet: dict[Name, Text] = entry("node sets of the feet, by the names of their nodes", {})
    sensors: dict[Name, Text] = entry("node sets whose mean acceleration is an output, one node each or a patch", {})
    skin: Text = entry("node set of the outer surface, which radiates; none is stored when absent", "")
    seat_coupling: SurfaceCoupling = entry(
        "averaging (RBE3, a seat may deform) or rigid (RBE2) master nodes of the seats", "averaging"
    )
    foot_coupling: SurfaceCoupling = entry("the same of the feet", "rigid")

    @model_validator(mode="after")
    def _named_apart(self) -> HousingImportSpec:
        _check_names(self.seats, self.feet, self.sensors)
        return self


class HousingReducedSpec(SourceSpec):
    """A superelement: matrices over the six motions of seats and feet and over modal coordinates, in the stage's axes.
    `file` says where its points lie, by GRID cards or *NODE; `unknowns` names the rows, "1001.4" or, of a modal
    coordinate, "7001.0"."""

    seats: Annotated[dict[Name, Label], Field(min_length=1)] = entry(
        "points of the bearings' seats, by the names that supports give as node"
    )
    feet: dict[Name, Label] = entry("points of the feet, by the names of their nodes", {})
    rotations: dict[Name, Label] = entry(
        "points whose displacements are the rotations of a seat or foot (ROT NODE of CalculiX)", {}
    )
    sensors: dict[Name, Label] = entry(
        "points whose acceleration is an output, of the superelement or of its recovery", {}
    )
    recovery: Text = entry("matrix from the unknowns to displacements of further points: .mtx, .npz, .npy or .op4", "")
    recovered: Text = entry('point and direction of each row of recovery, lines such as "42.3"', "")
    surface: Text = entry(
        "mesh of the outer surface, which radiates: .bdf or .vtu; its points are of the superelement or of "
        "its recovery",
        "",
    )

    @model_validator(mode="after")
    def _complete(self) -> HousingReducedSpec:
        _check_names(self.seats, self.feet, self.sensors)
        if not self.stiffness:
            raise refuse("a superelement is its matrices: give stiffness and mass")
        if bool(self.recovery) != bool(self.recovered):
            raise refuse("recovery and recovered come together: a matrix, and the points of its rows")
        if strange := sorted(set(self.rotations) - set(self.seats) - set(self.feet)):
            raise refuse(f"rotations names {strange[0]}, which is no seat and no foot")
        return self


def _check_names(seats: Mapping[str, object], feet: Mapping[str, object], sensors: Mapping[str, object]) -> None:
    """Refuses names that are given twice, are too long, or are too many."""
    if twice := sorted(set(seats) & set(feet)):
        raise refuse(f"seats and feet share the name {twice[0]}: give every node its own")
    if len(sensors) > MOST_SENSORS:
        raise refuse(f"{len(sensors)} sensors, at most {MOST_SENSORS} are outputs: leave some away")
    if long := [name for name in sensors if len(name) > LONGEST]:
        raise refuse(f"the name of the sensor {long[0]} has more than {LONGEST} characters: shorten it")


class HousingBody(LaterFields):
    """A housing that stands: bearings sit on its seats, its feet on the ground ([[supports]])."""

    later = ("material", "imported", "reduced")

    name: Name = entry("name of the housing")
    kind: Literal["housing"] = entry("kind of body")
    material: Material | None = entry("material; a superelement needs none", None)
    modal_damping: ModalDamping = entry("damping ratio of the elastic modes", 0.01)
    method: Method = entry("method of reduction; every one ends in oscillators", "rubin")
    modes: Annotated[Count, Whole("carrier_modes")] = entry("number of oscillators stored", 200)
    dynamic_to: Annotated[float, Quantity("stored_to")] = entry("oscillators above are compliance in every run", 10e3)
    imported: HousingImportSpec | None = entry("finite elements made elsewhere", None, alias="import")
    reduced: HousingReducedSpec | None = entry("a superelement made elsewhere", None)

    @model_validator(mode="after")
    def _made_of_one(self) -> HousingBody:
        if (self.imported is None) == (self.reduced is None):
            raise refuse("a housing is made of one thing: give the table import, or the table reduced")
        if self.imported is not None and self.material is None:
            raise refuse("finite elements have a material: give youngs_modulus, poisson_ratio and density")
        if self.reduced is not None and "method" in self.model_fields_set:
            raise refuse("a superelement is reduced already: leave method away")
        return self

    @property
    def made_of(self) -> HousingImportSpec | HousingReducedSpec:
        """What it is made of; both name seats, feet and sensors."""
        found = self.imported or self.reduced
        assert found is not None
        return found

    @property
    def table(self) -> str:
        """Name of that table in the stage file."""
        return "import" if self.imported is not None else "reduced"

    @property
    def hanging(self) -> str:
        """What to do about a housing that nothing holds."""
        feet = ", ".join(self.made_of.feet) or f"none in its {self.table}: name them in feet = {{…}}"
        return (
            "under load it has no equilibrium, shafts leave their reaction torque on it: write [[supports]] with "
            f'body = "{self.name}" and node one of its feet ({feet}), soft ones where it hangs, radial = "1e6 N/m"; '
            "or put it freely under a finished run with `gearfmu house`"
        )
