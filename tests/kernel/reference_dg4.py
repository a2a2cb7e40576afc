"""An independent reference of the time step `dg4` (and `em`) for a small problem with constant rows, in plain numpy.

Written from the formulas of the theory page alone, not from the C kernel, so that the two can be compared step by step.

The problem. Modes q_k with unit mass, q̈ + 2ζωq̇ + ω²q = F + Wᵀλ (ω = 0: rigid), unknown forces λ and their gaps
G = offset + W q + C λ with 0 ≤ λ ⊥ G ≥ 0. C is the compliance of what has no mass.

The step. The force is constant in a step, λ̄ = ½(λ₀ + λ₁ + η): impulses h f at the ends of steps. With E the exact flow
of a mode, its state is ρ times the exact response to them at the middle of an impulse. ρ and κ, the compliance that is
taken off at once, make the response exact at rest and, matched at rest (no mesh mode is known here), up to Ω². γ < ½
goes back to κ = 0 (`em`). Modes too fast for the step yield a share θ at once (κ = −θ/ω²), the rest by the trapezoidal
rule with a step h √(1 − θ). 1 > γ > ¾ raises θ from .7 to .95, ¾ > γ > ½ halves the limit of ωh.
η, along one direction and of one scalar, makes the work of a step in which a contact opens or closes equal to the
change of ½ λᵀC′λ (a discrete gradient after Gonzalez, J. Nonlinear Sci. 6, 1996).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

EXPONENTIAL_LIMIT, LIMIT_OF_HIGH, HIGH = 1.6, 1.2, 2 * np.pi * 30e3  # ωh; of modes above HIGH, rad/s
SHARE, RAISED, WHOLE = 0.7, 0.95, 3.0  # θ at γ = 1 and below ¾, from ωh = WHOLE on
MEMORY = 0.25  # of a dashpot's force at the end of a step
ROUNDS = 12


@dataclass(frozen=True)
class Problem:
    """Modes and unknown forces; n modes, m forces.

    omega (n,) rad/s, 0 for rigid · zeta (n,) · rows (m, n): gap per modal coordinate · compliance (m, m), m/N ·
    offset (m,), m · dashpot (m,), N·s/m, parallel to `path` (m, m), m/N, the part of the compliance that is each
    contact's own.
    """

    omega: np.ndarray
    zeta: np.ndarray
    rows: np.ndarray
    compliance: np.ndarray
    offset: np.ndarray
    dashpot: np.ndarray
    path: np.ndarray


@dataclass(frozen=True)
class Scheme:
    """h: step, s · gamma: 1 for dg4, 0 for em · tolerance: of the energy equation."""

    h: float
    gamma: float = 1.0
    tolerance: float = 1e-9

    @property
    def correction(self) -> float:
        """Share of κ that is left."""
        return min(1.0, 2.0 * self.gamma)

    def exponential(self, omega: float) -> bool:
        """Whether a mode answers exactly."""
        part = 0.5 + 0.5 * np.clip(4 * self.gamma - 2, 0, 1)
        return omega * self.h < part * (EXPONENTIAL_LIMIT if omega < HIGH else LIMIT_OF_HIGH)

    def share(self, omega: float) -> float:
        """θ of a mode that does not."""
        most = RAISED + (SHARE - RAISED) * np.clip(4 * self.gamma - 3, 0, 1)
        return float(most * np.clip((omega * self.h - EXPONENTIAL_LIMIT) / (WHOLE - EXPONENTIAL_LIMIT), 0, 1))


@dataclass
class State:
    """y, v (n,): modal state, y = displacement + κ f · f (n,): modal force · force, gap (m,): λ₀, s₀ = g + C′λ₀ · eta,
    dash (m,): η of the last step, the dashpots' part of it, and their force at its end · shift: account of the
    invariant's jumps, J."""

    y: np.ndarray
    v: np.ndarray
    f: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    eta: np.ndarray
    dash: np.ndarray
    late: np.ndarray
    shift: float = 0.0

    @property
    def sampled(self) -> np.ndarray:
        """Contact forces at the end of the step, with what their dashpots do there."""
        return self.force + self.late


