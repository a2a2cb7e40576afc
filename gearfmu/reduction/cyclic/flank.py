"""Tooth loads: unit forces on a strip of the flank, and the displacement read back with the same weights.

The load of roll point s, width function a has the density (1/b) P_a(2z/b) across the face width and 1/L along the
involute's arc length σ = s²/(2 r_b), over the strip |σ − σ(s)| ≤ w clipped at form circle and tip (L: the length that
is left). It acts along the outward normal of the analytic flank, or along the profile. A helical flank is the same
involute in every transverse section, turned by z·twist. Roll, strip and profile direction are those of the section at
z, and the normal has an axial component,
    n = cos β_b n_t(s, z) − sg sin β_b e_z,     e_p = e_r(t) turned by z·twist    (β_b > 0: right-handed),
and the opposite one on the flanks of a ring.
e_p points to growing roll, lies in the transverse plane and in the flank, square to n: the direction in which flanks of
gears on parallel axes slide on each other. Integration runs over the quadratic surface elements, split exactly where
the strip begins and ends: rows are smooth in s. Its variable is the roll (dσ = s ds/r_b), in which positions and
normals are smooth down to the base circle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.fem import surface
from gearfmu.geometry import involute
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.stagefile.forms.shapes import GearShape

_GAUSS_ROLL = np.polynomial.legendre.leggauss(6)
_GAUSS_WIDTH = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True)
class ToothFlank:
    """The involute flanks of tooth 0 and their load strips (m, rad): base radius, half tooth-thickness angle at the
    base circle (of the space for an internal gear), form and tip roll, face width, half-width of the strip in arc
    length. An internal gear's form roll is its larger one, and its normals point the other way. base_helix_angle: β_b,
    positive for a right-handed gear."""

    r_b: float
    psi_b: float
    s_form: float
    s_tip: float
    face_width: float
    strip_half_width: float
    internal: bool = False
    base_helix_angle: float = 0.0

    @property
    def roll_range(self) -> tuple[float, float]:
        """Smallest and largest roll of the flank, m."""
        return min(self.s_form, self.s_tip), max(self.s_form, self.s_tip)

    def radii(self, slack: float = 0.0) -> tuple[float, float]:
        """Smallest and largest radius (m) of the flank, `slack` (m) of roll wider."""
        low, high = self.roll_range
        smallest, largest = involute.radius_at_roll(np.array([low - slack, high + slack]), self.r_b)
        return float(smallest), float(largest)

    def strip(self, rolls: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Clipped strips: roll points (R,), m → first and last arc length (R,), m."""
        arc, low, high = (np.square(s) / (2 * self.r_b) for s in (np.asarray(rolls, float), *self.roll_range))
        return np.clip(arc - self.strip_half_width, low, high), np.clip(arc + self.strip_half_width, low, high)

    def normal(self, roll: np.ndarray, side: int, z: np.ndarray | float = 0.0) -> np.ndarray:
        """Unit normals (…, 3) out of the material of flank index `side` (0 ↔ sg = +1) at roll (…) and face-width
        coordinate z (m, to be broadcast with the roll; of no influence on a spur gear)."""
        sg, outwards = 1 - 2 * side, -1 if self.internal else 1
        plane = outwards * involute.flank_normal(roll, self.r_b, self.psi_b, sg)
        turned = self._turned(np.cos(self.base_helix_angle) * plane, z)
        if self.base_helix_angle:
            turned[..., 2] = -outwards * sg * np.sin(self.base_helix_angle)
        return turned

    def tangent(self, roll: np.ndarray, side: int, z: np.ndarray | float = 0.0) -> np.ndarray:
        """Unit vectors e_p (…, 3) along the profile towards growing roll, arguments as of `normal`."""
        return self._turned(involute.flank_tangent(roll, self.r_b, self.psi_b, 1 - 2 * side), z)

    def _turned(self, plane: np.ndarray, z: np.ndarray | float) -> np.ndarray:
        """Plane vectors (…, 2) of the mid-width section as vectors (…, 3) of the section at z."""
        if not self.base_helix_angle:
            return np.concatenate([plane, np.zeros((*plane.shape[:-1], 1))], axis=-1)
        angle = np.tan(self.base_helix_angle) / self.r_b * np.asarray(z, float)
        c, s, x, y = np.broadcast_arrays(np.cos(angle), np.sin(angle), plane[..., 0], plane[..., 1])
        return np.stack([c * x - s * y, s * x + c * y, np.zeros(x.shape)], axis=-1)

    def chebyshev_rolls(self, count: int) -> np.ndarray:
        """Chebyshev points of the first kind on the flank, ascending: (count,), m."""
        x = -np.cos(np.pi * (2 * np.arange(count) + 1) / (2 * count))
        low, high = self.roll_range
        return 0.5 * (low + high) + 0.5 * (high - low) * x


@dataclass(frozen=True)
class Points:
    """Where the flank is loaded: roll points (R,), m, and the number A of width functions P_0 … P_{A−1}."""

    rolls: np.ndarray
    functions: int


def tooth_flank(geometry: GearShape, gear: Any) -> tuple[ToothFlank, Points]:
    """Flank and load points of a gear: its geometry, and what a table says about it (face_width, body)."""
    flank = ToothFlank(
        geometry.r_b, geometry.psi_b, geometry.s_form, geometry.s_tip, gear.face_width, gear.body.strip_half_width,
        isinstance(geometry, InternalGearGeometry), geometry.beta_b,
    )  # fmt: skip
    return flank, Points(flank.chebyshev_rolls(gear.body.roll_points), gear.body.width_functions)


Direction = Callable[[np.ndarray, int, np.ndarray], np.ndarray]


