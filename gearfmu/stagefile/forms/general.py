"""A stage of any kind: bodies, rotors on parallel axes, engagements, supports and ports.

All axes are parallel to z. A place on an axis is its z in the stage; a gear's own place is its mid-width, a shaft's its
beginning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import Field, PrivateAttr, field_validator, model_validator

from gearfmu.errors import Problem, SpecError
from gearfmu.stagefile.forms.planetary import CarrierBody, PlanetarySpec
from gearfmu.stagefile.reading.base import LaterFields, Name, Quantity, Spec, Text, entry, named_tables, refuse
from gearfmu.stagefile.tables.bodies import (
    Backlash,
    GearSpec,
    HelixAngle,
    Module,
    MountsSpec,
    PressureAngle,
    RingSpec,
    ShaftBody,
)
from gearfmu.stagefile.tables.connections import (
    Bearing,
    Bearings,
    ContactDamping,
    FilmSpec,
    FrictionSpec,
    LevelSpec,
    Limits,
    Misalignment,
    NodalSpec,
    OperatingSpec,
    Place,
    PortSpec,
    Slices,
    SupportSpec,
)
from gearfmu.stagefile.tables.housing import HousingBody
from gearfmu.stagefile.tables.imported import SurfaceCoupling

if TYPE_CHECKING:
    from gearfmu.stagefile.forms.pair import StageSpec

Form: TypeAlias = "StageSpec | PlanetarySpec"
Of = TypeVar("Of")
Axis = Annotated[float, Quantity("axis")]


class GearBody(GearSpec):
    """A toothed body: a GearSpec with its basic rack's module and angles; what holds it stands in `supports`."""

    kind: Literal["gear"] = entry("kind of body", "gear")
    normal_module: Module = entry("normal module m_n")
    pressure_angle: PressureAngle = entry("normal pressure angle of the basic rack")
    helix_angle: HelixAngle = entry(
        "helix angle beta at the reference circle, -35 deg to 35 deg; positive: a right-handed gear, whose "
        "mate is left-handed",
        0.0,
    )
    bearing: Bearing | None = entry("not here: write [[supports]]", None)  # type: ignore[assignment]

    @field_validator("bearing")
    @classmethod
    def _held_elsewhere(cls, value: Any) -> Any:
        if value is not None:
            raise refuse("a body of a general stage has no bearing of its own: write it under [[supports]]")
        return value


class RingBody(RingSpec):
    """An internal gear: a RingSpec with its basic rack's module and angles. Its one node is the mean
    motion of its rim; what holds it stands in `supports`, and a port holds its spin."""

    name: Name
    kind: Literal["ring"] = entry("kind of body")
    normal_module: Module = entry("normal module m_n")
    pressure_angle: PressureAngle = entry("normal pressure angle of the basic rack")
    helix_angle: HelixAngle = entry(
        "helix angle beta at the reference circle, -35 deg to 35 deg; positive: a right-handed ring, whose "
        "mate is right-handed too",
        0.0,
    )
    mounts: MountsSpec | None = entry("not here: write [[supports]]", None)
    rim_coupling: SurfaceCoupling = entry(
        "how the rim meets its node: averaging (RBE3, the rim may deform) or rigid (RBE2, a stiff housing)", "averaging"
    )

    @model_validator(mode="after")
    def _own_mesh(self) -> RingBody:
        if self.imported is not None and self.rigid_bore:
            raise refuse('finite elements made elsewhere have an averaging rim only: write rim_coupling = "averaging"')
        return self

    @property
    def rigid_bore(self) -> bool:
        """Whether the rim's surface, in place of the bore, moves as one rigid body."""
        return self.rim_coupling == "rigid"

    @field_validator("mounts")
    @classmethod
    def _held_elsewhere(cls, value: Any) -> Any:
        if value is not None:
            raise refuse("a ring of a general stage has no mounts of its own: write it under [[supports]]")
        return value


ToothedBody = GearBody | RingBody


Reduced: TypeAlias = ToothedBody | CarrierBody | HousingBody  # bodies that have a file


class RotorSpec(Spec):
    """Bodies that turn together about one axis."""

    axis: tuple[Axis, Axis] = entry("x and y of the axis; of a carried rotor, in the carrier's axes")
    offset: tuple[Place, Place] = entry(
        "deviation of the axis from that place: teeth are placed as if there were none", (0.0, 0.0)
    )
    carried_by: Name | None = entry(
        "rotor in whose axes this one and its supports are fixed (planet carrier); the ground when absent", None
    )
    stands: bool = entry("it does not turn: supports with torsion hold it", False)
    bodies: Annotated[dict[Name, Place], Field(min_length=1)] = entry(
        "place of every body along the axis: mid-width of a gear, beginning of a shaft"
    )


