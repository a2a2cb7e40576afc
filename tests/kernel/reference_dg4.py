"""An independent reference of the time step `dg4` (and `em`) for a small problem with constant rows, in plain numpy.

Written from the formulas of the theory page alone, not from the C kernel, so that the two can be compared step by step.

The problem. Modes q_k with unit mass, q̈ + 2ζωq̇ + ω²q = F + Wᵀλ (ω = 0: rigid), unknown forces λ and their gaps
G = offset + W q + C λ. A contact has 0 ≤ λ ⊥ G ≥ 0, a bilateral row G = 0. C is the compliance of what has no mass.

The step. The force is constant in a step, λ̄ = ½(λ₀ + λ₁ + η);
modes answer exactly (ωh < 1.2) or by the trapezoidal rule.
With σ = sin(ωh)/(ωh), p = min(1, 2γ), rows scaled by σ^(−p/2) and the compliance C′ = C − W κ Wᵀ, κ = (1 − σ^p)/ω²
(rigid: ph²/6), closed contact is of 4th order for γ = 1 (Fox and Goodwin's rule for rigid modes) and of 2nd for γ = 0
(`em`). γ between ½ and 1 makes modes trapezoidal from ωh = 1.2γ on. Exponential modes are damped by ζσ^p.
η, along one direction
and of one scalar, makes the work of a step in which a contact opens or closes equal to the change of ½ λᵀC′λ (a
discrete
gradient after Gonzalez, J. Nonlinear Sci. 6, 1996).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

EXPONENTIAL_LIMIT = 1.2
MEMORY = 0.25  # of a dashpot's force at the end of a step
ROUNDS = 12


@dataclass(frozen=True)
class Problem:
    """Modes and unknown forces; n modes, m forces.

    omega (n,) rad/s, 0 for rigid · zeta (n,) · rows (m, n): gap per modal coordinate · compliance (m, m), m/N ·
    offset (m,), m · bilateral (m,) bool: rows that pull too · dashpot (m,), N·s/m, parallel to `path` (m, m), m/N,
    the part of the compliance that is each contact's own (all of it where not said) ·
    weight (m,): share of a row in η, proportional to the length it stands for.
    """

    omega: np.ndarray
    zeta: np.ndarray
    rows: np.ndarray
    compliance: np.ndarray
    offset: np.ndarray
    bilateral: np.ndarray = field(default=None)
    dashpot: np.ndarray = field(default=None)
    path: np.ndarray = field(default=None)
    weight: np.ndarray = field(default=None)

    def __post_init__(self) -> None:
        m = len(self.offset)
        for name, default in (
            ("bilateral", np.zeros(m, bool)),
            ("dashpot", np.zeros(m)),
            ("path", self.compliance),
            ("weight", np.ones(m)),
        ):
            if getattr(self, name) is None:
                object.__setattr__(self, name, default)


@dataclass(frozen=True)
class Scheme:
    """h: step, s · gamma: 1 for dg4, 0 for em · energy: whether a change of contact is made to conserve energy ·
    epsilon: dissipation of closed steps, η = 2ε(λ₁ − λ₀) · tolerance: of the energy equation."""

    h: float
    gamma: float = 1.0
    energy: bool = True
    epsilon: float = 0.0
    tolerance: float = 1e-9

    @property
    def power(self) -> float:
        """Of σ in the corrections."""
        return min(1.0, 2.0 * self.gamma)

    @property
    def exponential_below(self) -> float:
        """Modes with ωh below it answer exactly."""
        return EXPONENTIAL_LIMIT * max(self.gamma, 0.5)


@dataclass
class State:
    """y, v (n,): scaled modal state · f (n,): scaled modal force · force, gap (m,): λ₀, s₀ = g + C′λ₀ · eta, dash (m,):
    η of the last step, the dashpots' part of it, and their force at its end."""

    y: np.ndarray
    v: np.ndarray
    f: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    eta: np.ndarray
    dash: np.ndarray
    late: np.ndarray

    @property
    def sampled(self) -> np.ndarray:
        """Contact forces at the end of the step, with what their dashpots do there."""
        return self.force + self.late

    @property
    def reported(self) -> np.ndarray:
        """Contact forces whose sum times h is the impulse."""
        return self.force + 0.5 * self.eta


