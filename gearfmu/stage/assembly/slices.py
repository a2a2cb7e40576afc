"""What width functions make of the load of a slice near it (docs/theory.md, eq. 8g′).

The body's tables know a load across the width by a few polynomials at one length of roll, so a slice's load is smeared
over much of the width. Near the load a flank is a half-space. There the mean of 1/distance between two smeared loads is
known; the kernel puts that of the slices themselves in its place."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from gearfmu.stagefile.forms.general import RingBody
from gearfmu.stagefile.forms.shapes import GearShape
from gearfmu.stagefile.tables.gear import GearSpec

ROLLS, DISTANCES = 9, 17  # places of the table: mean length of roll, distance of the slices
POINTS = (40, 56)  # of quadrature across the width; unlike, so that no two coincide where 1/r is infinite
GRADED = 40  # of quadrature over the distance along the line, dense as its cube where 1/r is infinite


def smeared(gear: GearSpec | RingBody, shape: GearShape, degrees: np.ndarray) -> np.ndarray:
    """The section "smeared" of a gear: (ROLLS, DISTANCES, A, A) 1/m for the Legendre degrees (A,), at lengths of roll
    from s_form to s_tip and distances across the width from 0 to the face width."""
    arcs = np.linspace(shape.s_form, shape.s_tip, ROLLS) / shape.r_b
    known = (gear.face_width, gear.body.strip_half_width, shape.beta_b, tuple(arcs.tolist()), tuple(degrees.tolist()))
    return _between(*known)


def smeared_tip(gear: GearSpec | RingBody, shape: GearShape, degrees: np.ndarray) -> np.ndarray:
    """The section "smeared_tip": (DISTANCES, A, A) 1/m to mirror images beyond the tip edge, at distances along the
    profile that are squares of even steps, up to twice the length of the flank's profile."""
    profile = abs(shape.s_tip**2 - shape.s_form**2) / (2 * shape.r_b)
    z, first, z2, second = _quadrature(gear.face_width, degrees)
    away = (z[:, None] - z2) / math.cos(shape.beta_b)
    across = 2 * profile * np.linspace(0.0, 1.0, DISTANCES) ** 2
    strip = gear.body.strip_half_width
    return _turned_alike(np.array([first.T @ _of_strips(away, y, strip) @ second for y in across]), degrees)


@lru_cache(maxsize=64)
def _between(width: float, strip: float, helix: float, arcs: tuple[float, ...], degrees: tuple[int, ...]) -> np.ndarray:
    """`between_functions`, kept: the same gear is assembled again and again, in sweeps and beside its equals."""
    found = between_functions(width, strip, helix, np.array(arcs), np.array(degrees))
    found.flags.writeable = False
    return found


def between_functions(width: float, strip: float, helix: float, arcs: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Mean of 1/distance (1/m) between the loads of two width functions, with both end faces as mirrors.

    Two lines of constant roll, whose places on the line of contact are some distance apart across the width, carry the
    densities P_a and P_b, uniform over ±strip along the profile.

    width, strip: face width and half-width of the load strip, m. helix: signed base helix angle, rad. arcs: (R,) length
    of profile per length of roll. degrees: (A,). Returns (R, DISTANCES, A, A) at distances from 0 to `width`; the place
    of higher z has the first function.
    """
    z, first, z2, second = _quadrature(width, degrees)
    away, mirrored = z[:, None] - z2, np.stack([z[:, None] + z2 - width, z[:, None] + z2 + width]) / math.cos(helix)
    apart, weight = _graded(width)
    shared = weight[:, None, None] * _correlation(width, apart, degrees)
    result = np.empty((len(arcs), DISTANCES, len(degrees), len(degrees)))
    for r, slope in enumerate(arcs * math.tan(helix)):
        for d, distance in enumerate(np.linspace(0.0, width, DISTANCES)):
            mean = _of_strips(apart / math.cos(helix), slope * (distance - apart), strip)
            images = _of_strips(mirrored, slope * (distance - away), strip).sum(axis=0)
            result[r, d] = np.tensordot(mean, shared, 1) + first.T @ images @ second
    return _turned_alike(result, degrees)


def _turned_alike(table: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Half a turn exchanges both places and their functions; quadrature alone does not keep this to the last bit."""
    sign = (-1.0) ** degrees
    return (table + np.swapaxes(table, -1, -2) * sign[:, None] * sign) / 2


def _graded(width: float) -> tuple[np.ndarray, np.ndarray]:
    """Distances from −width to width and weights of quadrature, for functions that are infinite as a logarithm at 0."""
    x, weight = leggauss(GRADED)
    u = (x + 1) / 2
    distance, weight = width * u**3, 3 * width * u**2 * weight / 2
    return np.concatenate([-distance[::-1], distance]), np.concatenate([weight[::-1], weight])


def _correlation(width: float, apart: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """(n, A, A) 1/m: ∫ P_a(2z/b) P_b(2(z − apart)/b) dz/b² over the z at which both places are on the width."""
    highest = int(degrees.max())
    x, weight = leggauss(highest + 1)
    length, middle = width - np.abs(apart[:, None]), apart[:, None] / 2
    z = middle + length / 2 * x
    first, second = (legvander(2 * place / width, highest)[..., degrees] for place in (z, z - apart[:, None]))
    return np.einsum("nq,nqa,nqb->nab", length / 2 * weight / width**2, first, second)


def _quadrature(width: float, degrees: np.ndarray) -> tuple[np.ndarray, ...]:
    """Places across the width and densities there times weights of quadrature, (n,) and (n, A), for two loads."""
    result: list[np.ndarray] = []
    for count in POINTS:
        x, weight = leggauss(count)
        result += [width / 2 * x, legvander(x, int(degrees.max()))[:, degrees] * weight[:, None] / 2]
    return tuple(result)


def _of_strips(x: np.ndarray, y: np.ndarray | float, strip: float) -> np.ndarray:
    """Mean of 1/√(x² + (y + t)²) over the t between two points of ±strip: a second difference."""

    def twice(v: np.ndarray | float) -> np.ndarray:
        return v * np.arcsinh(v / np.abs(x)) - np.hypot(x, v)

    return (twice(y + 2 * strip) - 2 * twice(y) + twice(y - 2 * strip)) / (4 * strip**2)