class EngagementSpec(Spec):
    """Two gears in mesh; a ring is gear B."""

    name: Name = entry("name of the mesh")
    gears: tuple[Name, Name] = entry("gear A, gear B (the ring where there is one)")
    backlash: Backlash = entry("circumferential backlash j_wt of the assembled pair on the working pitch circle")
    damping: ContactDamping = entry("contact damping per metre of face width")
    torque_max: Annotated[float, Quantity("mesh_torque_max")] = entry("largest torque on gear A")
    speed_max: Annotated[float, Quantity("mesh_speed_max")] = entry("largest speed of gear A")
    friction: FrictionSpec | None = entry("friction of the flanks; none when absent", None)
    film: FilmSpec | None = entry("squeeze film in open gaps; none when absent", None)
    misalignment: Misalignment | None = entry(
        "parallelism errors of the axes, B's seen from A's; parallel when the table is absent", None
    )


class PlacedPort(PortSpec):
    """A port and where it meets its rotor."""

    body: Name = entry("body whose node is the port")
    at: Place | None = entry("place along the axis; a gear's mid-width when absent", None)
    node: Name | None = entry("node of a carrier: bore, bolt0, bolt1 …", None)


@dataclass(frozen=True)
class Origin:
    """The file of a pair or of a set, which a stage was expanded from; of a general stage nothing.

    form: the file's own tables; places: names there of tables and fields that have others in the stage; files: of
    bodies that share one reduced body, its name; missing: fields that it needs to move."""

    form: Form | None = None
    places: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    missing: tuple[Problem, ...] = ()


_OF_FORMS = ("pair", "contact", "geometry", "torque_max", "speed_max", "set", "sun", "planet", "ring", "carrier")
OF_BOTH = {"name", "description", "source", "levels", "bearings", "operating"}  # fields that forms have too


