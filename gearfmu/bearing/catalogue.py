"""What a catalogue does not print: rolling elements, proposed from bore, outside diameter and width.

Deep groove: D_w = 0.3 (D − d), D_pw = ½ (d + D), and as many balls as fill 186° of the circle when the bearing is put
together (Conrad assembly). Angular contact and cylindrical roller bearings are filled through a shoulder and hold more.
On four common deep groove bearings the number of balls is exact, stiffness within 1 %, tilting stiffness within 5 %
(docs/theory.md, 10).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from gearfmu.bearing.law import Balls, Law, Rollers

GROOVES = (0.52, 0.53)  # radii of inner and outer groove over the ball's diameter
_FILLED = math.radians(186)  # of the circle, by balls that are put in between eccentric rings
_CAGED = {"balls": 0.87, "rollers": 0.8}  # share of the pitch circle that rolling elements fill beside the cage


@dataclass(frozen=True)
class Filled:
    """A law with all its numbers. proposed: names of those that no one has given, in the terms of a stage file."""

    law: Law
    proposed: tuple[str, ...]


def filled_ball(bore: float, outside: float, known: Mapping[str, float | int | None], **fixed: float) -> Filled:
    """A ball bearing of that bore and outside diameter, m. known: balls, ball_diameter, pitch_diameter, inner_groove,
    outer_groove (over the ball's diameter), None where unknown; fixed: contact_angle, rad, and clearance, m."""
    given = {name: value for name, value in known.items() if value is not None}
    diameter = given.get("ball_diameter", 0.3 * (outside - bore))
    pitch = given.get("pitch_diameter", 0.5 * (bore + outside))
    share = math.asin(min(diameter / pitch, 1.0))
    angular = fixed.get("contact_angle", 0.0) > 0.0
    count = math.floor(_CAGED["balls"] * math.pi / share) if angular else 1 + round(_FILLED / (2 * share))
    grooves = given.get("inner_groove", GROOVES[0]), given.get("outer_groove", GROOVES[1])
    law = Balls(int(given.get("balls", count)), diameter, pitch, grooves, **fixed)
    return Filled(law, tuple(name for name in known if name not in given))


def filled_roller(bore: float, outside: float, known: Mapping[str, float | int | None], **fixed: float) -> Filled:
    """A cylindrical or tapered roller bearing of that bore and outside diameter, m. known: rollers, roller_diameter,
    roller_length, pitch_diameter, None where unknown, and the width of the bearing; fixed: contact_angle, rad, and
    clearance, m."""
    given = {name: value for name, value in known.items() if value is not None}
    diameter = given.get("roller_diameter", 0.27 * (outside - bore))
    pitch = given.get("pitch_diameter", 0.5 * (bore + outside))
    count = math.floor(_CAGED["rollers"] * math.pi / math.asin(min(diameter / pitch, 1.0)))
    length = given.get("roller_length", 0.65 * given.get("width", 0.0))
    law = Rollers(int(given.get("rollers", count)), diameter, pitch, length, **fixed)
    return Filled(law, tuple(name for name in known if name not in given and name != "width"))
