"""What width functions make of the load of a slice near it (docs/theory.md, eq. 8h).

The body's tables know a load across the width by a few polynomials at one length of roll, so a slice's load is smeared
over much of the width. Near the load a flank is a half-space. There the mean of 1/distance between two smeared loads is
known; the kernel puts that of the slices themselves in its place."""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from gearfmu.spec.forms.general import RingBody
from gearfmu.spec.forms.shapes import GearShape
from gearfmu.spec.tables.gear import GearSpec

ROLLS, DISTANCES = 9, 17  # places of the table: mean length of roll, distance of the slices
POINTS = (40, 56)  # of quadrature across the width; unlike, so that no two coincide where 1/r is infinite


def smeared(gear: GearSpec | RingBody, shape: GearShape, degrees: np.ndarray) -> np.ndarray:
    """The section "smeared" of a gear: (ROLLS, DISTANCES, A, A) 1/m for the Legendre degrees (A,), at lengths of roll
    from s_form to s_tip and distances across the width from 0 to the face width."""
    arcs = np.linspace(shape.s_form, shape.s_tip, ROLLS) / shape.r_b
    return between_functions(gear.face_width, gear.body.strip_half_width, shape.beta_b, arcs, degrees)


def between_functions(width: float, strip: float, helix: float, arcs: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Mean of 1/distance (1/m) between the loads of two width functions, with both end faces as mirrors.

    Two lines of constant roll, whose places on the line of contact are some distance apart across the width, carry the
    densities P_a and P_b, uniform over ±strip along the profile.

    width, strip: face width and half-width of the load strip, m. helix: signed base helix angle, rad. arcs: (R,) length
    of profile per length of roll. degrees: (A,). Returns (R, DISTANCES, A, A) at distances from 0 to `width`; the place
    of higher z has the first function.
    """
    (z, weight), (z2, weight2) = ((width / 2 * x, w / 2) for x, w in map(leggauss, POINTS))
    highest = int(degrees.max())
    first = legvander(2 * z / width, highest)[:, degrees] * weight[:, None]
    second = legvander(2 * z2 / width, highest)[:, degrees] * weight2[:, None]
    away, mirrored = z[:, None] - z2, z[:, None] + z2
    result = np.empty((len(arcs), DISTANCES, len(degrees), len(degrees)))
    for r, slope in enumerate(arcs * math.tan(helix)):
        for d, apart in enumerate(np.linspace(0.0, width, DISTANCES)):
            across = slope * (apart - away)
            along = np.stack([away, mirrored - width, mirrored + width]) / math.cos(helix)
            result[r, d] = first.T @ _of_strips(along, across, strip).sum(axis=0) @ second
    return result


def _of_strips(x: np.ndarray, y: np.ndarray, strip: float) -> np.ndarray:
    """Mean of 1/√(x² + (y + t)²) over the t between two points of ±strip: a second difference."""

    def twice(v: np.ndarray) -> np.ndarray:
        return v * np.arcsinh(v / np.abs(x)) - np.hypot(x, v)

    return (twice(y + 2 * strip) - 2 * twice(y) + twice(y - 2 * strip)) / (4 * strip**2)
