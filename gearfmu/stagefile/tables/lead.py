"""What a stage file says about the shape of flanks across the face width and about axes that are not parallel.

Both belong to the stage and shape no body: the finite elements have nominal flanks on nominal axes. Depths are normal
to the transverse involute, like those of a tip relief.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from gearfmu.ranges import kernel_limits
from gearfmu.stagefile.reading.base import Quantity, Spec, refuse

Depth = Annotated[float, Quantity("flank_depth")]
Length = Annotated[float, Quantity("length")]
Slope = Annotated[float, Quantity("flank_slope")]
Parallelism = Annotated[float, Quantity("misalignment")]
# "quadratic" is what files of before 0.2 call a parabola
ReliefKind = Annotated[
    Literal["linear", "parabolic", "arc"], BeforeValidator(lambda kind: "parabolic" if kind == "quadratic" else kind)
]


class EndRelief(Spec):
    """Material taken off towards both ends of the face width."""

    amount: Depth = Field(description="end relief at either end of the face width, normal to the involute")
    length: Length = Field(description="length from either end over which it fades to nothing")
    kind: ReliefKind = Field(default="parabolic", description="shape over that length")


class LeadSpec(Spec):
    """Flank modifications across the face width, on both flanks of every tooth (ISO 21771)."""

    slope: Slope = Field(
        default=0.0,
        description="helix slope f_Hbeta over the whole face width, normal to the involute; positive: both flanks are "
        "turned like a right-hand helix (of a left-handed gear ISO 1328-1 counts it the other way)",
    )
    crowning: Depth = Field(
        default=0.0, description="lead crowning C_beta: depth at both ends of the face width, none at its middle"
    )
    end_relief: EndRelief | None = Field(default=None, description="end relief; none when the table is absent")


class Misalignment(Spec):
    """Parallelism errors of the axes of the unloaded pair (ISO/TR 10064-3), of the wheel's axis seen from the pinion's.

    In the frame of the stage: pinion's axis z, wheel on +x; errors count from the end at −z to that at +z.
    """

    out_of_plane: Parallelism = Field(
        default=0.0,
        description="f_SigmaBeta, deviation out of the common plane of the axes over the span; positive: at its +z end "
        "the wheel's axis lies further towards +y",
    )
    in_plane: Parallelism = Field(
        default=0.0,
        description="f_SigmaDelta, deviation in the common plane over the span; positive: the centre distance grows "
        "towards +z",
    )
    span: Length = Field(description="length L along the axes over which both are measured (bearing span)")

    @model_validator(mode="after")
    def _nearly_parallel(self) -> Misalignment:
        most = kernel_limits()["TILT"][1]
        tilt = math.hypot(self.out_of_plane, self.in_plane) / self.span
        if tilt > most:
            raise refuse(f"the axes tilt by {tilt:.3g} rad, at most {most:g} rad: smaller deviations or a longer span")
        return self
