"""Connections of the bodies of a stage with each other and with the outside: bearings, supports, tooth contact,
misalignment, ports; and the cut frequencies of its levels (SI floats).

Bearings are springs under a gear, or rolling bearings by their catalogue numbers."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Discriminator, Field, Strict, Tag, model_validator

from gearfmu.quantities import kernel_limits
from gearfmu.stagefile.reading.base import Count, LaterFields, Name, Quantity, Spec, Whole, entry, refuse

CatalogueName = Annotated[str, Strict(), Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,39}$")]
Clearance = Annotated[float, Quantity("bearing_clearance")]
ContactAngle = Annotated[float, Quantity("contact_angle")]
Preload = Annotated[float, Quantity("preload")]
RollingElements = Annotated[Count, Whole("rolling_elements")]
Groove = Annotated[float, Quantity("groove")]
Diameter = Annotated[float, Quantity("diameter")]
Length = Annotated[float, Quantity("length")]
Ratio = Annotated[float, Quantity("damping_ratio")]
Side = Literal["+z", "-z"]
Parallelism = Annotated[float, Quantity("misalignment")]
CARRIES = "axial force of the shaft that an angular contact bearing (of two the left) carries"
SPRINGS = ("stiffness", "axial", "tilt")  # of a Bearing


class OperatingSpec(Spec):
    """The load at which bearings are linearised."""

    torque: Annotated[float, Quantity("torque")] = entry("torque on the input")


class BallBearing(Spec):
    """Deep groove or angular contact ball bearing. What a catalogue does not print is proposed when it is absent."""

    kind: Literal["ball"] = entry("kind of bearing")
    bore: Diameter = entry("bore d")
    outside: Diameter = entry("outside diameter D")
    balls: RollingElements | None = entry("number of balls", None)
    ball_diameter: Diameter | None = entry("diameter of the balls, 0.3 (D - d) when absent", None)
    pitch_diameter: Diameter | None = entry("diameter of their circle, (d + D)/2 when absent", None)
    inner_groove: Groove | None = entry("radius of the inner groove over the ball's diameter, 0.52 when absent", None)
    outer_groove: Groove | None = entry("of the outer groove, 0.53 when absent", None)
    contact_angle: ContactAngle = entry("contact angle; 0 deg: deep groove", 0.0)
    clearance: Clearance = entry("radial clearance in operation; negative: interference", 0.0)
    preload: Preload = entry("axial force that presses the rings together without load", 0.0)

    @model_validator(mode="after")
    def _fits(self) -> BallBearing:
        _check_fit(self, self.ball_diameter, 0.3, self.balls)
        return self


class RollerBearing(Spec):
    """Cylindrical roller bearing, free along its axis, or with a contact angle a tapered one."""

    kind: Literal["roller"] = entry("kind of bearing")
    bore: Diameter = entry("bore d")
    outside: Diameter = entry("outside diameter D")
    width: Length | None = entry("width B; needed where roller_length is absent", None)
    rollers: RollingElements | None = entry("number of rollers", None)
    roller_diameter: Diameter | None = entry("diameter of the rollers, 0.27 (D - d) when absent", None)
    roller_length: Length | None = entry("length of the rollers without chamfers, 0.65 B when absent", None)
    pitch_diameter: Diameter | None = entry("diameter of their circle, (d + D)/2 when absent", None)
    contact_angle: ContactAngle = entry("contact angle of the taper; 0 deg: cylindrical", 0.0)
    clearance: Clearance = entry("radial clearance in operation; negative: interference", 0.0)
    preload: Preload = entry("axial force that presses the rings of a tapered bearing together without load", 0.0)

    @model_validator(mode="after")
    def _fits(self) -> RollerBearing:
        if self.preload and not self.contact_angle:
            raise refuse("cylindrical rollers carry no preload along the axis: write a negative clearance")
        if self.width is None and self.roller_length is None:
            raise refuse('the rollers have no length: write the width of the bearing, e.g. width = "20 mm"')
        _check_fit(self, self.roller_diameter, 0.27, self.rollers)
        return self


RollingBearing = Annotated[BallBearing | RollerBearing, Field(discriminator="kind")]
Bearings = dict[CatalogueName, RollingBearing]


class Bearing(Spec):
    """Bearing between the bore node and the ground, the same in every direction across the axis."""

    tag: ClassVar[str] = "springs"
    stiffness: Annotated[float, Quantity("bearing_stiffness")] = entry("radial stiffness")
    axial: Annotated[float, Quantity("axial_stiffness")] | None = entry(
        "axial stiffness; without it the gear does not move along its axis (spur gears only)", None
    )
    tilt: Annotated[float, Quantity("tilt_stiffness")] | None = entry(
        "stiffness against tilting; without it the gear does not tilt (spur gears only)", None
    )
    damping_ratio: Ratio = entry("damping ratio D: c = 2 D sqrt(k m_body)", 0.03)


class RollingMount(Spec):
    """Rolling bearings in place of the springs under a gear of a pair, which are left aside where a base gives some."""

    tag: ClassVar[str] = "catalogue"
    key: ClassVar[str] = "rolling"
    rolling: CatalogueName = entry("name of a table [bearings.NAME]")
    span: Length | None = entry(
        "distance of two such bearings, mirrored, on a stiff piece of shaft; one in the middle when absent", None
    )
    carries: Side | None = entry(CARRIES, None)
    damping_ratio: Ratio = entry("damping ratio D: c = 2 D sqrt(k m_body)", 0.03)

    @model_validator(mode="before")
    @classmethod
    def _instead(cls, value: object) -> object:
        """Springs that a base gives are left aside."""
        return {k: v for k, v in value.items() if k not in SPRINGS} if isinstance(value, dict) else value


def _tag(value: object) -> str:
    """Which of both tables stands under a gear."""
    rolling = isinstance(value, RollingMount) or (isinstance(value, dict) and "rolling" in value)
    return RollingMount.tag if rolling else Bearing.tag


GearBearing = Annotated[
    Annotated[Bearing, Tag(Bearing.tag)] | Annotated[RollingMount, Tag(RollingMount.tag)], Discriminator(_tag)
]


def _check_fit(spec: BallBearing | RollerBearing, element: float | None, share: float, count: int | None) -> None:
    """Refuses rolling elements (diameter, of which `share` of D − d is proposed; count) that do not fit."""
    room = (spec.outside - spec.bore) / 2
    if room <= 0:
        raise refuse("the outside diameter is not larger than the bore: make it larger")
    if element is not None and element >= room:
        raise refuse(f"rolling elements of {element * 1e3:g} mm leave no rings in {room * 1e3:g} mm: make them smaller")
    pitch = spec.pitch_diameter or (spec.bore + spec.outside) / 2
    if not spec.bore < pitch < spec.outside:
        raise refuse("the circle of the rolling elements lies outside the rings: check pitch_diameter")
    own = element or 2 * share * room
    if count is not None and count * own > math.pi * pitch:
        raise refuse(f"{count} rolling elements of {own * 1e3:g} mm do not fit on the circle: take fewer")


Stiffness = Annotated[float, Quantity("torsional_stiffness")]
Damping = Annotated[float, Quantity("torsional_damping")]
Inertia = Annotated[float, Quantity("inertia")]
Cut = Annotated[float, Quantity("cut")]
Nodes = Annotated[Count, Whole("nodes")]
Viscosity = Annotated[float, Quantity("oil_viscosity")]
Slices = Annotated[Count, Whole("slices")]
ContactDamping = Annotated[float, Quantity("contact_damping")]
Limits: TypeAlias = tuple[tuple[float | None, str], ...]  # largest values that a stage is made for, with units


class NodalSpec(Spec):
    """Nodal contact with a penalty stiffness: flank nodes against the deformed flank of the other gear."""

    along: Nodes | None = entry(
        "nodes along a flank, equally far apart; those of the gear's own mesh, 2 flank + 1, when absent", None
    )
    across: Nodes | None = entry(
        "nodes across the common face width; those of the gear's own mesh, 2 width + 1, when absent", None
    )
    penalty: Annotated[float, Quantity("penalty", words=("hertz",))] = entry(
        'stiffness per area of flank, or "hertz": with it the contact is as wide as Hertz\'s at torque_max',
        "hertz",  # the assembly puts the stiffness in its place
    )
    nodes_of: Literal["both", "a", "b"] = entry(
        "gear whose nodes are in contact; of both each has half of the penalty", "both"
    )


class FrictionSpec(Spec):
    """Friction of the flanks along the profile."""

    law: Literal["constant", "benedict_kelley", "iso_tr_14179"] = entry(
        "law of the coefficient of friction", "constant"
    )
    coefficient: Annotated[float, Quantity("friction_coefficient")] = entry(
        "coefficient of friction of law constant", 0.05
    )
    viscosity: Viscosity = entry(
        "dynamic viscosity of the oil at the temperature of the teeth, of the other laws", 0.03
    )
    roughness: Annotated[float, Quantity("flank_roughness")] = entry(
        "mean roughness Ra of both flanks, of the other laws", 0.4e-6
    )


class FilmSpec(Spec):
    """Squeeze film of oil between flanks that approach."""

    viscosity: Viscosity = entry("dynamic viscosity of the oil at the temperature of the teeth", 0.03)
    roughness: Annotated[float, Quantity("film_roughness")] = entry(
        "oil left between flanks that touch by their roughness, added to every gap", 1e-6
    )


class ContactSpec(Spec):
    """Tooth contact."""

    slices: Slices = entry("slices across the face width", 5)
    damping: ContactDamping = entry("contact damping per metre of face width")
    law: Literal["line"] = entry("contact law", "line")
    nodal: NodalSpec = entry("nodal contact, for level paper", default_factory=NodalSpec)
    friction: FrictionSpec | None = entry("friction of the flanks; none when absent", None)
    film: FilmSpec | None = entry("squeeze film in open gaps; none when absent", None)


class ChainSpec(Spec):
    """Inertia, clutch and shaft compiled into a port."""

    inertia: Inertia = entry("inertia on the outer side of the clutch, behind the port spring")
    disc_inertia: Inertia = entry("inertia of the clutch disc")
    shaft_k: Stiffness = entry("stiffness of the shaft between disc and bore")
    shaft_c: Damping = entry("damping of that shaft")


class PortSpec(Spec):
    """How a shaft meets the outside. k and c of a port that is no spring are kept for an export that makes it one."""

    kind: Literal["spring", "torque", "fixed"] = entry(
        "spring: motion in, torque out; torque: torque in, motion out; fixed", "spring"
    )
    k: Stiffness | None = entry("stiffness of the port spring", None)
    c: Damping | None = entry("damping of the port spring", None)
    play: Annotated[float, Quantity("play")] = entry(
        "angle through which the port spring is free between both sides, as in a spline", 0.0
    )
    chain: ChainSpec | None = entry("inertia, clutch and shaft inside the FMU", None)

    @property
    def side(self) -> float:
        """Angle (rad) from the middle of the play of the port spring to either side; 0 where there is no spring."""
        return 0.5 * self.play if self.kind == "spring" else 0.0

    @property
    def no_spring(self) -> str:
        """Why the port cannot be a spring that is turned from outside, and the remedy; empty where it can."""
        if self.chain is not None:
            return "a port with a clutch is driven in a scene: use 'gearfmu run'"
        if self.kind == "fixed":
            return "a fixed port does not turn: make it a spring or torque port with k and c"
        return "" if self.k is not None and self.c is not None else "write k and c of its shaft into this table"

    @model_validator(mode="after")
    def _complete(self) -> PortSpec:
        if self.kind == "spring" and (self.k is None or self.c is None):
            raise refuse('a spring port needs k and c: add them, e.g. k = "20e3 N*m/rad", c = "0.1 N*m*s/rad"')
        if self.kind != "spring" and self.chain is not None:
            raise refuse('a chain hangs on a port spring: write kind = "spring" or leave the chain away')
        return self


class LevelSpec(Spec):
    """Cut frequencies of the fidelity levels: modes below are dynamic, the others static."""

    fast_cut: Cut = entry("cut frequency of level fast", 50e3)
    standard_cut: Cut = entry("cut frequency of level standard", 120e3)

    @model_validator(mode="after")
    def _ordered(self) -> LevelSpec:
        if self.fast_cut > self.standard_cut:
            raise refuse("fast_cut must not lie above standard_cut")
        return self


Place = Annotated[float, Quantity("place")]
RadialSpring = Annotated[float, Quantity("bearing_stiffness", words=("rigid",))]
AxialSpring = Annotated[float, Quantity("axial_stiffness", words=("rigid",))]
TiltSpring = Annotated[float, Quantity("tilt_stiffness", words=("rigid",))]


DIRECTIONS = {"radial": (0, 1), "axial": (2,), "tilt": (3, 4), "torsion": (5,)}  # of x, y, z, rx, ry, rz


class SupportSpec(LaterFields):
    """A spring between a body and the ground, or two bodies: a bearing, a seat. Directions without stiffness are
    free. A rolling bearing has its own stiffness."""

    later = ("bearing", "span", "carries")

    name: Name = entry("name of the support")
    body: Name = entry("body that is held")
    to: Name | None = entry("body that holds it; the ground when absent", None)
    at: Place | None = entry("place along the axis; a gear's mid-width when absent", None)
    node: Name | None = entry("node of a carrier: bore, bolt0, bolt1 …; of a housing: name of a seat or foot", None)
    radial: RadialSpring | None = entry("stiffness along x and y", None)
    axial: AxialSpring | None = entry("stiffness along the axis", None)
    tilt: TiltSpring | None = entry("stiffness against tilting about x and y", None)
    torsion: TiltSpring | None = entry("stiffness against twist; between bodies of one rotor", None)
    bearing: CatalogueName | None = entry(
        "rolling bearing in place of the stiffnesses: name of a table [bearings.NAME]", None
    )
    span: Length | None = entry(
        "distance of two such bearings, mirrored, on a stiff piece of shaft; one when absent", None
    )
    carries: Side | None = entry(CARRIES, None)
    damping_ratio: Ratio = entry(
        "damping ratio D: c = 2 D sqrt(k m), m: mass of the rotor, or its moment of inertia", 0.03
    )

    @model_validator(mode="after")
    def _holds(self) -> SupportSpec:
        if all(value is None for value in (self.radial, self.axial, self.tilt, self.torsion, self.bearing)):
            raise refuse('a support needs a stiffness: radial, axial, tilt or torsion, e.g. radial = "3e8 N/m"')
        return self


class Misalignment(Spec):
    """Parallelism errors of the axes of the unloaded pair (ISO/TR 10064-3), of the wheel's axis seen from the pinion's.

    In the frame of the stage: pinion's axis z, wheel on +x; errors count from the end at −z to that at +z.
    """

    out_of_plane: Parallelism = entry(
        "f_SigmaBeta, deviation out of the common plane of the axes over the span; positive: at its +z end "
        "the wheel's axis lies further towards +y",
        0.0,
    )
    in_plane: Parallelism = entry(
        "f_SigmaDelta, deviation in the common plane over the span; positive: the centre distance grows towards +z", 0.0
    )
    span: Length = entry("length L along the axes over which both are measured (bearing span)")

    @model_validator(mode="after")
    def _nearly_parallel(self) -> Misalignment:
        most = kernel_limits()["TILT"][1]
        tilt = math.hypot(self.out_of_plane, self.in_plane) / self.span
        if tilt > most:
            raise refuse(f"the axes tilt by {tilt:.3g} rad, at most {most:g} rad: smaller deviations or a longer span")
        return self