def solve_lcp(
    matrix: np.ndarray, gap: np.ndarray, bilateral: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forces and active set of 0 ≤ λ ⊥ gap + matrix λ ≥ 0 (bilateral rows: = 0, λ of any sign); matrix is a P-matrix.

    Block principal pivoting: flip everything that is violated; after four rounds without progress only the last one
    (Júdice and Pires, Comput. Oper. Res. 21, 1994; Murty's rule makes it end)."""
    active = start | bilateral
    fewest, patience = len(gap) + 1, 4
    scale = np.abs(gap).max(initial=0.0) * 1e-14
    for _ in range(50 * len(gap) + 50):
        force = np.zeros(len(gap))
        if active.any():
            force[active] = np.linalg.solve(matrix[np.ix_(active, active)], -gap[active])
        slack = gap + matrix @ force
        wrong = np.where(active, force <= 0, slack < -scale) & ~bilateral
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
    """Where each dashpot stands, (m,) int: acts 0 or 1 · clip: η_d linear 0, at its limit ±(λ₀ + λ₁) ±1 · hold: f_d
    linear 0, at its limit ±λ₁ ±1. And what follows: η_d = by λ₁ + fixed, f_d = late_by λ₁ + late_fixed."""

    acts: np.ndarray
    clip: np.ndarray
    hold: np.ndarray
    by: np.ndarray
    fixed: np.ndarray
    late_by: np.ndarray
    late_fixed: np.ndarray

    def stand_as(self, other: Dashpots) -> bool:
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in ("acts", "clip", "hold"))


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
        self.scale, self.kappa = _corrections(problem.omega, scheme)
        self.flow, self.bq, self.bv = _flow(problem, scheme)
        self.w = problem.rows * self.scale
        self.d = (self.w * self.bq) @ self.w.T
        self.c = problem.compliance - (self.w * self.kappa) @ self.w.T
        self.a = self.c - problem.path
        self.rounds = self.changes = self.failures = 0

    def mu(self) -> float:
        """μ′ = 1 − λ_min(C^−½ C′ C^−½): 0 for h → 0; the energy is no longer positive beyond 1."""
        root = np.linalg.cholesky(self.problem.compliance)
        scaled = np.linalg.solve(root, np.linalg.solve(root, self.c).T)
        return float(1 - np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).min())

    def start(self, q: np.ndarray, v: np.ndarray, external: np.ndarray) -> State:
        """State for physical modal displacements and velocities (n,) and external modal forces (n,)."""
        p = self.problem
        gap = p.offset + p.rows @ q
        force, _ = solve_lcp(p.compliance, gap, p.bilateral, gap < 0)
        f = self.scale * (external + p.rows.T @ force)
        y = q / self.scale + self.kappa * f
        at_gap = self._gap(y, external)
        closed = (force > 0) | p.bilateral
        return State(
            y, v / self.scale, f, force, np.where(closed, 0.0, at_gap + self.c @ force), *np.zeros((3, len(force)))
        )

    def step(self, state: State, external: np.ndarray) -> State:
        """The state h later; `external` (n,): unscaled external modal forces at the end of the step."""
        outer = self.scale * external
        (a11, a12), (a21, a22) = self.flow
        f = state.f + outer
        y = a11 * state.y + a12 * state.v + self.bq * f
        v = a21 * state.y + a22 * state.v + self.bv * f
        gap = self._gap(y, external)
        force, eta, dash, late = self._forces(gap, state)
        y = y + self.bq * (self.w.T @ (force + eta))
        v = v + self.bv * (self.w.T @ (force + eta))
        reached = gap + self.d @ (force + eta) + self.c @ force + self.a @ late
        return State(y, v, outer + self.w.T @ force, force, reached, eta, dash, late)

    def energy(self, state: State) -> float:
        """The invariant of the undamped step without external work: ½v² + ½ω²y² + ½λᵀC′λ, J, and what the dashpots'
        force holds in the compliance outside their paths."""
        modal = 0.5 * state.v @ state.v + 0.5 * (self.problem.omega * state.y) @ (self.problem.omega * state.y)
        held = self.a @ state.late @ (state.force + 0.5 * state.late)
        return float(modal + 0.5 * state.force @ self.c @ state.force + held)

    def displacement(self, state: State) -> np.ndarray:
        """Physical modal displacements (n,)."""
        return self.scale * (state.y - self.kappa * state.f)

    def velocity(self, state: State) -> np.ndarray:
        """Physical modal velocities (n,); of second order where the force changes."""
        return self.scale * state.v

    def _gap(self, y: np.ndarray, external: np.ndarray) -> np.ndarray:
        return self.problem.offset + self.w @ (y - self.kappa * self.scale * external)

    def _forces(self, gap: np.ndarray, state: State) -> tuple[np.ndarray, ...]:
        """λ₁, η, η_d and the dashpots' force at the end: complementarity, then energy where a contact changed, or
        dissipation where none did."""
        p, s = self.problem, self.scheme
        was = (state.force > 0) | p.bilateral
        none = np.zeros_like(gap)
        if not was.any() and np.all(gap >= 0):
            return none, none, none, none
        solved, eta = self._solve(gap, state, was), none
        changed = bool(np.any(solved.active != was))
        self.changes += changed
        if changed and s.energy:
            solved, eta = self._conserve(gap, state, solved, was)
        elif not changed and s.epsilon:
            solved = self._solve(gap, state, was, 2 * s.epsilon)
            eta = 2 * s.epsilon * (solved.force - state.force)
        force, dashpots = solved.force, solved.dashpots
        dash = dashpots.by @ force + dashpots.fixed
        return force, eta + dash, dash, dashpots.late_by @ force + dashpots.late_fixed

    def _solve(self, gap: np.ndarray, state: State, start: np.ndarray, slow: float = 0.0) -> Solved:
        """The complementarity problem with η = η_d + slow (λ₁ − λ₀). Where a dashpot stands follows from λ₁ and is
        sought; for each stand η_d and f_d are linear in λ₁ whether a contact is open or closed, and nothing jumps
        between them."""
        was = (state.force > 0) | self.problem.bilateral
        nowhere = np.zeros(len(gap), int)
        dashpots = self._dashpots(state, was.astype(int), nowhere, nowhere)
        for i in range(200):
            lagged = (1 + slow) * self.d + self.d @ dashpots.by + self.a @ dashpots.late_by
            shifted = gap + self.d @ (dashpots.fixed - slow * state.force) + self.a @ dashpots.late_fixed
            force, active = solve_lcp(lagged + self.c, shifted, self.problem.bilateral, start)
            found = self._stand(state, force, was | active)
            if found.stand_as(dashpots):
                return Solved(force, active, dashpots, shifted, lagged)
            dashpots, start = self._towards(state, dashpots, found, last=i > ROUNDS), active
        raise AssertionError("where the dashpots stand was not found")

    def _stand(self, state: State, force: np.ndarray, closed: np.ndarray) -> Dashpots:
        """The dashpots as λ₁ and `closed` (m,), contacts closed at either end, place them. η_d at most doubles or
        cancels λ₀ + λ₁, f_d at most doubles or cancels λ₁: a contact lets go without force."""
        acts = (closed & (self.problem.dashpot > 0)).astype(int)
        linear = self._dashpots(state, acts, 0 * acts, 0 * acts)
        clip = self._beyond(linear.by @ force + linear.fixed, state.force + force)
        clipped = self._dashpots(state, acts, clip, 0 * acts)
        return self._dashpots(state, acts, clip, self._beyond(clipped.late_by @ force + clipped.late_fixed, force))

    def _towards(self, state: State, old: Dashpots, new: Dashpots, last: bool) -> Dashpots:
        """From one limit to the other by way of what lies between; where `last`, only the last that moves."""
        moved = (old.acts != new.acts) | (old.clip != new.clip) | (old.hold != new.hold)
        moved = _last(moved) if last else moved
        pairs = ((old.acts, new.acts), (old.clip, new.clip), (old.hold, new.hold))
        nearer = [(here, np.where(here * there == -1, 0, there)) for here, there in pairs]
        return self._dashpots(state, *(np.where(moved, there, here) for here, there in nearer))

    def _beyond(self, wished: np.ndarray, limit: np.ndarray) -> np.ndarray:
        """(m,): the sign of what is beyond ± limit, else 0. Bilateral rows have no limit."""
        return np.where((np.abs(wished) > limit) & ~self.problem.bilateral, np.sign(wished), 0).astype(int)

    def _dashpots(self, state: State, acts: np.ndarray, clip: np.ndarray, hold: np.ndarray) -> Dashpots:
        """η_d = (2c/h) Δ(path λ) and f_d with a memory where the last step had one too (10a), or their limits."""
        p, one = self.problem, np.eye(len(acts))
        rate = (2 * acts * p.dashpot / self.scheme.h)[:, None] * p.path
        by = np.where(clip[:, None] == 0, rate, clip[:, None] * one)
        fixed = np.where(clip == 0, -rate @ state.force, clip * state.force)
        acted = (state.dash != 0.0) & ((state.force > 0) | p.bilateral)
        beta = np.where(acted, 0.25 * (3 + MEMORY), 0.5)
        tail = np.where(acted, -0.25 * (1 - MEMORY) * state.dash - MEMORY * state.late, 0.0)
        late_by = np.where(hold[:, None] == 0, beta[:, None] * by, hold[:, None] * one)
        late_fixed = np.where((hold == 0) & (acts > 0), beta * fixed + tail, 0.0)
        return Dashpots(acts, clip, hold, by, fixed, late_by, late_fixed)

    def _conserve(self, gap: np.ndarray, state: State, solved: Solved, was: np.ndarray) -> tuple[Solved, np.ndarray]:
        """The solution and η = α·Δg with which the step's work, without the dashpots', equals the change of ½λᵀC′λ."""
        c, d, force0 = self.c, self.d, state.force
        before = state.gap - c @ force0
        stored = 0.5 * force0 @ c @ force0
        reached = solved.gap + solved.lagged @ solved.force
        direction = np.where(solved.active | was, self.problem.weight * (reached - before), 0.0)
        alpha = 0.0
        for _ in range(ROUNDS):
            force, active, lagged = solved.force, solved.active, solved.lagged
            z = force + alpha * direction
            moved = solved.gap + lagged @ force - before
            defect = 0.5 * force @ c @ force - stored + 0.5 * (force0 + z) @ moved
            rounding = 4e-16 * (np.abs(force0) + np.abs(force)) @ np.abs(moved)  # decides where flanks just graze
            if abs(defect) <= self.scheme.tolerance * (stored + 0.5 * np.diag(c) @ force**2) + rounding:
                return solved, alpha * direction
            self.rounds += 1
            p = np.zeros_like(force)
            if active.any():
                p[active] = -np.linalg.solve((lagged + c)[np.ix_(active, active)], (d @ direction)[active])
            w, shift = p + direction, lagged @ p + d @ direction
            c1 = force @ c @ p + 0.5 * w @ moved + 0.5 * (force0 + z) @ shift
            c2 = 0.5 * p @ c @ p + 0.5 * w @ shift
            alpha -= 2 * defect / (c1 + np.copysign(np.sqrt(max(0.0, c1**2 - 4 * defect * c2)), c1))
            solved = self._solve(gap + alpha * (d @ direction), state, active)
        self.failures += 1
        return solved, alpha * direction


