"""What a stage file of kind external_pair says: one gear pair with its contact, ports and levels."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import field_validator, model_validator

from gearfmu.geometry import PairGeometry
from gearfmu.stagefile.forms.shapes import gears_in_mesh
from gearfmu.stagefile.reading.base import LaterFields, Name, Quantity, Text, entry, refuse
from gearfmu.stagefile.tables.bodies import GearSpec, PairSpec
from gearfmu.stagefile.tables.connections import Bearings, ContactSpec, LevelSpec, Limits, OperatingSpec, PortSpec

Table = TypeVar("Table")


def in_order(gears: dict[str, Table]) -> dict[str, Table]:
    """Tables of a pair's gears, the pinion first: by their names, under other names as in the file."""
    return dict(sorted(gears.items())) if set(gears) == {"pinion", "wheel"} else gears


class StageSpec(LaterFields):
    """A gear stage as its file gives it; SI floats. `source` is that file."""

    later = ("operating", "bearings")

    name: Name = entry("name of the stage, also of its FMU")
    description: Text = entry("one line about the stage", "")
    source: Path
    kind: Literal["external_pair"] = entry("kind of stage", "external_pair")
    torque_max: Annotated[float, Quantity("torque_max")] = entry("largest pinion torque the model is made for")
    speed_max: Annotated[float, Quantity("speed_max")] = entry("largest pinion speed the model is made for")
    pair: PairSpec = entry("the pair")
    gears: tuple[GearSpec, GearSpec] = entry("pinion, then wheel; under other names the pinion first")
    contact: ContactSpec = entry("tooth contact")
    bearings: Bearings = entry("rolling bearings of the gears, by name", default_factory=dict)
    operating: OperatingSpec | None = entry(
        "load at which rolling bearings are linearised; needed where there are some", None
    )
    ports: dict[str, PortSpec] = entry("one port a shaft")
    levels: LevelSpec = entry("cut frequencies", default_factory=LevelSpec)

    @property
    def limits(self) -> Limits:
        """Torque and speed of the pinion that the model is made for."""
        return (self.torque_max, "N*m"), (self.speed_max, "rad/s")

    @property
    def geometry(self) -> PairGeometry:
        """Pinion and wheel at their centre distance. ValueError where the axes are too near."""
        return gears_in_mesh(self.pair, self.gears)

    @field_validator("gears", mode="before")
    @classmethod
    def _named(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        if len(value) != 2 or not all(isinstance(table, dict) for table in value.values()):
            raise refuse("a pair has two gears: write the tables [gears.pinion] and [gears.wheel]")
        return tuple(table | {"name": name} for name, table in in_order(value).items())

    @model_validator(mode="after")
    def _ports_of_shafts(self) -> StageSpec:
        names = {gear.name for gear in self.gears}
        if set(self.ports) != names:
            tables = ", ".join(f"[ports.{name}]" for name in sorted(names))
            raise refuse(f"every shaft needs its port and every port its shaft: write {tables}")
        return self