class Stage(LaterFields):
    """A stage as bodies, rotors, engagements, supports and ports; SI floats. `source` is its file.

    Files of kind external_pair and planetary_set are expanded into it (`expand`); `written` is what they say.
    """

    later = ("operating", "bearings")
    _origin: Origin = PrivateAttr(default_factory=Origin)

    name: Name = entry("name of the stage, also of its FMU")
    description: Text = entry("one line about the stage", "")
    source: Path
    kind: Literal["general"] = entry("kind of stage", "general")
    slices: Slices = entry("slices across the face width", 5)
    nodal: NodalSpec = entry("nodal contact, for level paper", default_factory=NodalSpec)
    bodies: dict[
        Name, Annotated[GearBody | RingBody | ShaftBody | CarrierBody | HousingBody, Field(discriminator="kind")]
    ] = entry("bodies by name")
    rotors: dict[Name, RotorSpec] = entry("rotors by name; every body but a housing in one of them")
    engagements: Annotated[tuple[EngagementSpec, ...], Field(min_length=1)] = entry("meshes")
    supports: tuple[SupportSpec, ...] = entry("bearings and seats", ())
    bearings: Bearings = entry("rolling bearings of the supports, by name", default_factory=dict)
    operating: OperatingSpec | None = entry(
        "load at which rolling bearings are linearised; needed where there are some", None
    )
    ports: dict[Name, PlacedPort] = entry("ports by name")
    levels: LevelSpec = entry("cut frequencies", default_factory=LevelSpec)

    @field_validator("bodies", mode="before")
    @classmethod
    def _named(cls, value: object) -> object:
        return named_tables(value, kind="gear")

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Stage:
        """A copy with other fields; where the file of a pair or set could not say them, a general stage without it.
        AttributeError for a name that is no field (`expand.rewritten` changes fields of the file)."""
        if unknown := set(update or {}) - set(type(self).model_fields):
            raise AttributeError(f"a Stage has no {', '.join(sorted(unknown))}: change what is written in its file")
        found, form = super().model_copy(update=update, deep=deep), self._origin.form
        if form is not None:
            said = set(update or {}) <= OF_BOTH & set(type(form).model_fields)
            found._origin = replace(self._origin, form=form.model_copy(update=update)) if said else Origin()
        return found

    if not TYPE_CHECKING:  # as in BaseModel, so that checkers find names that are none

        def __getattr__(self, name: str) -> Any:
            if name in _OF_FORMS:
                raise AttributeError(f"a Stage has no {name}: what the file of a pair or set says is in stage.written")
            return super().__getattr__(name)

    @property
    def written(self) -> Form | Stage:
        """What the file says: the tables of a pair or a set, else the stage itself."""
        return self._origin.form or self

    @property
    def limits(self) -> Limits:
        """Torque and speed of the input of a pair or set; none of a general stage, whose engagements have their own."""
        form = self._origin.form
        return () if form is None else form.limits

    @property
    def mounts(self) -> MountsSpec | None:
        """What holds the ring of a planetary set, patch by patch of its rim."""
        form = self._origin.form
        return form.ring.mounts if isinstance(form, PlanetarySpec) else None

    @property
    def load_sharing(self) -> float:
        """Torque that every mesh is made for, over its mean at the limit; 1 but for a set."""
        form = self._origin.form
        return form.set.load_sharing if isinstance(form, PlanetarySpec) else 1.0

    def require_motion(self) -> None:
        """SpecError with everything that a set needs to move and does not say, and for a housing that nothing holds."""
        held, file = {support.body for support in self.supports}, str(self.source)
        free = [own for own in self.housings if own.name not in held]
        loose = [Problem(file, f"bodies.{own.name}", "no feet", own.hanging) for own in free]
        if problems := [*self._origin.missing, *loose]:
            raise SpecError(problems)

    def file_of(self, body: str) -> str:
        """Name of the reduced body of a toothed body or carrier: planets of a set share one."""
        return self._origin.files.get(body, body)

    def table_of(self, body: str) -> str:
        """The table of a body in the stage file: "bodies.wheel1", "gears.pinion", "sun"."""
        return self.in_file(f"bodies.{body}")

    def in_file(self, field: str) -> str:
        """The name of a field in the stage file: "bodies.sun.teeth" of a set is "sun.teeth" there."""
        keys = field.split(".")
        for size in range(len(keys), 0, -1):
            if (place := self._origin.places.get(".".join(keys[:size]))) is not None:
                return ".".join([place, *keys[size:]])
        return field

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the reduced bodies: toothed ones, carriers, the housing. Shafts need no reduction."""
        return tuple(self.by_file)

    @property
    def by_file(self) -> dict[str, Reduced]:
        """The table of every reduced body, under the name of its file: of planets that share one, the first's."""
        found: dict[str, Reduced] = {}
        for body in self.reduced:
            name = self.file_of(body.name)
            found.setdefault(name, body if body.name == name else body.model_copy(update={"name": name}))
        return found

    def by_name(self, bodies: Sequence[Of]) -> dict[str, Of]:
        """One of `bodies` (or of what stands for them, such as their hashes), in the order of `files`, for every
        reduced body by name."""
        own = dict(zip(self.files, bodies, strict=True))
        return {body.name: own[self.file_of(body.name)] for body in self.reduced}

    @property
    def reduced(self) -> tuple[Reduced, ...]:
        """Bodies that have a file: toothed ones, carriers, the housing."""
        return (*self.gears, *self.carriers, *self.housings)

    @property
    def gears(self) -> tuple[ToothedBody, ...]:
        """Toothed bodies in the order of the file: the kernel's gear numbers."""
        return tuple(body for body in self.bodies.values() if isinstance(body, ToothedBody))

    @property
    def planar(self) -> bool:
        """Whether nothing tilts or moves along the axis: every rotor one spur gear, held radially at its mid-width."""
        alone = all(isinstance(body, ToothedBody) and body.helix_angle == 0 for body in self.bodies.values())
        alone = alone and all(len(rotor.bodies) == 1 for rotor in self.rotors.values())
        places = {name: place for rotor in self.rotors.values() for name, place in rotor.bodies.items()}
        return (
            alone
            and not self.rolling
            and all(
                s.axial is None and s.tilt is None and s.to is None and s.at in (None, places[s.body])
                for s in self.supports
            )
        )

    @property
    def rolling(self) -> bool:
        """Whether rolling bearings hold it, whose stiffness depends on the load."""
        return any(support.bearing is not None for support in self.supports)

    @property
    def even(self) -> bool:
        """Whether everything is symmetric about mid-width: planar, flanks even across the width, axes aligned."""
        return (
            self.planar
            and not any(gear.uneven for gear in self.gears)
            and all(mesh.misalignment is None for mesh in self.engagements)
        )

    @property
    def carriers(self) -> tuple[CarrierBody, ...]:
        """Planet carriers in the order of the file."""
        return tuple(body for body in self.bodies.values() if isinstance(body, CarrierBody))

    @property
    def housings(self) -> tuple[HousingBody, ...]:
        """The housing that carries the bearings, or nothing."""
        return tuple(body for body in self.bodies.values() if isinstance(body, HousingBody))

    def on_rigid_ground(self) -> Stage:
        """The stage whose bearings stand on the ground, without its housing; itself where it has none."""
        if not (names := {housing.name for housing in self.housings}):
            return self
        supports = [
            support.model_copy(update={"to": None, "node": None}) if support.to in names else support
            for support in self.supports
            if support.body not in names
        ]
        bodies = {name: body for name, body in self.bodies.items() if name not in names}
        return self.model_copy(update={"bodies": bodies, "supports": tuple(supports)})

    def frame_of(self, mesh: EngagementSpec) -> str | None:
        """Name of the rotor in whose axes an engagement rolls; None: the ground."""
        return self.rotors[self.rotor_of(mesh.gears[0])].carried_by

    def rotor_of(self, body: str) -> str:
        """Name of the rotor that a body belongs to."""
        return next(name for name, rotor in self.rotors.items() if body in rotor.bodies)

    def internal(self, mesh: EngagementSpec) -> bool:
        """Whether gear B of an engagement is a ring."""
        return isinstance(self.bodies[mesh.gears[1]], RingBody)

    def place(self, body: str, at: float | None) -> float:
        """Place of a node on a body: as said, or the body's own."""
        return self.rotors[self.rotor_of(body)].bodies[body] if at is None else at
