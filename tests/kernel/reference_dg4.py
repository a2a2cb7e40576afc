"""An independent reference of the time step `dg4` (and `em`) for a small problem with constant rows, in plain numpy.

Written from the formulas of the theory page alone, not from the C kernel, so that the two can be compared step by step.

The problem. Modes q_k with unit mass, q̈ + 2ζωq̇ + ω²q = F + Wᵀλ (ω = 0: rigid), unknown forces λ and their gaps
G = offset + W q + C λ. A contact has 0 ≤ λ ⊥ G ≥ 0, a bilateral row G = 0. C is the compliance of what has no mass.

The step. The force is constant in a step, λ̄ = ½(λ₀ + λ₁ + η);
modes answer exactly (ωh < 1.2) or by the trapezoidal rule.
With σ = sin(ωh)/(ωh), rows scaled by σ^(−γ/2) and the compliance C′ = C − W κ Wᵀ, κ = (1 − σ^γ)/ω² (rigid:
γh²/6), closed
contact is of 4th order for γ = 1 (Fox and Goodwin's rule for rigid modes) and of 2nd for γ = 0 (`em`).
η, along one direction
and of one scalar, makes the work of a step in which a contact opens or closes equal to the change of ½ λᵀC′λ (a
discrete
gradient after Gonzalez, J. Nonlinear Sci. 6, 1996).
"""
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

EXPONENTIAL_LIMIT = 1.2
MEMORY = 0.75  # of a dashpot's force at the end of a step
ROUNDS = 12


