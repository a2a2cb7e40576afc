"""Events of a network: which clutch leaves its mode first, exactly when, and what mode follows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from gearfmu.cosim.network import Dynamics, Mode

MAX_SWEEPS = 500  # of the Gauss–Seidel iteration
SLIP_TOLERANCE = 1e-12  # rad/s, for speeds up to about 1e3 rad/s some ten units in the last place
TORQUE_TOLERANCE = 1e-10  # relative to the capacity plus 1 N·m
FRACTION_TOLERANCE = 1e-14  # of the micro-step, of the instant of an event


class Event(NamedTuple):
    """What happened to a clutch, and when: `what` is "lock" or "slip"."""

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
    """First event of an attempted step: number of the clutch, fraction of the step, state, input and capacities
    there."""

    clutch: int
    fraction: float
    x: np.ndarray
    u: np.ndarray
    capacity: np.ndarray


def margins(dynamics: Dynamics, mode: Mode, x: np.ndarray, u: np.ndarray, capacity: np.ndarray) -> list[float]:
    """How far every clutch is from leaving its mode; negative when it has left it."""
    m, n_c = dynamics.matrices(mode), dynamics.n_clutches
    torque, slip = np.split(m.c[-2 * n_c :] @ x + m.d[-2 * n_c :] @ u, 2)
    found = []
    for k, sign in enumerate(mode):
        if sign:
            found.append(sign * slip[k] + SLIP_TOLERANCE)
        else:
            bound = dynamics.network.clutches[k].peak * capacity[k]
            found.append(bound - abs(torque[k]) + TORQUE_TOLERANCE * (1.0 + bound))
    return found


def first_event(dynamics: Dynamics, mode: Mode, attempt: Attempt) -> Found | None:
    """The first clutch that leaves its mode in the attempted step, or None."""
    start = margins(dynamics, mode, attempt.x0, attempt.u0, attempt.capacity0)
    end = margins(dynamics, mode, attempt.x1, attempt.u1, attempt.capacity1)
    broken = [k for k in range(len(start)) if start[k] < 0]
    if broken:
        return Found(broken[0], 0.0, attempt.x0, *_between(attempt, 0.0))
    left = [k for k in range(len(end)) if end[k] < 0]
    if not left:
        return None
    fraction, clutch = min((_instant(dynamics, mode, attempt, k), k) for k in left)
    return Found(clutch, fraction, _state_at(dynamics, mode, attempt, fraction), *_between(attempt, fraction))


def _instant(dynamics: Dynamics, mode: Mode, attempt: Attempt, clutch: int) -> float:
    def margin(fraction: float) -> float:
        x = _state_at(dynamics, mode, attempt, fraction)
        return margins(dynamics, mode, x, *_between(attempt, fraction))[clutch]

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


def switch(dynamics: Dynamics, mode: Mode, found: Found, x: np.ndarray) -> Mode:
    """Mode after the event; slips of the clutches that meet there are set to exactly zero in `x`, keeping the
    momentum."""
    signs, clutch = list(mode), found.clutch
    at_rest = [k for k, sign in enumerate(signs) if sign == 0]
    if signs[clutch] == 0:
        at_rest.remove(clutch)
        m = dynamics.matrices(mode)
        row = len(m.c) - 2 * dynamics.n_clutches + clutch
        signs[clutch] = 1 if m.c[row] @ found.x + m.d[row] @ found.u > 0 else -1  # by the torque that held it
        _stop(dynamics, x, [clutch, *at_rest])
    else:
        at_rest.append(clutch)
        _stop(dynamics, x, at_rest)
    return resolve(dynamics, tuple(signs), sorted(at_rest), x, found.u, found.capacity)


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
    n, signs, rest = dynamics.n, list(mode), list(at_rest)
    while rest:
        free = tuple(1 if k in rest else sign for k, sign in enumerate(signs))
        torque = np.array([0.0 if k in rest else sign * capacity[k] for k, sign in enumerate(signs)])
        m, v = dynamics.matrices(free), np.concatenate([u[:n], torque])
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
    return tuple(signs)


def initial_mode(dynamics: Dynamics, x: np.ndarray, u: np.ndarray, capacity: np.ndarray) -> Mode:
    """Mode of a state from nothing but the state: by slip, then `resolve` for the clutches without slip."""
    slips = dynamics.slip @ x[dynamics.n : 2 * dynamics.n]
    signs = tuple(0 if abs(s) <= SLIP_TOLERANCE else 1 if s > 0 else -1 for s in slips)
    return resolve(dynamics, signs, [k for k, sign in enumerate(signs) if sign == 0], x, u, capacity)


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