def solve_lcp(matrix: np.ndarray, gap: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces and active set of 0 ≤ λ ⊥ gap + matrix λ ≥ 0; matrix is a P-matrix.

    Block principal pivoting: flip everything that is violated; after four rounds without progress only the last one
    (Júdice and Pires, Comput. Oper. Res. 21, 1994; Murty's rule makes it end)."""
    active = start
    fewest, patience = len(gap) + 1, 4
    scale = np.abs(gap).max(initial=0.0) * 1e-14
    for _ in range(50 * len(gap) + 50):
        force = np.zeros(len(gap))
        if active.any():
            force[active] = np.linalg.solve(matrix[np.ix_(active, active)], -gap[active])
        slack = gap + matrix @ force
        wrong = np.where(active, force <= 0, slack < -scale)
        if not wrong.any():
            return force, active
        if wrong.sum() < fewest:
            fewest, patience = wrong.sum(), 4
        else:
            patience -= 1
        active = active ^ (wrong if patience > 0 else _last(wrong))
    raise AssertionError("the complementarity problem has no solution: its matrix is not a P-matrix")


def _last(flags: np.ndarray) -> np.ndarray:
    only = np.zeros_like(flags)
    only[np.flatnonzero(flags)[-1]] = True
    return only


@dataclass(frozen=True)
class Dashpots:
    """Where each dashpot stands, (m,) int: acts 0 or 1 · clip: η_d linear 0, at its limit ±part (λ₀ + λ₁) ±1 · hold:
    f_d linear 0, at its limit ±λ₁ ±1 · part (m,): what that limit is. And what follows: η_d = by λ₁ + fixed, f_d =
    late_by λ₁ + late_fixed."""

    acts: np.ndarray
    clip: np.ndarray
    hold: np.ndarray
    part: np.ndarray
    by: np.ndarray
    fixed: np.ndarray
    late_by: np.ndarray
    late_fixed: np.ndarray

    def stand_as(self, other: Dashpots) -> bool:
        stands = all(np.array_equal(getattr(self, name), getattr(other, name)) for name in ("acts", "clip", "hold"))
        return stands and np.allclose(self.clip * self.part, other.clip * other.part, rtol=0.0, atol=1e-12)


@dataclass(frozen=True)
class Solved:
    """λ₁ and closed contacts (m,), the dashpots, gap (m,) at λ₁ = 0, lagged (m, m): what λ₁ does to it, through the
    dashpots too."""

    force: np.ndarray
    active: np.ndarray
    dashpots: Dashpots
    gap: np.ndarray
    lagged: np.ndarray


class Reference:
    """The scheme applied to a problem: coefficients once, then `start` and `step`."""

    def __init__(self, problem: Problem, scheme: Scheme) -> None:
        self.problem, self.scheme = problem, scheme
        self.flow, self.bq, self.bv, self.kappa, self.weight = _modes(problem, scheme)
        self.w = problem.rows
        self.d = (self.w * self.bq) @ self.w.T
        self.c = problem.compliance - (self.w * self.kappa) @ self.w.T
        self.a = self.c - problem.path
        self.rounds = self.changes = self.failures = 0

    def start(self, q: np.ndarray, v: np.ndarray, external: np.ndarray) -> State:
        """State for physical modal displacements and velocities (n,) and external modal forces (n,)."""
        p = self.problem
        gap = p.offset + p.rows @ q
        force, _ = solve_lcp(p.compliance, gap, gap < 0)
        f = external + p.rows.T @ force
        y = q + self.kappa * f
        at_gap = self._gap(y, external)
        return State(y, v, f, force, np.where(force > 0, 0.0, at_gap + self.c @ force), *np.zeros((3, len(force))))

    def step(self, state: State, external: np.ndarray) -> State:
        """The state h later; `external` (n,): external modal forces at the end of the step."""
        (a11, a12), (a21, a22) = self.flow
        f = state.f + external
        y = a11 * state.y + a12 * state.v + self.bq * f
        v = a21 * state.y + a22 * state.v + self.bv * f
        gap = self._gap(y, external)
        force, eta, dash, late, shift = self._forces(gap, state)
        y = y + self.bq * (self.w.T @ (force + eta))
        v = v + self.bv * (self.w.T @ (force + eta))
        reached = gap + self.d @ (force + eta) + self.c @ force + self.a @ late
        return State(y, v, external + self.w.T @ force, force, reached, eta, dash, late, shift)

    def energy(self, state: State) -> float:
        """The invariant of the undamped step without external work: Σ weight (½v² + ½ω²y²) + ½λᵀC′λ, J, and
        what the dashpots' force holds in the compliance outside their paths."""
        modal = 0.5 * self.weight @ (state.v**2 + (self.problem.omega * state.y) ** 2)
        held = self.a @ state.late @ (state.force + 0.5 * state.late)
        return float(modal + 0.5 * state.force @ self.c @ state.force + held - state.shift)

    def _gap(self, y: np.ndarray, external: np.ndarray) -> np.ndarray:
        return self.problem.offset + self.w @ (y - self.kappa * external)

    def _forces(self, gap: np.ndarray, state: State) -> tuple:
        """λ₁, η, η_d, the dashpots' force at the end and the account of jumps: complementarity, then energy where a
        contact changed."""
        was = state.force > 0
        none = np.zeros_like(gap)
        if not was.any() and np.all(gap >= 0):
            return none, none, none, none, state.shift
        solved, eta, shift = self._solve(gap, state, was), none, state.shift
        changed = bool(np.any(solved.active != was))
        self.changes += changed
        if changed:
            solved, eta, shift = self._conserve(gap, state, solved, was)
        force, dashpots = solved.force, solved.dashpots
        dash = dashpots.by @ force + dashpots.fixed
        return force, eta + dash, dash, dashpots.late_by @ force + dashpots.late_fixed, shift

    def _solve(self, gap: np.ndarray, state: State, start: np.ndarray) -> Solved:
        """The complementarity problem with η = η_d. Where a dashpot stands follows from λ₁ and is sought; for each
        stand η_d and f_d are linear in λ₁ whether a contact is open or closed, and nothing jumps between them."""
        was = state.force > 0
        nowhere = np.zeros(len(gap), int)
        dashpots = self._dashpots(state, was.astype(int), nowhere, nowhere, np.ones(len(gap)))
        for i in range(200):
            lagged = self.d + self.d @ dashpots.by + self.a @ dashpots.late_by
            shifted = gap + self.d @ dashpots.fixed + self.a @ dashpots.late_fixed
            force, active = solve_lcp(lagged + self.c, shifted, start)
            left = np.maximum(0.0, shifted + (lagged + self.c) @ force)
            found = self._stand(state, force, was | active, left)
            if found.stand_as(dashpots):
                return Solved(force, active, dashpots, shifted, lagged)
            dashpots, start = self._towards(state, dashpots, found, last=i > ROUNDS), active
        raise AssertionError("where the dashpots stand was not found")

    def _touching(self, state: State, force: np.ndarray, left: np.ndarray) -> np.ndarray:
        """(m,): part of the step in which a contact touches that is open at one end of it; left (m,): distance at the
        end. Even motion: what it deflects when closed, by those that close or open with it, over that and the distance
        when open."""
        own, moved = self._moved(state, force, left)
        return np.where(own > 0, own / np.where(own > 0, moved, 1.0), 1.0)

    def _moved(self, state: State, force: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m,): what a contact that closes or opens deflects when closed, by all that do; that and the distance when
        open."""
        closes, opens = (state.force == 0) & (force > 0), (state.force > 0) & (force == 0)
        own = np.where(opens, self.c @ (opens * state.force), self.c @ (closes * force))
        return own, own + np.where(state.force > 0, left, np.maximum(0.0, state.gap))

    def _jump(self, state: State, solved: Solved) -> float:
        """Half the jump of the invariant in the step: its states lead the motion by h²/12 of the rate of the force."""
        force = solved.force
        own, moved = self._moved(state, force, np.maximum(0.0, solved.gap + (solved.lagged + self.c) @ force))
        passes = (own > 0) & ((state.force > 0) != (force > 0))
        power = (force - state.force) * np.square(moved) / np.where(passes, own, 1.0)
        return -min(1.0, 4 * self.scheme.gamma - 1) / 24 * float(power[passes].sum())

    def _stand(self, state: State, force: np.ndarray, closed: np.ndarray, left: np.ndarray) -> Dashpots:
        """The dashpots as λ₁ and `closed` (m,), contacts closed at either end, place them; left (m,): distance at the
        end. η_d at most doubles or cancels λ₀ + λ₁, f_d at most doubles or cancels λ₁: a contact lets go without force.
        The dashpot of a contact that closes or opens, by even motion, is at its limit until that exceeds c·speed."""
        acts, sums = (closed & (self.problem.dashpot > 0)).astype(int), state.force + force
        one = np.ones_like(force)
        linear = self._dashpots(state, acts, 0 * acts, 0 * acts, one)
        free = linear.by @ force + linear.fixed
        passes = (acts > 0) & ((state.force > 0) != (force > 0)) & (sums > 0)
        share, most = np.abs(free) / np.where(passes, sums, 1.0), self._touching(state, force, left)
        part = np.where(passes, np.where(share < 2 * most, share * (1 - share / (4 * most)), most), 1.0)
        clip = np.where(passes, np.where(free < 0, -1, 1), self._beyond(free, sums))
        clipped = self._dashpots(state, acts, clip, 0 * acts, part)
        late = clipped.late_by @ force + clipped.late_fixed
        return self._dashpots(state, acts, clip, self._beyond(late, force), part)

    def _towards(self, state: State, old: Dashpots, new: Dashpots, last: bool) -> Dashpots:
        """From one limit to the other by way of what lies between; where `last`, only the last that moves."""
        moved = (old.acts != new.acts) | (old.clip != new.clip) | (old.hold != new.hold)
        moved = _last(moved) if last else moved
        pairs = ((old.acts, new.acts), (old.clip, new.clip), (old.hold, new.hold))
        nearer = [(here, np.where(here * there == -1, 0, there)) for here, there in pairs]
        return self._dashpots(state, *(np.where(moved, there, here) for here, there in nearer), new.part)

    def _beyond(self, wished: np.ndarray, limit: np.ndarray) -> np.ndarray:
        """(m,): the sign of what is beyond ± limit, else 0."""
        return np.where(np.abs(wished) > limit, np.sign(wished), 0).astype(int)

    def _dashpots(
        self, state: State, acts: np.ndarray, clip: np.ndarray, hold: np.ndarray, part: np.ndarray
    ) -> Dashpots:
        """η_d = (2c/h) Δ(path λ) and f_d with a memory where the last step had one too (10a), or their limits."""
        p, one = self.problem, np.eye(len(acts))
        rate = (2 * acts * p.dashpot / self.scheme.h)[:, None] * p.path
        by = np.where(clip[:, None] == 0, rate, (clip * part)[:, None] * one)
        fixed = np.where(clip == 0, -rate @ state.force, clip * part * state.force)
        acted = (state.dash != 0.0) & (state.force > 0)
        beta = np.where(acted, 0.25 * (3 + MEMORY), 0.5)
        tail = np.where(acted, -0.25 * (1 - MEMORY) * state.dash - MEMORY * state.late, 0.0)
        late_by = np.where(hold[:, None] == 0, beta[:, None] * by, hold[:, None] * one)
        late_fixed = np.where((hold == 0) & (acts > 0), beta * fixed + tail, 0.0)
        return Dashpots(acts, clip, hold, part, by, fixed, late_by, late_fixed)

    def _conserve(
        self, gap: np.ndarray, state: State, solved: Solved, was: np.ndarray
    ) -> tuple[Solved, np.ndarray, float]:
        """The solution and η = α·Δg with which the step's work, without the dashpots', equals the change of ½λᵀC′λ and
        the jump of the invariant; the account of these jumps, within a tenth of the energy at the end."""
        c, d, force0 = self.c, self.d, state.force
        before = state.gap - c @ force0
        stored = 0.5 * force0 @ c @ force0
        reached = solved.gap + solved.lagged @ solved.force
        most = 0.05 * solved.force @ c @ solved.force
        shift = float(np.clip(state.shift + self._jump(state, solved), -most, most))
        direction = np.where(solved.active | was, reached - before, 0.0)
        alpha, plain = 0.0, solved
        for i in range(2 * ROUNDS):
            if i == ROUNDS:  # no root was found: without the jump
                alpha, solved, shift = 0.0, plain, state.shift
            force, active, lagged = solved.force, solved.active, solved.lagged
            z = force + alpha * direction
            moved = solved.gap + lagged @ force - before
            defect = 0.5 * force @ c @ force - stored + state.shift - shift + 0.5 * (force0 + z) @ moved
            rounding = 4e-16 * (np.abs(force0) + np.abs(force)) @ np.abs(moved)  # decides where flanks just graze
            if abs(defect) <= self.scheme.tolerance * (stored + 0.5 * np.diag(c) @ force**2) + rounding:
                return solved, alpha * direction, shift
            self.rounds += 1
            p = np.zeros_like(force)
            if active.any():
                p[active] = -np.linalg.solve((lagged + c)[np.ix_(active, active)], (d @ direction)[active])
            w, follows = p + direction, lagged @ p + d @ direction
            c1 = force @ c @ p + 0.5 * w @ moved + 0.5 * (force0 + z) @ follows
            c2 = 0.5 * p @ c @ p + 0.5 * w @ follows
            alpha -= 2 * defect / (c1 + np.copysign(np.sqrt(max(0.0, c1**2 - 4 * defect * c2)), c1))
            solved = self._solve(gap + alpha * (d @ direction), state, active)
        self.failures += 1
        return solved, alpha * direction, shift


def _modes(problem: Problem, scheme: Scheme) -> tuple[np.ndarray, ...]:
    """Flow (2, 2, n), force coefficients bq, bv (n,), equal for both ends of the step, κ (n,) and weight of the energy
    (n,)."""
    flow, rest = np.empty((2, 2, len(problem.omega))), np.empty((4, len(problem.omega)))
    for k, (w, z) in enumerate(zip(problem.omega, problem.zeta, strict=True)):
        mode = _free if w == 0 else _exponential if scheme.exponential(w) else _fast
        flow[:, :, k], *rest[:, k] = mode(scheme, w, z)
    return flow, *rest


def _free(scheme: Scheme, _: float, __: float) -> tuple[np.ndarray, float, float, float, float]:
    h = scheme.h
    return np.array([[1, h], [0, 1]]), h * h / 4, h / 2, scheme.correction * h * h / 6, 1.0


def _exponential(scheme: Scheme, w: float, z: float) -> tuple[np.ndarray, float, float, float, float]:
    """H and H_imp at rest and their slopes by Ω² there are what ρ makes equal."""
    h, one, b = scheme.h, np.eye(2), np.array([0.0, 1.0])
    flow = expm(np.array([[0, 1], [-w * w, -2 * z * w]]) * h)
    of_moment = 0.5 * h * np.linalg.solve(flow + one, (flow - one) @ b)
    at_rest = h * np.linalg.solve(one - flow, flow @ b)[0]
    matched = (w * h) ** -4 * 16 * np.sin(w * h / 2) ** 4 / np.sinc(w * h / np.pi)
    static = 1 / (w * w * (of_moment[0] + at_rest))
    rho = matched**scheme.correction * static ** (1 - scheme.correction)
    kappa = rho * (of_moment[0] + at_rest) - 1 / (w * w)
    return flow, rho * of_moment[0], rho * (h / 2 + of_moment[1]), kappa, np.sinc(w * h / np.pi) / rho


def _fast(scheme: Scheme, w: float, z: float) -> tuple[np.ndarray, float, float, float, float]:
    theta = scheme.share(w)
    longer = np.sqrt(1 - theta)
    h, c = longer * scheme.h, 2 * z * w * longer / (1 - theta)
    left = np.array([[1, -h / 2], [w * w * h / 2, 1 + c * h / 2]])
    flow = np.linalg.solve(left, [[1, h / 2], [-w * w * h / 2, 1 - c * h / 2]])
    bq, bv = (1 - theta) * np.linalg.solve(left, [0, h / 2])
    return flow, bq, bv, -theta / (w * w), 1 / (1 - theta)
