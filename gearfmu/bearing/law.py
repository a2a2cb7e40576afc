"""The potential of a rolling bearing: energy, force and stiffness of the displacement between its rings.

d = (x, y, z, θx, θy), m and rad, is the motion of the inner ring against the outer at the centre of the bearing, z
along the axis. Every rolling element j at the angle φ_j is a spring between the rings,

    U(d) = Σ_j u(δ_j),    F = dU/dd,    K = d²U/dd²

F is the force of the inner ring on the outer, K is symmetric and no eigenvalue is negative. Of a ball (ISO/TS
16281:2008, 5.2) δ is the growth of the distance A of the groove centres, with c = cos φ, s = sin φ and the operating
clearance s_r,

    ρ = A cos α − ½ s_r + x c + y s,    ζ = A sin α + z + R (θx s − θy c),    δ = (√(ρ² + ζ²) − A)₊,    u = ⅖ c_P δ^5/2

with ζ₊ for ζ in an angular contact bearing, which has a shoulder on one side only. Rollers are cut in slices (ISO/TS
16281:2008, 5.3). Of slice k of roller j, at x_k along the roller, with the profile P of the standard,

    δ_jk = (x c + y s + x_k (θy c − θx s) − ½ s_r − 2 P(x_k))₊,    u = 9/19 c_L δ^19/9 / n_s
    c_L = 35948 L^8/9    (N, mm)

of cylindrical rollers. A taper has the contact angle α; its slices lie at x_k cos α along the axis and at the radius
r_k = ½ D_pw − x_k sin α, and press along (cos α, sin α) in the axial section. Flanges are left out.

The mean over positions of the cage is a potential too: `Rolling.positions`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from gearfmu.bearing.hertz import YOUNGS_MODULUS, Point, line_pressure, point, point_stiffness

SLICES = 30  # the standard asks for at least as many
_LINE = 35948.0  # N/mm^(10/9) of a roller 1 mm long, steel
_MM = 1e-3
_SHORT = 2.5  # length over diameter up to which the whole roller is profiled


@dataclass(frozen=True)
class Elements:
    """State of n springs of one row. load (n,) N; rate (n,) N/m, its derivative by the approach; slope (n, 5):
    derivative of the approach by d; curl (n, 5, 5): its second derivative; energy: J, of all together."""

    load: np.ndarray
    rate: np.ndarray
    slope: np.ndarray
    curl: np.ndarray | None
    energy: float


@dataclass(frozen=True)
class Balls:
    """Law of deep groove and angular contact ball bearings. diameter, pitch_diameter: of balls and their circle, m;
    grooves: radii of inner and outer groove over the ball's diameter; contact_angle: rad; clearance: radial, in
    operation, m, negative: interference; modulus: Young's, Pa."""

    count: int
    diameter: float
    pitch_diameter: float
    grooves: tuple[float, float]
    contact_angle: float = 0.0
    clearance: float = 0.0
    modulus: float = YOUNGS_MODULUS

    @cached_property
    def points(self) -> tuple[Point, Point]:
        """Contact with the inner and the outer ring."""
        gamma = self.diameter * math.cos(self.contact_angle) / self.pitch_diameter
        inner, outer = (ratio * self.diameter for ratio in self.grooves)
        return point(self.diameter, inner, gamma), point(self.diameter, outer, -gamma)

    @cached_property
    def stiffness(self) -> float:
        """c_P, N/m^1.5."""
        return point_stiffness(*self.points, self.modulus)

    @property
    def distance(self) -> float:
        """A, m: of the groove centres where a ball just touches."""
        return (sum(self.grooves) - 1) * self.diameter

    @property
    def radius(self) -> float:
        """R, m: of the circle of the inner groove's centres."""
        return self.pitch_diameter / 2 + (self.grooves[0] - 0.5) * self.diameter * math.cos(self.contact_angle)

    def springs(self, d: np.ndarray, angles: np.ndarray, push: float) -> Elements:
        """One spring at each of the angles (k,) rad; push: m, towards the side that carries."""
        c, s, null = np.cos(angles), np.sin(angles), np.zeros_like(angles)
        across = np.stack([c, s, null, null, null], axis=1)
        along = np.stack([null, null, null + 1, self.radius * s, -self.radius * c], axis=1)
        rho = self.distance * math.cos(self.contact_angle) - self.clearance / 2 + across @ d
        zeta = self.distance * math.sin(self.contact_angle) + push + along @ d
        if self.contact_angle > 0.0:  # no shoulder on the other side
            along, zeta = np.where(zeta[:, None] > 0.0, along, 0.0), np.maximum(zeta, 0.0)
        length = np.hypot(rho, zeta)
        delta = np.maximum(length - self.distance, 0.0)
        slope = (rho[:, None] * across + zeta[:, None] * along) / length[:, None]
        curl = np.einsum("ki,kj->kij", across, across) + np.einsum("ki,kj->kij", along, along)
        curl -= np.einsum("ki,kj->kij", slope, slope)
        c_p = self.stiffness
        return Elements(
            load=c_p * delta**1.5,
            rate=1.5 * c_p * np.sqrt(delta),
            slope=slope,
            curl=curl / length[:, None, None],
            energy=float(0.4 * c_p * (delta**2.5).sum()),
        )

    def loads(self, springs: Elements) -> np.ndarray:
        """(k,) N: load of each rolling element."""
        return springs.load

    def pressure(self, springs: Elements) -> float:
        """Largest contact pressure, Pa."""
        most = float(springs.load.max(initial=0.0))
        return max(own.pressure(most, self.modulus) for own in self.points)


