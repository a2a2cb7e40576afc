"""What a stage file says about teeth that are not nominal: modifications of the flanks, measured and drawn deviations,
and a toothing that does not run true.

All of it belongs to the stage and shapes no body: the finite elements have nominal flanks. Amounts are lengths in the
transverse section normal to the involute. A *relief* and a *crowning* take material away and are positive; a
*deviation* is positive where there is more material than nominal (ISO 1328-1:2013, ISO 21771:2007).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, cast

from pydantic import ConfigDict, Field, field_validator

from gearfmu.stagefile.reading.base import Count, Quantity, Spec, Switch, Text, Whole
from gearfmu.stagefile.tables.lead import Depth, LeadSpec, ReliefKind, Slope

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