def flank_loads(
    nodes: np.ndarray,
    quads: np.ndarray,
    flank: ToothFlank,
    side: int,
    points: Points,
    direction: Direction | None = None,
) -> np.ndarray:
    """Nodal forces of the unit loads: (R, A, 3N), N.

    nodes (N, 3); quads (Q, 8): the flank's surface elements, bounded by lines of constant roll and constant z, which
    cover it from form circle to tip over the face width, as those of our own meshes do.
    direction : unit vectors of roll, side and z, `flank.normal` when None. Read as rows, the same numbers give the
    load-weighted mean displacement along that direction.
    """
    patch = _Patch.of(nodes, quads, flank)
    first, last = flank.strip(points.rolls)
    low = np.maximum(first[:, None], patch.arc[:, 0])
    high = np.maximum(np.minimum(last[:, None], patch.arc[:, 2]), low)
    start, end = np.sqrt(2 * flank.r_b * low), np.sqrt(2 * flank.r_b * high)
    half = 0.5 * (end - start)[..., None]
    roll = 0.5 * (start + end)[..., None] + half * _GAUSS_ROLL[0]
    xi = patch.natural(roll**2 / (2 * flank.r_b))
    along = half * _GAUSS_ROLL[1] * roll / flank.r_b / (last - first)[:, None, None]
    vectors = (direction or flank.normal)(roll[..., None], side, patch.z()[:, None])
    across = _width_weights(patch.width, flank.face_width, points.functions)
    grid = np.stack(np.broadcast_arrays(xi[..., None], _GAUSS_WIDTH[0]), axis=-1)
    values = surface.shape(grid.reshape(-1, 2)).reshape(*grid.shape[:-1], 8)
    if vectors.shape[-2] == 1:  # the same across the width
        per_node = np.einsum("rqg,rqgc,qah,rqghn->raqnc", along, vectors[..., 0, :], across, values, optimize=True)
    else:
        per_node = np.einsum("rqg,rqghc,qah,rqghn->raqnc", along, vectors, across, values, optimize=True)
    loads = np.zeros((len(points.rolls), points.functions, len(nodes), 3))
    places: Any = (slice(None), slice(None), patch.quads)  # numpy's types know no slices here
    np.add.at(loads, places, per_node)
    return loads.reshape(len(points.rolls), points.functions, -1)


@dataclass(frozen=True)
class _Patch:
    """Flank elements turned so that the first natural coordinate runs with the roll: quads (Q, 8), arc length (Q, 3)
    and z (Q, 3) at natural −1, 0, 1."""

    quads: np.ndarray
    arc: np.ndarray
    width: np.ndarray

    @staticmethod
    def of(nodes: np.ndarray, quads: np.ndarray, flank: ToothFlank) -> _Patch:
        radius = np.hypot(nodes[:, 0], nodes[:, 1])
        arc = np.maximum(radius**2 - flank.r_b**2, 0.0) / (2 * flank.r_b)
        quads = np.array([_with_roll_first(q, arc) for q in quads])
        a, z = arc[quads], nodes[quads, 2]
        lines_a = np.stack([a[:, [0, 3, 7]].mean(1), a[:, [4, 6]].mean(1), a[:, [1, 2, 5]].mean(1)], axis=1)
        lines_z = np.stack([z[:, [0, 1, 4]].mean(1), z[:, [5, 7]].mean(1), z[:, [3, 2, 6]].mean(1)], axis=1)
        spread = max(np.ptp(a[:, [0, 3, 7]], axis=1).max(), np.ptp(a[:, [1, 2, 5]], axis=1).max())
        assert spread <= 1e-6 * np.ptp(arc[quads]), "flank elements are bounded by lines of constant roll"
        return _Patch(quads, lines_a, lines_z)

    def z(self) -> np.ndarray:
        """Face-width coordinate (Q, H) of the Gauss points across each element, m."""
        c, b, a = (k[:, None] for k in _quadratic(self.width))
        return c + _GAUSS_WIDTH[0] * (b + a * _GAUSS_WIDTH[0])

    def natural(self, arc: np.ndarray) -> np.ndarray:
        """Natural coordinate of an arc length (R, Q, G), clipped to the element."""
        c, b, a = (k[:, None] for k in _quadratic(self.arc))
        inside = np.clip(arc, self.arc[:, :1], self.arc[:, 2:])
        return np.clip(2 * (inside - c) / (b + np.sqrt(b * b + 4 * a * (inside - c))), -1.0, 1.0)


def _quadratic(lines: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coefficients c, b, a of c + b ξ + a ξ² through the values (Q, 3) at −1, 0, 1."""
    return lines[:, 1], 0.5 * (lines[:, 2] - lines[:, 0]), 0.5 * (lines[:, 2] + lines[:, 0]) - lines[:, 1]


def _with_roll_first(quad: np.ndarray, arc: np.ndarray) -> np.ndarray:
    """Turn a VTK quadratic quad so that its edge from node 0 to node 1 climbs the flank."""
    turns = [np.concatenate([np.roll(quad[:4], -k), np.roll(quad[4:], -k)]) for k in range(4)]
    return max(turns, key=lambda q: arc[q[1]] - arc[q[0]])


def _width_weights(width: np.ndarray, face_width: float, functions: int) -> np.ndarray:
    """(1/b) P_a(2z/b) dz at the Gauss points across each element: (Q, A, H)."""
    c, b, a = (k[:, None] for k in _quadratic(width))
    eta = _GAUSS_WIDTH[0]
    z, slope = c + eta * (b + a * eta), np.abs(b + 2 * a * eta)
    legendre = np.polynomial.legendre.legvander(2 * z / face_width, functions - 1)
    return np.einsum("qha,qh->qah", legendre, slope * _GAUSS_WIDTH[1] / face_width)
