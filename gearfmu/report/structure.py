"""Shafts and carriers in the turning view: surfaces of revolution of the stage's own measures, drawn rigid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearfmu.geometry.plane import direction
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.tables.bodies import ShaftBody
from gearfmu.stagefile.tables.housing import HousingBody

AROUND = 40  # sectors of a surface of revolution
Profile = Sequence[tuple[float, float]]


def shaft_profile(shaft: ShaftBody) -> list[tuple[float, float]]:
    """Radius and z (m), closed: outside of the cylinders from the shaft's place in +z, then back along the bores."""
    ends = np.concatenate([[0.0], np.cumsum([section.length for section in shaft.sections])])
    outside, inside = [], []
    for low, high, section in zip(ends[:-1], ends[1:], shaft.sections, strict=True):
        outside += [(0.5 * section.outer_diameter, float(low)), (0.5 * section.outer_diameter, float(high))]
        inside += [(0.5 * section.bore_diameter, float(low)), (0.5 * section.bore_diameter, float(high))]
    return [*outside, *inside[::-1], outside[0]]


def carrier_profiles(carrier: CarrierBody, width: float) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Radius and z (m) of the plate about the carrier's axis and of a bolt about its own; width: of the planets."""
    high = -0.5 * width - carrier.gap
    low, inner, outer = high - carrier.thickness, 0.5 * carrier.bore_diameter, 0.5 * carrier.outer_diameter
    plate = [(inner, low), (outer, low), (outer, high), (inner, high), (inner, low)]
    radius = 0.5 * carrier.bolt_diameter
    return plate, [(radius, high), (radius, 0.5 * width), (0.0, 0.5 * width)]


def turned(profile: Profile) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The surface of a profile (P of radius and z) in AROUND equal sectors: points (AROUND·P, 3) m; quads (P − 1, 4) of
    the first sector by its points; whether each point is the next sector's."""
    radius, z = np.array(profile, dtype=float).T
    angle = np.repeat(np.arange(AROUND) * 2 * np.pi / AROUND, radius.size)
    points = np.column_stack([direction(angle) * np.tile(radius, AROUND)[:, None], np.tile(z, AROUND)])
    first = np.arange(radius.size - 1)
    quads = np.stack([first, first + 1, first + 1, first], axis=1)
    ahead = np.tile(np.array([0, 0, 1, 1], np.int8), (radius.size - 1, 1))
    return points, quads, ahead


def parts(stage: Stage) -> list[tuple[str, str, Profile, tuple[float, float], float]]:
    """Shafts and carriers of a stage: name, rotor with which it turns, profile, axis (x, y) in that rotor's axes, and z
    (m). A carrier is its plate and a bolt for each rotor that it carries beside its middle."""
    found: list[tuple[str, str, Profile, tuple[float, float], float]] = []
    for name, body in stage.bodies.items():
        if isinstance(body, HousingBody):
            continue
        rotor = stage.rotor_of(name)
        place = float(stage.rotors[rotor].bodies[name])
        if isinstance(body, ShaftBody):
            found.append((name, rotor, shaft_profile(body), (0.0, 0.0), place))
        if isinstance(body, CarrierBody):
            carried = [own for own in stage.rotors.values() if own.carried_by == rotor and any(own.axis)]
            widths = [gear.face_width for own in carried for gear in stage.gears if gear.name in own.bodies]
            plate, bolt = carrier_profiles(body, max(widths, default=0.0))
            found.append((name, rotor, plate, (0.0, 0.0), place))
            axes = [(float(own.axis[0] + own.offset[0]), float(own.axis[1] + own.offset[1])) for own in carried]
            found += [(f"{name} bolt {k + 1}", rotor, bolt, axis, place) for k, axis in enumerate(axes)]
    return found