@dataclass(frozen=True)
class Problem:
    """Modes and unknown forces; n modes, m forces.

    omega (n,) rad/s, 0 for rigid · zeta (n,) · rows (m, n): gap per modal coordinate · compliance (m, m), m/N ·
    offset (m,), m · bilateral (m,) bool: rows that pull too · dashpot (m,), N·s/m, parallel to `path` (m, m), m/N, the part of
    the compliance that is each contact's own (all of it where not said) ·
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
        for name, default in (("bilateral", np.zeros(m, bool)), ("dashpot", np.zeros(m)), ("path", self.compliance),
                              ("weight", np.ones(m))):
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
    def reported(self) -> np.ndarray:
        """Contact forces to report: their sum times h is the impulse."""
        return self.force + 0.5 * self.eta


def solve_lcp(matrix: np.ndarray, gap: np.ndarray, bilateral: np.ndarray,
              start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
class Step:
    """What one step starts from: gap (m,) at the predicted state, gap before (m,), force0 (m,), lagged (m, m): what the
    end forces do to the gaps within the step, through the dashpots too."""

    gap: np.ndarray
    before: np.ndarray
    force0: np.ndarray
    lagged: np.ndarray


@dataclass(frozen=True)
class Dashpots:
    """η_d = lag (λ₁ − λ₀) + fixed, f_d = beta η_d + tail: lag (m, m), the others (m,). lag: rate times the rows' paths;
    opened: contacts that let go."""

    rate: np.ndarray
    opened: np.ndarray
    lag: np.ndarray
    fixed: np.ndarray
    beta: np.ndarray
    tail: np.ndarray


class Reference:
    """The scheme applied to a problem: coefficients once, then `start` and `step`."""

    def __init__(self, problem: Problem, scheme: Scheme) -> None:
        self.problem, self.scheme = problem, scheme
        self.scale, self.kappa = _corrections(problem.omega, scheme)
        self.flow, self.bq, self.bv = _flow(problem, scheme.h)
        self.w = problem.rows * self.scale
        self.d = (self.w * self.bq) @ self.w.T
        self.c = problem.compliance - (self.w * self.kappa) @ self.w.T
        self.a, self.q = self.c - problem.path, problem.compliance - problem.path
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
        return State(y, v / self.scale, f, force, np.where(closed, 0.0, at_gap + self.c @ force), *np.zeros((3, len(force))))

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
        reached = gap + self.d @ (force + eta) + self.c @ force + self._lag(dash, late)
        return State(y, v, outer + self.w.T @ force, force, reached, eta, dash, late)

    def energy(self, state: State) -> float:
        """The invariant of the undamped step without external work: ½v² + ½ω²y² + ½λᵀC′λ, J, and what the dashpots'
        force holds in the compliance outside their paths."""
        modal = 0.5 * state.v @ state.v + 0.5 * (self.problem.omega * state.y) @ (self.problem.omega * state.y)
        held = self._lag(state.dash, state.late) @ (state.force + 0.5 * state.late)
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
        before = state.gap - self.c @ state.force
        none = np.zeros_like(gap)
        if not was.any() and np.all(gap >= 0):
            return none, none, none, none
        force, active, dashpots = self._with_dashpot(gap, state, was)
        changed = bool(np.any(active != was))
        self.changes += changed
        eta = none
        if changed and s.energy:
            for _ in range(ROUNDS):  # what η opens or closes changes the dashpots
                step = Step(self._shifted(gap, state, dashpots), before, state.force, self.d + self._late(dashpots) @ dashpots.lag)
                force, eta, active = self._conserve(step, force, active, was)
                if not p.dashpot.any() or np.array_equal(was & ~active, dashpots.opened):
                    break
                dashpots = self._dashpots(state, dashpots.rate, was & ~active)
        elif not changed and s.epsilon:
            force, active = self._closed(gap, state, dashpots, was, 2 * s.epsilon)
            eta = 2 * s.epsilon * (force - state.force)
        dash = dashpots.lag @ (force - state.force) + dashpots.fixed
        return force, eta + dash, dash, dashpots.beta * dash + dashpots.tail

    def _lag(self, dash: np.ndarray, late: np.ndarray) -> np.ndarray:
        """What the dashpots' force deflects outside their paths: Q late − ½K dash, K = Q − A."""
        return self.q @ (late - 0.5 * dash) + self.a @ (0.5 * dash)

    def _late(self, dashpots: Dashpots) -> np.ndarray:
        """(m, m): what η_d does to the gaps."""
        return self.d + 0.5 * self.a + self.q * (dashpots.beta - 0.5)

    def _shifted(self, gap: np.ndarray, state: State, dashpots: Dashpots) -> np.ndarray:
        """(m,): the gaps with all of the dashpots' force that does not depend on λ₁."""
        return gap + self._late(dashpots) @ (dashpots.fixed - dashpots.lag @ state.force) + self.q @ dashpots.tail

    def _closed(self, gap: np.ndarray, state: State, dashpots: Dashpots,
                start: np.ndarray, slow: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """λ₁ and active set for η = η_d + slow (λ₁ − λ₀)."""
        lagged = self._late(dashpots) @ dashpots.lag + slow * self.d
        shifted = self._shifted(gap, state, dashpots) - slow * self.d @ state.force
        return solve_lcp(self.d + lagged + self.c, shifted, self.problem.bilateral, start)

    def _with_dashpot(self, gap: np.ndarray, state: State, was: np.ndarray) -> tuple:
        """λ₁, active set and the dashpots, η_d = (2c/h) P (λ₁ − λ₀) of closed contacts.

        A dashpot at most doubles or cancels the elastic force λ₀ + λ₁; that of a contact which lets go holds back what
        λ₀ pushes. Its force at the end of the step has a memory where the last step had one too (theory, 10a)."""
        p, force0 = self.problem, state.force
        damping = 2 * p.dashpot / self.scheme.h
        rate, opened = damping, np.zeros_like(was)
        for _ in range(200):
            dashpots = self._dashpots(state, rate, opened)
            force, active = self._closed(gap, state, dashpots, was)
            wished = np.abs(dashpots.lag @ (force - force0))
            limit = np.where(active, np.where(p.bilateral, np.inf, force0 + force), 0.0)
            over, let_go = wished > limit * (1 + 1e-13), was & ~active
            if not over.any() and np.array_equal(let_go, opened):
                return force, active, dashpots
            lowered = np.where(over, rate * np.divide(limit, wished, out=np.ones_like(rate), where=over), rate)
            rate, opened = np.where(opened & active, damping, lowered), let_go
        raise AssertionError("the limit of the dashpots was not found")

    def _dashpots(self, state: State, rate: np.ndarray, opened: np.ndarray) -> Dashpots:
        """Those of closed contacts with η_d per change of their path, and of the ones that let go."""
        p = self.problem
        acted = (state.dash != 0.0) & ((state.force > 0) | p.bilateral)
        springs_back = -np.minimum(2 * p.dashpot / self.scheme.h * (p.path @ state.force), state.force)
        rate = np.where(opened, 0.0, rate)
        beta = np.where(opened, 0.0, np.where(acted, 0.25 * (3 + MEMORY), 0.5))
        tail = np.where((rate > 0) & acted, -0.25 * (1 - MEMORY) * state.dash - MEMORY * state.late, 0.0)
        return Dashpots(rate, opened, rate[:, None] * p.path, np.where(opened, springs_back, 0.0), beta, tail)

    def _conserve(self, step: Step, force: np.ndarray, active: np.ndarray,
                  was: np.ndarray) -> tuple[np.ndarray, ...]:
        """λ₁, η = α·Δg and the active set with which the step's work, without the dashpots', equals the change of ½λᵀC′λ."""
        c, d, bilateral, before, force0 = self.c, self.d, self.problem.bilateral, step.before, step.force0
        lagged, g = step.lagged, step.gap
        stored = 0.5 * force0 @ c @ force0
        direction = np.where(active | was, self.problem.weight * (g + lagged @ force - before), 0.0)
        alpha = 0.0
        for _ in range(ROUNDS):
            z = force + alpha * direction
            moved = g + lagged @ force + alpha * (d @ direction) - before
            defect = 0.5 * force @ c @ force - stored + 0.5 * (force0 + z) @ moved
            rounding = 4e-16 * (np.abs(force0) + np.abs(force)) @ np.abs(moved)  # decides where flanks just graze
            if abs(defect) <= self.scheme.tolerance * (stored + 0.5 * np.diag(c) @ force**2) + rounding:
                return force, alpha * direction, active
            self.rounds += 1
            p = np.zeros_like(force)
            if active.any():
                p[active] = -np.linalg.solve((lagged + c)[np.ix_(active, active)], (d @ direction)[active])
            w, shift = p + direction, lagged @ p + d @ direction
            c1 = force @ c @ p + 0.5 * w @ moved + 0.5 * (force0 + z) @ shift
            c2 = 0.5 * p @ c @ p + 0.5 * w @ shift
            a = -2 * defect / (c1 + np.copysign(np.sqrt(max(0.0, c1**2 - 4 * defect * c2)), c1))
            alpha, force = alpha + a, force + a * p
            shifted = g + alpha * (d @ direction)
            if np.any(active & ~bilateral & (force <= 0)) or np.any(~active & (shifted + (lagged + c) @ force < 0)):
                force, active = solve_lcp(lagged + c, shifted, bilateral, active)
        self.failures += 1
        return force, alpha * direction, active


def _corrections(omega: np.ndarray, scheme: Scheme) -> tuple[np.ndarray, np.ndarray]:
    """Scale s of the rows and correction κ of the compliance, per mode."""
    x = omega * scheme.h
    exact = (x < EXPONENTIAL_LIMIT) & (omega > 0)
    sigma = np.sinc(np.where(exact, x, 0.0) / np.pi)
    kappa = np.where(exact, (1 - sigma**scheme.gamma) / np.where(exact, omega, 1.0) ** 2, 0.0)
    kappa[omega == 0] = scheme.gamma * scheme.h**2 / 6
    return sigma ** (-0.5 * scheme.gamma), kappa


def _flow(problem: Problem, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flow (2, 2, n) and force coefficients bq, bv (n,), equal for both ends of the step."""
    omega, zeta = problem.omega, problem.zeta
    flow, bq, bv = np.empty((2, 2, len(omega))), np.empty(len(omega)), np.empty(len(omega))
    for k, (w, z) in enumerate(zip(omega, zeta, strict=True)):
        if w == 0:
            flow[:, :, k], bq[k], bv[k] = [[1, h], [0, 1]], h * h / 4, h / 2
        elif w * h < EXPONENTIAL_LIMIT:
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
