"""Events of a network: which part leaves its mode first, exactly when, and what mode follows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from gearfmu.cosim.network import Dynamics, Mode

MAX_SWEEPS = 500  # of the Gauss–Seidel iteration
SLIP_TOLERANCE = 1e-12  # rad/s, for speeds up to about 1e3 rad/s some ten units in the last place
TORQUE_TOLERANCE = 1e-10  # relative to the capacity plus 1 N·m
GAP_TOLERANCE = 1e-15  # m or rad
FRACTION_TOLERANCE = 1e-14  # of the micro-step, of the instant of an event


class Event(NamedTuple):
    """What happened when: `what` is "lock", "slip", "drive", "coast" or "open"."""

    time: float
    part: str
    what: str


class Attempt(NamedTuple):
    """An attempted step: state and input at both ends, capacities at both ends, length s."""

    x0: np.ndarray
    u0: np.ndarray
    x1: np.ndarray
    u1: np.ndarray
    capacity0: np.ndarray
    capacity1: np.ndarray
    h: float


class Found(NamedTuple):
    """First event of an attempted step: part by kind and index, fraction of the step, state, input and capacities
    there."""

    kind: str
    number: int
    part: str
    fraction: float
    x: np.ndarray
    u: np.ndarray
    capacity: np.ndarray

    def what(self, mode: Mode) -> str:
        """The mode it led to, in words."""
        if self.kind == "clutch":
            return "lock" if mode[0][self.number] == 0 else "slip"
        return {1: "drive", -1: "coast", 0: "open"}[mode[1][self.number]]


def margins(dynamics: Dynamics, mode: Mode, x: np.ndarray, u: np.ndarray, capacity: np.ndarray) -> list[float]:
    """How far every clutch, then every backlash, is from leaving its mode; negative when it has left it."""
    m = dynamics.matrices(mode)
    n_c, n_s = dynamics.n_clutches, len(dynamics.network.springs)
    tail = m.c[-(n_s + 2 * n_c) :] @ x + m.d[-(n_s + 2 * n_c) :] @ u
    extension, torque, slip = tail[:n_s], tail[n_s : n_s + n_c], tail[n_s + n_c :]
    found = []
    for k, sign in enumerate(mode[0]):
        if sign:
            found.append(sign * slip[k] + SLIP_TOLERANCE)
        else:
            bound = dynamics.network.clutches[k].peak * capacity[k]
            found.append(bound - abs(torque[k]) + TORQUE_TOLERANCE * (1.0 + bound))
    for k, sign in zip(dynamics.gaps, mode[1], strict=True):
        s, far = extension[k], extension[k] + dynamics.network.springs[k].backlash
        found.append((s if sign > 0 else -far if sign < 0 else min(-s, far)) + GAP_TOLERANCE)
    return found


def first_event(dynamics: Dynamics, mode: Mode, attempt: Attempt) -> Found | None:
    """The first part that leaves its mode in the attempted step, or None."""
    start = margins(dynamics, mode, attempt.x0, attempt.u0, attempt.capacity0)
    end = margins(dynamics, mode, attempt.x1, attempt.u1, attempt.capacity1)
    broken = [k for k in range(len(start)) if start[k] < 0]
    if broken:
        return _found(dynamics, broken[0], 0.0, attempt, attempt.x0)
    left = [k for k in range(len(end)) if end[k] < 0]
    if not left:
        return None
    fraction, part = min((_instant(dynamics, mode, attempt, k), k) for k in left)
    return _found(dynamics, part, fraction, attempt, _state_at(dynamics, mode, attempt, fraction))


def _instant(dynamics: Dynamics, mode: Mode, attempt: Attempt, part: int) -> float:
    def margin(fraction: float) -> float:
        x = _state_at(dynamics, mode, attempt, fraction)
        return margins(dynamics, mode, x, *_between(attempt, fraction))[part]

    return float(brentq(margin, 0.0, 1.0, xtol=FRACTION_TOLERANCE))


def _state_at(dynamics: Dynamics, mode: Mode, attempt: Attempt, fraction: float) -> np.ndarray:
    if fraction == 0.0:
        return attempt.x0
    if fraction == 1.0:
        return attempt.x1
    u = _between(attempt, fraction)[0]
    return dynamics.transition_once(mode, fraction * attempt.h) @ np.concatenate([attempt.x0, attempt.u0, u])


def _between(attempt: Attempt, fraction: float) -> tuple[np.ndarray, np.ndarray]:
    u = attempt.u0 + fraction * (attempt.u1 - attempt.u0)
    return u, attempt.capacity0 + fraction * (attempt.capacity1 - attempt.capacity0)


def _found(dynamics: Dynamics, part: int, fraction: float, attempt: Attempt, x: np.ndarray) -> Found:
    n_c, network = dynamics.n_clutches, dynamics.network
    is_clutch = part < n_c
    index = part if is_clutch else part - n_c
    name = network.clutches[index].name if is_clutch else network.springs[dynamics.gaps[index]].name
    return Found("clutch" if is_clutch else "gap", index, name, fraction, x, *_between(attempt, fraction))


def switch(dynamics: Dynamics, mode: Mode, found: Found, x: np.ndarray) -> Mode:
    """Mode after the event; slips of the clutches that meet there are set to exactly zero in `x`, keeping the
    momentum."""
    signs, gaps = list(mode[0]), list(mode[1])
    if found.kind == "gap":
        s = float(dynamics.extension[dynamics.gaps[found.number]] @ x[: dynamics.n])
        backlash = dynamics.network.springs[dynamics.gaps[found.number]].backlash
        gaps[found.number] = 0 if gaps[found.number] else (1 if s > -0.5 * backlash else -1)
        return tuple(signs), tuple(gaps)
    at_rest = [k for k, sign in enumerate(signs) if sign == 0]
    if signs[found.number] == 0:
        at_rest.remove(found.number)
        m = dynamics.matrices(mode)
        row = len(m.c) - 2 * dynamics.n_clutches + found.number
        signs[found.number] = 1 if m.c[row] @ found.x + m.d[row] @ found.u > 0 else -1  # by the torque that held it
        _stop(dynamics, x, [found.number, *at_rest])
    else:
        at_rest.append(found.number)
        _stop(dynamics, x, at_rest)
    return resolve(dynamics, (tuple(signs), tuple(gaps)), sorted(at_rest), x, found.u, found.capacity)


def _stop(dynamics: Dynamics, x: np.ndarray, clutches: list[int]) -> None:
    """Set the slips of `clutches` to zero by impulses of their torques."""
    rows, n = dynamics.slip[clutches], dynamics.n
    through = dynamics.inverse_inertia[:, None] * rows.T
    x[n : 2 * n] -= through @ np.linalg.lstsq(rows @ through, rows @ x[n : 2 * n], rcond=None)[0]


def resolve(
    dynamics: Dynamics, mode: Mode, at_rest: list[int], x: np.ndarray, u: np.ndarray, capacity: np.ndarray
) -> Mode:
    """Which of the clutches `at_rest` (slip zero) stick, and in which direction the others start to slip, given the
    signs of those that slip already.

    Sticking clutches hold up to peak·capacity; one that starts to slip transmits its capacity, which may break the
    next one loose.
    """
    n, n_c, signs, rest = dynamics.n, dynamics.n_clutches, list(mode[0]), list(at_rest)
    while rest:
        free = tuple(1 if k in rest else sign for k, sign in enumerate(signs)), mode[1]
        torque = np.array([0.0 if k in rest else sign * capacity[k] for k, sign in enumerate(signs)])
        m, v = dynamics.matrices(free), np.concatenate([u[:n], torque, u[n + n_c :]])
        acceleration = (m.a @ x + m.b @ v)[n : 2 * n]
        rows = dynamics.slip[rest]
        delassus, wanted = rows * dynamics.inverse_inertia @ rows.T, rows @ acceleration
        bound = np.array([dynamics.network.clutches[k].peak * capacity[k] for k in rest])
        left = wanted - delassus @ sticking_torques(delassus, wanted, bound)
        loose = np.abs(left) > 1e-10 * (1.0 + np.abs(wanted))
        for k, is_loose, value in zip(rest, loose, left, strict=True):
            signs[k] = (1 if value > 0 else -1) if is_loose else 0
        if not loose.any():
            break
        rest = [k for k, is_loose in zip(rest, loose, strict=True) if not is_loose]
    return tuple(signs), mode[1]


def initial_mode(dynamics: Dynamics, x: np.ndarray, u: np.ndarray, capacity: np.ndarray) -> Mode:
    """Mode of a state from nothing but the state: gaps by extension, clutches by slip, then `resolve` for those
    without slip."""
    gaps = []
    for k in dynamics.gaps:
        s, backlash = float(dynamics.extension[k] @ x[: dynamics.n]), dynamics.network.springs[k].backlash
        gaps.append(1 if s > 0 else -1 if s < -backlash else 0)
    slips = dynamics.slip @ x[dynamics.n : 2 * dynamics.n]
    signs = tuple(0 if abs(s) <= SLIP_TOLERANCE else 1 if s > 0 else -1 for s in slips)
    at_rest = [k for k, sign in enumerate(signs) if sign == 0]
    return resolve(dynamics, (signs, tuple(gaps)), at_rest, x, u, capacity)


def sticking_torques(delassus: np.ndarray, slip_acceleration: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Torques T (m,), |T| ≤ bound, such that each clutch sticks (slip acceleration zero) or transmits ±bound along
    its slip acceleration.

    delassus : (m, m) G = D M⁻¹ Dᵀ, 1/(kg·m²), positive definite; slip_acceleration : (m,) of the clutches without
    torque, rad/s²; bound : (m,) N·m. The slip acceleration with them is slip_acceleration − G T. Projected
    Gauss–Seidel, which converges for every positive definite G (Cottle, Pang, Stone: The Linear Complementarity
    Problem, 5.3).
    """
    torque = np.zeros_like(slip_acceleration)
    for _ in range(MAX_SWEEPS):
        before = torque.copy()
        for i in range(len(torque)):
            rest = slip_acceleration[i] - delassus[i] @ torque + delassus[i, i] * torque[i]
            torque[i] = min(max(rest / delassus[i, i], -bound[i]), bound[i])
        if np.all(np.abs(torque - before) <= 1e-14 * (bound + np.abs(torque))):
            break
    return torque
