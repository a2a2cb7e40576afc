"""Transverse sections of gears from nothing but their outlines: area and polar moment of a sector, tip edges sharp."""

from __future__ import annotations

import math

import numpy as np

from gearfmu.geometry.gear import GearGeometry, InternalGearGeometry
from gearfmu.geometry.mesh import CarrierGeometry


def half_outline(gear: GearGeometry | InternalGearGeometry, intervals: int = 32) -> np.ndarray:
    """(P, 2) m, half a sector, from the middle of the space to the middle of the tooth: root land, root, flank, tip
    land, so many chords each."""
    along = np.linspace(0, 1, intervals + 1)
    if isinstance(gear, InternalGearGeometry):
        land, tip = gear.fillet_centre[1] * along, gear.half_pitch - gear.tip_half_angle * along[::-1]
        root = gear.fillet_point(1 - along)
    else:
        land, tip = gear.half_pitch - gear.rounding.land_angle * along, gear.tip_half_angle * along[::-1]
        root = gear.rounding.point(math.pi / 2 + (gear.form_angle - math.pi / 2) * along)
    flank = gear.flank_point(gear.s_form + (gear.s_a - gear.s_form) * along)
    arcs = [r * np.stack([np.cos(angle), np.sin(angle)], 1) for r, angle in ((gear.r_f, land), (gear.r_a, tip))]
    return np.concatenate([arcs[0], root, flank, arcs[1]])


def section(gear: GearGeometry | InternalGearGeometry) -> tuple[float, float]:
    """Area (m²) and polar moment (m⁴) of a tooth with half a space on either side, down to the bore or up to the rim;
    polygons of the outline, whose error is of second order in the chords, extrapolated."""
    coarse, fine = (2 * polygon_moments(half_outline(gear, count)) for count in (400, 800))
    area, polar = (4 * fine - coarse) / 3
    internal = isinstance(gear, InternalGearGeometry)
    r, sign = (gear.r_rim, -1) if internal else (gear.r_bore, 1)
    return sign * (area - gear.half_pitch * r**2), sign * (polar - 0.5 * gear.half_pitch * r**4)


def polygon_moments(points: np.ndarray) -> np.ndarray:
    """Area and polar moment (2,) about the origin of a polygon that is closed through the origin."""
    (x, y), (x1, y1) = points[:-1].T, points[1:].T
    cross = x * y1 - x1 * y
    polar = cross * (x * x + x * x1 + x1 * x1 + y * y + y * y1 + y1 * y1)
    return np.abs([cross.sum() / 2, polar.sum() / 12])


def carrier_moments(carrier: CarrierGeometry) -> tuple[float, float]:
    """z of the centre of mass, m, and polar moment about the axis, m⁵, of a plate and its bolts (Steiner)."""
    plate = math.pi * (carrier.r_o**2 - carrier.r_bore**2) * carrier.thickness
    bolts = carrier.planets * math.pi * carrier.r_bolt**2 * (carrier.gap + carrier.seat)
    centre = (plate * carrier.bore_centre[2] - bolts * carrier.gap / 2) / (plate + bolts)
    polar = plate * (carrier.r_o**2 + carrier.r_bore**2) / 2 + bolts * (carrier.r_bolt**2 / 2 + carrier.a**2)
    return centre, polar