def _corrections(omega: np.ndarray, scheme: Scheme) -> tuple[np.ndarray, np.ndarray]:
    """Scale s of the rows and correction κ of the compliance, per mode."""
    x = omega * scheme.h
    exact = (x < scheme.exponential_below) & (omega > 0)
    sigma = np.sinc(np.where(exact, x, 0.0) / np.pi) ** scheme.power
    kappa = np.where(exact, (1 - sigma) / np.where(exact, omega, 1.0) ** 2, 0.0)
    kappa[omega == 0] = scheme.power * scheme.h**2 / 6
    return sigma**-0.5, kappa


def _flow(problem: Problem, scheme: Scheme) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flow (2, 2, n) and force coefficients bq, bv (n,), equal for both ends of the step."""
    omega, zeta, h = problem.omega, problem.zeta, scheme.h
    flow, bq, bv = np.empty((2, 2, len(omega))), np.empty(len(omega)), np.empty(len(omega))
    for k, (w, z) in enumerate(zip(omega, zeta, strict=True)):
        if w == 0:
            flow[:, :, k], bq[k], bv[k] = [[1, h], [0, 1]], h * h / 4, h / 2
        elif w * h < scheme.exponential_below:
            z *= np.sinc(w * h / np.pi) ** scheme.power
            wd, decay = w * np.sqrt(1 - z * z), np.exp(-z * w * h)
            cosine, sine = decay * np.cos(wd * h), decay * np.sin(wd * h) / wd
            flow[:, :, k] = [[cosine + z * w * sine, sine], [-w * w * sine, cosine - z * w * sine]]
            bq[k], bv[k] = (1 - flow[0, 0, k]) / (2 * w * w), sine / 2
        else:
            c = 2 * z * w
            left = np.array([[1, -h / 2], [w * w * h / 2, 1 + c * h / 2]])
            flow[:, :, k] = np.linalg.solve(left, [[1, h / 2], [-w * w * h / 2, 1 - c * h / 2]])
            bq[k], bv[k] = np.linalg.solve(left, [0, h / 2])
    return flow, bq, bv
