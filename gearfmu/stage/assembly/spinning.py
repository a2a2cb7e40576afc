"""Gyroscopic forces on the ground group: what tilting and elastic bodies feel when their rotors turn (docs/theory.md
3.11).

In axes that do not turn the velocity of a body's unknowns p (rigid motion x, y, z, rx, ry, rz, then its patterns of ν ≤
1) enters the kinetic energy as ½ ṗᵀMṗ + ṗᵀ(Ω H + Ω_f Q) p, H and Q skew, Ω the speed of its rotor, Ω_f that of the axes
in which it stands (a carrier's):

    H = G − M J,   Q = M J;     M p̈ + 2 (Ω H + Ω_f Q) ṗ + … = f

G: Coriolis coupling in the body's own axes, J: the quarter turn of every pair that turns as a vector. For rigid tilt H
is −½ J_p J, the gyroscopic moment; for translation it vanishes. Q of translation are the Coriolis forces on carried
masses (`Group.carried_rows`) and is not repeated here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as sl

from gearfmu.body.body import Body

if TYPE_CHECKING:
    from gearfmu.stage.assembly.groups import Group, Layout

RX, RY, RZ, RIGID = 3, 4, 5, 6
HIGHEST = 2 * math.pi * 100e3  # rad/s: patterns above it feel 2Ω/ω < 2e-3 at 600 rad/s, and are left out
IDLE = 1e-9  # of a body's largest gyroscopic pair: smaller ones are rounding


@dataclass(frozen=True)
class Spinning:
    """Of a free body of n patterns: gyroscopic H and coriolis Q, (6 + n, 6 + n), skew."""

    gyroscopic: np.ndarray
    coriolis: np.ndarray


def rigid_spinning(mass: np.ndarray, patterns: int) -> Spinning:
    """Of a body that tilts as a rigid one: H of its polar moment of inertia, Q of tilt about its centre of mass, the
    rest being that of a point mass there; mass (6, 6) about its axis."""
    h, q = np.zeros((2, RIGID + patterns, RIGID + patterns))
    h[RX, RY] = 0.5 * mass[RZ, RZ]
    q[RY, RX] = mass[RX, RX] - mass[1, RX] ** 2 / mass[0, 0]
    return Spinning(h - h.T, q - q.T)


def body_spinning(body: Body, low: np.ndarray) -> Spinning | None:
    """Of a body with the patterns `low`: sections of a beam tilt, patterns of a gear feel what `Body.spin` tells; None
    of one that turns as if rigid."""
    if body.exact is not None:
        return Spinning(body.exact.gyroscopic, rigid_spinning(body.mass, low.size).coriolis)
    if body.spin is None:
        return None
    rigid, flank = rigid_spinning(body.mass, low.size), body.toothed
    h, q = rigid.gyroscopic, rigid.coriolis
    own = (flank.diameter[low] == 1) & (2 * np.pi * body.frequency[low] < HIGHEST)
    first = np.flatnonzero(own & (flank.part[low] == 1))
    quarter = np.zeros((low.size, low.size))
    quarter[first + 1, first] = 1.0
    quarter -= quarter.T
    h[RIGID:, RIGID:] = (body.spin.coupling[np.ix_(low, low)] - quarter) * np.outer(own, own)
    h[RX : RY + 1, RIGID:] = -body.spin.tilt[:, low] * own
    h[RIGID:, RX : RY + 1] = -h[RX : RY + 1, RIGID:].T
    q[RIGID:, RIGID:] = quarter
    return rigid


def turn_rates(body: Body, chosen: np.ndarray) -> np.ndarray | None:
    """(m,): Coriolis coupling of the pairs among the modes `chosen` of a gear group, first member into second; other
    couplings move frequencies by the square of Ω/ω. None where its file does not tell."""
    if body.spin is None:
        return None
    part = body.toothed.part[chosen]
    rates = np.zeros(chosen.size)
    first = np.flatnonzero(part == 1)
    rates[first] = rates[first + 1] = body.spin.coupling[chosen[first + 1], chosen[first]]
    return rates


def skew_pairs(matrix: np.ndarray) -> np.ndarray:
    """(p, 2, m): rows x, y of a skew matrix (m, m) = Σ y xᵀ − x yᵀ, by its real Schur form."""
    schur, basis = sl.schur(matrix, output="real")
    size = np.diag(schur, 1)
    pairs = []
    for i in np.flatnonzero(np.abs(size) > IDLE * np.abs(size).max(initial=0.0)):
        x, y = (basis[:, i + 1], basis[:, i]) if size[i] > 0 else (basis[:, i], basis[:, i + 1])
        pairs.append(np.sqrt(abs(size[i])) * np.stack([x, y]))
    return np.array(pairs).reshape(-1, 2, len(matrix))


def whirl_rows(group: Group) -> tuple[np.ndarray, np.ndarray]:
    """Rotors (p,) and rows x, y (p, 2, n): those of the bodies' own rotors and of the axes that they stand in.
    Speeds change by −2Ω (y x·v − x y·v), Ω the rotor's speed."""
    layout, rotors, rows = group.layout, [], []
    for r, rotor in enumerate(layout.rotors):
        for body in rotor if r not in layout.stands else ():
            free, frame = layout.bodies[body], layout.frame_of(body)
            own = free.spinning or rigid_spinning(free.mass, free.omega.size)
            for turns, matrix in ((r, own.gyroscopic), (frame, own.coriolis)):
                if turns >= 0:
                    found = skew_pairs(matrix[np.ix_(*2 * [_unknowns(layout, body)])]) @ group.shapes[group.at[body]]
                    rotors += len(found) * [turns]
                    rows += list(found)
    return np.array(rotors, int), np.array(rows).reshape(-1, 2, group.omega.size)


def _unknowns(layout: Layout, body: int) -> np.ndarray:
    """Which of the rigid motions and patterns of a body are unknowns."""
    return np.array([*layout.freedoms(body), *range(6, 6 + layout.bodies[body].omega.size)], int)