@dataclass(frozen=True)
class Rollers:
    """Law of cylindrical and tapered roller bearings. diameter, length: of the rollers, m, at their middle and without
    their chamfers; pitch_diameter: m; clearance: radial, in operation, m, negative: interference; contact_angle: rad,
    0: cylindrical, carries across the axis only."""

    count: int
    diameter: float
    pitch_diameter: float
    length: float
    clearance: float = 0.0
    contact_angle: float = 0.0

    @property
    def stiffness(self) -> float:
        """c_L, N/m^(10/9)."""
        return _LINE * (self.length / _MM) ** (8 / 9) / _MM ** (10 / 9)

    @cached_property
    def places(self) -> np.ndarray:
        """(n_s,) m: middles of the slices along the roller."""
        return self.length * ((np.arange(SLICES) + 0.5) / SLICES - 0.5)

    @cached_property
    def profile(self) -> np.ndarray:
        """(n_s,) m: P, how far the roller's surface lies below its cylinder."""
        straight = max(self.length - _SHORT * self.diameter, 0.0)
        part = np.maximum(2 * np.abs(self.places) - straight, 0.0) / (self.length - straight)
        factor = 0.0005 if straight else 0.00035
        return -factor * self.diameter * np.log(1 - part**2)

    def springs(self, d: np.ndarray, angles: np.ndarray, push: float) -> Elements:
        """The springs as of `Balls`, n_s an element, the slices of one side by side."""
        c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
        of_slices = np.zeros((angles.size, SLICES, 5))
        cosine, sine = math.cos(self.contact_angle), math.sin(self.contact_angle)
        arm = self.places - self.pitch_diameter / 2 * sine
        of_slices[..., 0], of_slices[..., 1], of_slices[..., 2] = cosine * c, cosine * s, sine
        of_slices[..., 3], of_slices[..., 4] = -arm * s, arm * c
        slope = of_slices.reshape(-1, 5)
        lost = np.tile(self.clearance / 2 * cosine + 2 * self.profile - push * sine, angles.size)
        delta = np.maximum(slope @ d - lost, 0.0)
        c_slice = self.stiffness / SLICES
        return Elements(
            load=c_slice * delta ** (10 / 9),
            rate=10 / 9 * c_slice * delta ** (1 / 9),
            slope=slope,
            curl=None,
            energy=float(9 / 19 * c_slice * (delta ** (19 / 9)).sum()),
        )

    def loads(self, springs: Elements) -> np.ndarray:
        """(k,) N: load of each rolling element."""
        return springs.load.reshape(-1, SLICES).sum(axis=1)

    def pressure(self, springs: Elements) -> float:
        """Largest contact pressure, Pa: on the inner ring, where the relative radius is smaller."""
        gamma = self.diameter * math.cos(self.contact_angle) / self.pitch_diameter
        most = float(springs.load.max(initial=0.0)) * SLICES / self.length
        return line_pressure(most, self.diameter / 2 * (1 - gamma))


