"""Bearings of a stage file: springs under a gear, or rolling bearings by their catalogue numbers (SI floats)."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Discriminator, Field, SerializerFunctionWrapHandler, Strict, Tag, model_serializer, model_validator

from gearfmu.stagefile.reading.base import Count, Quantity, Spec, Whole, refuse
from gearfmu.stagefile.tables.lead import Length

CatalogueName = Annotated[str, Strict(), Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,39}$")]
Clearance = Annotated[float, Quantity("bearing_clearance")]
ContactAngle = Annotated[float, Quantity("contact_angle")]
Preload = Annotated[float, Quantity("preload")]
Groove = Annotated[float, Quantity("groove")]
Diameter = Annotated[float, Quantity("diameter")]
Ratio = Annotated[float, Quantity("damping_ratio")]
Side = Literal["+z", "-z"]
SPRINGS = ("stiffness", "axial", "tilt")  # of a Bearing


class LaterFields(Spec):
    """A table whose fields named in `later` are left out of its dump where they say nothing: a file without them is
    what it was before they were known."""

    later: ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _said(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        tables: dict[str, object] = handler(self)
        return {key: value for key, value in tables.items() if key not in self.later or value not in (None, {}, (), [])}


class OperatingSpec(Spec):
    """The load at which bearings are linearised."""

    torque: Annotated[float, Quantity("torque")] = Field(description="torque on the input")


class BallBearing(Spec):
    """Deep groove or angular contact ball bearing. What a catalogue does not print is proposed when it is absent."""

    kind: Literal["ball"] = Field(description="kind of bearing")
    bore: Diameter = Field(description="bore d")
    outside: Diameter = Field(description="outside diameter D")
    balls: Annotated[Count, Whole("rolling_elements")] | None = Field(default=None, description="number of balls")
    ball_diameter: Diameter | None = Field(default=None, description="diameter of the balls, 0.3 (D - d) when absent")
    pitch_diameter: Diameter | None = Field(default=None, description="diameter of their circle, (d + D)/2 when absent")
    inner_groove: Groove | None = Field(
        default=None, description="radius of the inner groove over the ball's diameter, 0.52 when absent"
    )
    outer_groove: Groove | None = Field(default=None, description="of the outer groove, 0.53 when absent")
    contact_angle: ContactAngle = Field(default=0.0, description="contact angle; 0 deg: deep groove")
    clearance: Clearance = Field(default=0.0, description="radial clearance in operation; negative: interference")
    preload: Preload = Field(default=0.0, description="axial force that presses the rings together without load")

    @model_validator(mode="after")
    def _fits(self) -> BallBearing:
        _check_fit(self, self.ball_diameter, 0.3, self.balls)
        return self


class RollerBearing(Spec):
    """Cylindrical roller bearing, free along its axis, or with a contact angle a tapered one."""

    kind: Literal["roller"] = Field(description="kind of bearing")
    bore: Diameter = Field(description="bore d")
    outside: Diameter = Field(description="outside diameter D")
    width: Length | None = Field(default=None, description="width B; needed where roller_length is absent")
    rollers: Annotated[Count, Whole("rolling_elements")] | None = Field(default=None, description="number of rollers")
    roller_diameter: Diameter | None = Field(
        default=None, description="diameter of the rollers, 0.27 (D - d) when absent"
    )
    roller_length: Length | None = Field(
        default=None, description="length of the rollers without chamfers, 0.65 B when absent"
    )
    pitch_diameter: Diameter | None = Field(default=None, description="diameter of their circle, (d + D)/2 when absent")
    contact_angle: ContactAngle = Field(default=0.0, description="contact angle of the taper; 0 deg: cylindrical")
    clearance: Clearance = Field(default=0.0, description="radial clearance in operation; negative: interference")
    preload: Preload = Field(
        default=0.0, description="axial force that presses the rings of a tapered bearing together without load"
    )

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
    stiffness: Annotated[float, Quantity("bearing_stiffness")] = Field(description="radial stiffness")
    axial: Annotated[float, Quantity("axial_stiffness")] | None = Field(
        default=None, description="axial stiffness; without it the gear does not move along its axis (spur gears only)"
    )
    tilt: Annotated[float, Quantity("tilt_stiffness")] | None = Field(
        default=None, description="stiffness against tilting; without it the gear does not tilt (spur gears only)"
    )
    damping_ratio: Ratio = Field(default=0.03, description="damping ratio D: c = 2 D sqrt(k m_body)")


class RollingMount(Spec):
    """Rolling bearings in place of the springs under a gear of a pair, which are left aside where a base gives some."""

    tag: ClassVar[str] = "catalogue"
    key: ClassVar[str] = "rolling"
    rolling: CatalogueName = Field(description="name of a table [bearings.NAME]")
    span: Length | None = Field(
        default=None,
        description="distance of two such bearings, mirrored, on a stiff piece of shaft; one in the middle when absent",
    )
    carries: Side | None = Field(
        default=None,
        description="axial force of the shaft that an angular contact bearing (of two the left) carries",
    )
    damping_ratio: Ratio = Field(default=0.03, description="damping ratio D: c = 2 D sqrt(k m_body)")

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
