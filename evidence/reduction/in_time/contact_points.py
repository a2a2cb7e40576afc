"""Contact points of two gears in the position where a run begins: gaps, areas, and rows at their nodes.

A point of gear A at P finds its foot on the involute of gear B in closed form (theory, eq. 8h): with D = P − C_B,
ℓ = √(D² − r_b²), t = arg D − sg arctan(ℓ/r_b) and s = r_b (ψ_b − sg (t − θ)) of the tooth at θ, the gap is ℓ − s along
the normal sg e_t(t). To first order in small displacements it grows by n · (u_P − u_foot), displacements of the points
being those of the faces that they lie on. Gear B may be a ring: its spaces are bounded by the flanks of the gear that
would fill them, so gap and normal turn their signs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import surface
from gearfmu.femesh.mesh import FeMesh, FlankGrid
from gearfmu.geometry import GearGeometry
from gearfmu.geometry.gear import InternalGearGeometry


@dataclass(frozen=True)
class Placed:
    """A spur gear where it stands: sector mesh, shape, centre (2,) m, and angle (rad) of tooth 0 (a ring: space 0) from
    +x."""

    sector: FeMesh
    geometry: GearGeometry | InternalGearGeometry
    centre: np.ndarray
    angle: float

    def tooth_angle(self, tooth: int) -> float:
        """Angle (rad) of a tooth's middle from +x."""
        return self.angle + 2 * np.pi * tooth / self.geometry.z


@dataclass(frozen=True)
class Grid:
    """Points of a flank along and across, and the largest gap (m) at which a point is taken."""

    along: int
    across: int
    reach: float


@dataclass(frozen=True)
class Points:
    """gap (c,) m; area (c,) m²; side (c,) ±1; rows of gear A and gear B (c, 3N): their sum is what opens the gap."""

    gap: np.ndarray
    area: np.ndarray
    side: np.ndarray
    rows: tuple[sp.csr_array, sp.csr_array]


def contact_points(a: Placed, b: Placed, grid: Grid, allowance: dict[int, float]) -> Points:
    """Points of gear A's flanks within reach of gear B's. allowance : m, added to the gaps of side +1 and −1."""
    found = [
        _between(a, b, (i, j), side, grid)
        for side in (1, -1)
        for i in range(a.geometry.z)
        for j in range(b.geometry.z)
        if _face_each_other(a, b, i, j)
    ]
    gap, area, side, first, second = (np.concatenate(part) for part in zip(*found, strict=True))
    rows = tuple(
        sp.csr_array(sp.vstack([_row(k, n, 3 * len(gear.sector.full().nodes)) for k, n in part]))
        for gear, part in ((a, first), (b, second))
    )
    return Points(gap + np.where(side > 0, allowance[1], allowance[-1]), area, side, rows)


def is_ring(gear: Placed) -> bool:
    return isinstance(gear.geometry, InternalGearGeometry)


def _face_each_other(a: Placed, b: Placed, i: int, j: int) -> bool:
    """Whether tooth i of A and tooth (or space) j of B lie within two pitches of where the gears meet."""
    towards = np.arctan2(*(b.centre - a.centre)[::-1])
    both = (towards + np.pi,) * 2 if is_ring(b) else (towards, towards + np.pi)
    off = [gear.tooth_angle(k) - direction for gear, k, direction in zip((a, b), (i, j), both, strict=True)]
    return all(abs(np.angle(np.exp(1j * o))) < 4 * np.pi / g.geometry.z for o, g in zip(off, (a, b), strict=True))


def _between(a: Placed, b: Placed, teeth: tuple[int, int], side: int, grid: Grid) -> tuple[np.ndarray, ...]:
    """gap, area, side, and (node numbers, weights × normal) of either gear, of the points of one pair of flanks."""
    flank = a.sector.flank[0 if side > 0 else 1]
    arc = np.linspace(a.geometry.s_form**2, a.geometry.s_tip**2, grid.along)
    across = np.linspace(flank.z.min(), flank.z.max(), grid.across)
    roll, z = (part.ravel() for part in np.meshgrid(np.sqrt(arc), across, indexing="ij"))
    point = _turned(a.geometry.flank_point(roll, side), a.tooth_angle(teeth[0])) + a.centre
    offset = point - b.centre
    base = b.geometry.r_b
    tangent = np.sqrt(np.maximum((offset**2).sum(axis=1) - base**2, 0.0))
    direction = np.arctan2(offset[:, 1], offset[:, 0]) - side * np.arctan2(tangent, base)
    turn = np.angle(np.exp(1j * (direction - b.tooth_angle(teeth[1]))))
    foot = base * (b.geometry.psi_b - side * turn)
    inside = -1.0 if is_ring(b) else 1.0
    gap = inside * (tangent - foot)
    first, last = sorted((b.geometry.s_form, b.geometry.s_tip))
    near = np.flatnonzero((np.abs(gap) < grid.reach) & (foot > first) & (foot < last))
    normal = inside * side * np.stack([-np.sin(direction), np.cos(direction), np.zeros_like(direction)], axis=1)
    other = b.sector.flank[0 if side > 0 else 1]
    area = np.outer(_trapezoid(arc / (2 * a.geometry.r_b)), _trapezoid(across)).ravel()
    return (
        gap[near], area[near], np.full(len(near), side),
        _nodal(a, flank, teeth[0], (roll[near], z[near], normal[near])),
        _nodal(b, other, teeth[1], (foot[near], z[near], -normal[near])),
    )  # fmt: skip


def _turned(points: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


def _trapezoid(at: np.ndarray) -> np.ndarray:
    half = 0.5 * np.diff(at)
    return np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half])


def _nodal(gear: Placed, flank: FlankGrid, tooth: int, at: tuple[np.ndarray, ...]) -> np.ndarray:
    """Of points (roll, z, normal): pairs of the 24 unknowns of the face they lie on and their weights, (c, 2, 24)."""
    roll, z, normal = at
    numbers = gear.sector.sector_nodes(tooth)
    result = np.empty((len(roll), 2, 24))
    for k in range(len(roll)):
        quad, xi = _located(flank, roll[k], z[k])
        weight = surface.shape(xi[None])[0]
        result[k, 0] = (3 * numbers[flank.quads[quad]][:, None] + np.arange(3)).ravel()
        result[k, 1] = np.outer(weight, normal[k]).ravel()
    return result


def _located(flank: FlankGrid, roll: float, z: float) -> tuple[int, np.ndarray]:
    """Face and natural coordinates of a point; roll² and z are linear in them."""
    corners = surface.NATURAL[:4]
    best: tuple[float, int, np.ndarray] = (np.inf, -1, np.zeros(2))
    for quad in range(len(flank.quads)):
        values = np.stack([flank.roll[quad, :4] ** 2, flank.z[quad, :4]])
        xi = np.linalg.solve(values @ corners / 4, np.array([roll**2, z]) - values.mean(axis=1))
        outside = float(np.abs(xi).max())
        if outside < best[0]:
            best = (outside, quad, xi)
    assert best[0] < 1 + 1e-6, "a contact point beside its flank"
    return best[1], best[2]


def _row(numbers: np.ndarray, weights: np.ndarray, size: int) -> sp.csr_array:
    return sp.csr_array((weights, (np.zeros(24, int), numbers.astype(int))), shape=(1, size))