Law: TypeAlias = Balls | Rollers


@dataclass(frozen=True)
class Row:
    """A row of rolling elements in its place. offset: along the axis from the centre of the bearing, m; side: +1 or −1,
    direction of the axial force of the inner ring that it carries; push: m, how far preload has moved the inner ring
    to that side."""

    law: Law
    offset: float = 0.0
    side: int = 1
    push: float = 0.0

    @property
    def frame(self) -> np.ndarray:
        """(5, 5): motion in the axes of the row by d; a row that carries the other side is seen in a mirror."""
        rows = np.diag([1.0, 1.0, self.side, self.side, self.side])
        rows[0, 4], rows[1, 3] = self.offset, -self.offset
        return rows


@dataclass(frozen=True)
class Rolling:
    """A bearing: one row of rolling elements, or several that move as one. positions: of the cage over which all is
    averaged, evenly over the distance of two rolling elements; cage: angle of the first rolling element, rad."""

    rows: tuple[Row, ...]
    positions: int = 1
    cage: float = 0.0

    @property
    def directions(self) -> tuple[int, ...]:
        """Those of x, y, z, θx, θy in which it can carry."""
        along = any(isinstance(row.law, Balls) or row.law.contact_angle > 0.0 for row in self.rows)
        return (0, 1, 2, 3, 4) if along else (0, 1, 3, 4)

    def placed(self, part: np.ndarray) -> np.ndarray:
        """(5,): a displacement in `directions` (k,) as one in all."""
        d = np.zeros(5)
        d[list(self.directions)] = part
        return d

    def energy(self, d: np.ndarray) -> float:
        """U, J. d (5,): m, rad."""
        return sum(springs.energy for _, springs in self.states(d)) / self.positions

    def force(self, d: np.ndarray) -> np.ndarray:
        """(5,) N, N·m: of the inner ring on the outer."""
        return sum((row.frame.T @ (own.load @ own.slope) for row, own in self.states(d)), np.zeros(5)) / self.positions

    def stiffness(self, d: np.ndarray) -> np.ndarray:
        """(5, 5) N/m, N/rad, N·m/rad: symmetric."""
        total = np.zeros((5, 5))
        for row, own in self.states(d):
            tangent = (own.slope.T * own.rate) @ own.slope
            if own.curl is not None:
                tangent += np.einsum("k,kij->ij", own.load, own.curl)
            total += row.frame.T @ tangent @ row.frame
        return 0.5 * (total + total.T) / self.positions

    def loads(self, d: np.ndarray) -> np.ndarray:
        """(rows, positions, count) N: of every rolling element; all rows have equally many."""
        found = [row.law.loads(own).reshape(row.law.count, self.positions).T for row, own in self.states(d)]
        return np.stack(found)

    def pressure(self, d: np.ndarray) -> float:
        """Largest contact pressure, Pa."""
        return max(row.law.pressure(own) for row, own in self.states(d))

    def states(self, d: np.ndarray) -> list[tuple[Row, Elements]]:
        """The springs of every row at all positions of the cage."""
        return [(row, row.law.springs(row.frame @ d, self._angles(row.law.count), row.push)) for row in self.rows]

    def _angles(self, count: int) -> np.ndarray:
        elements = count * self.positions
        return self.cage + 2 * math.pi * np.arange(elements) / elements
