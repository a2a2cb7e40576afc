"""Equilibrium of a bearing under a load: the least of U(d) − F·d, found by damped Newton steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gearfmu.bearing.law import Balls, Law, Rolling, Row

_STEPS = 300
_EXACT = 1e-10  # largest force left, of the load
_LEAST_LOAD = 1e-6  # N: below it there is no load
_FARTHEST = 0.3  # of a rolling element's diameter: beyond it a ball has left its groove


class NoRestError(Exception):
    """No displacement within the bearing carries the load."""


@dataclass(frozen=True)
class Rest:
    """A bearing under a load. load: (5,) N, N·m, of the inner ring on the outer; displacement: (5,) m, rad; loads:
    (rows, positions, count) N; stiffness: (5, 5); pressure: Pa, the largest."""

    load: np.ndarray
    displacement: np.ndarray
    loads: np.ndarray
    stiffness: np.ndarray
    pressure: float

    @property
    def loaded(self) -> int:
        """Rolling elements that carry, the most of all positions of the cage."""
        return int((self.loads > 0.0).sum(axis=2).sum(axis=0).max())


def rest(bearing: Rolling, load: np.ndarray) -> Rest:
    """The bearing under a load (5,) N, N·m on its inner ring. NoRestError where it cannot carry that load."""
    wanted, free = np.asarray(load, float), list(bearing.directions)
    scale = scales(bearing)
    if np.abs(np.delete(wanted, free)).max(initial=0.0) > _LEAST_LOAD:
        raise NoRestError("the bearing carries nothing along its axis")
    placed = bearing.placed
    found = least(
        lambda d: bearing.energy(placed(d)) - wanted[free] @ d,
        lambda d: (bearing.force(placed(d)) - wanted)[free],
        lambda d: bearing.stiffness(placed(d))[np.ix_(free, free)],
        np.zeros(len(free)),
        scale[free],
        float(np.abs(wanted[free] * scale[free]).max()),
    )
    return state(bearing, placed(found))


def state(bearing: Rolling, d: np.ndarray) -> Rest:
    """The bearing at a displacement (5,) m, rad."""
    return Rest(bearing.force(d), d, bearing.loads(d), bearing.stiffness(d), bearing.pressure(d))


def scales(bearing: Rolling) -> np.ndarray:
    """(5,): displacements, m and rad, that are alike at the rolling elements."""
    row = bearing.rows[0]
    arm = max(row.law.pitch_diameter / 2, abs(row.offset))
    return np.array([1.0, 1.0, 1.0, 1 / arm, 1 / arm])


def preloaded(row: Row, preload: float) -> Row:
    """The row with its inner ring pushed to the side that it carries until the axial force is `preload`, N; taken back
    where that is 0. NoRestError where it cannot be."""
    centred = replace(row, push=0.0)
    if preload == 0.0:
        return centred
    if not isinstance(row.law, Balls) and row.law.contact_angle == 0.0:
        raise NoRestError("cylindrical rollers carry nothing along the axis")
    alone = Rolling((replace(centred, offset=0.0, side=1),))
    low, high = 0.0, row.law.diameter * _FARTHEST
    if alone.force(np.array([0.0, 0.0, high, 0.0, 0.0]))[2] < preload:
        raise NoRestError("the preload is beyond what the bearing can carry")
    for _ in range(200):
        middle = 0.5 * (low + high)
        enough = alone.force(np.array([0.0, 0.0, middle, 0.0, 0.0]))[2] > preload
        low, high = (low, middle) if enough else (middle, high)
        if high - low < 1e-15:
            break
    return replace(centred, push=0.5 * (low + high))


def least(
    value: Callable[[np.ndarray], float],
    slope: Callable[[np.ndarray], np.ndarray],
    curvature: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    scale: np.ndarray,
    force: float,
) -> np.ndarray:
    """(n,): where a convex function is least. start (n,); scale (n,): unknowns that are alike; force: size of the
    scaled slopes that is exact to `_EXACT`. NoRestError where none is found within the reach of a bearing."""
    at, damping, here = start.astype(float), 1e3, value(start)
    enough = max(_EXACT * force, _LEAST_LOAD * 1e-3)
    for _ in range(_STEPS):
        left = slope(at) * scale
        if np.abs(left).max(initial=0.0) <= enough:
            return at
        system = curvature(at) * np.outer(scale, scale)
        step = -scale * np.linalg.solve(system + damping * np.eye(at.size), left)
        there = value(at + step)
        better = there < here or np.abs(slope(at + step) * scale).max() < np.abs(left).max()
        if better and math.isfinite(there):
            at, here, damping = at + step, there, max(damping / 30, 1e-9 * np.abs(system).max())
        else:
            damping = max(damping * 10, 1.0)
        if np.abs(at / scale).max() > 1.0:
            break
    raise NoRestError("no displacement carries the load")


_ANGLES = 24  # of the cage over the distance of two rolling elements


def pass_orders(law: Law) -> tuple[float, float]:
    """Rolling elements that pass a point of the outer, and of the inner ring, in one revolution of the inner ring."""
    gamma = law.diameter * math.cos(law.contact_angle) / law.pitch_diameter
    return 0.5 * law.count * (1 - gamma), 0.5 * law.count * (1 + gamma)


def pass_swing(bearing: Rolling, load: np.ndarray) -> np.ndarray:
    """(5,) m, rad, peak to peak: motion of the inner ring under a constant load (5,) while rolling elements pass.
    NoRestError: `rest`."""
    count = bearing.rows[0].law.count
    angles = 2 * math.pi / count * np.arange(_ANGLES) / _ANGLES
    return np.ptp([rest(replace(bearing, positions=1, cage=angle), load).displacement for angle in angles], axis=0)
