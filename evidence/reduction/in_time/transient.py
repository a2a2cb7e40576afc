"""Bodies in time, whole or reduced, joined by springs and unilateral contacts: one implicit scheme for all of them.

    Mᵢ q̈ᵢ + Kᵢ qᵢ = Bᵢᵀ pᵢ,    yᵢ = Bᵢ qᵢ + Rᵢ pᵢ,    pᵢ = Lᵢ s(t) − Jᵢᵀ t,    e = Σ Jᵢ yᵢ + g₀,
    t = k e (spring),   t = k min(e, 0) (contact of gap e),

q the unknowns of a body of finite elements or its reduced coordinates, B the rows of its interfaces, R the static
flexibility of the modes left out (0 of whole bodies). Displacements and rotations are small, about where the run
begins. HHT-α (α ≤ 0, β = (1 − α)²/4, γ = ½ − α): with c = (1 + α) β h²

    M a₁ + (1 + α)(K q₁ − Bᵀ p₁) − α (K q₀ − Bᵀ p₀) = 0,   q₁ = q₀ + h v₀ + h²[(½ − β) a₀ + β a₁],

second order, unconditionally stable for linear systems, energy kept at α = 0. Each body is factorised once, M + c K;
joints meet in the small system (Σ J (c B (M + cK)⁻¹ Bᵀ + R) Jᵀ + 1/k) t = e_free, its contacts an active set.
Source: Hilber, Hughes & Taylor, Earthq. Eng. Struct. Dyn. 5 (1977) 283; Hughes, The Finite Element Method, ch. 9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sl
import scipy.optimize as so
import scipy.sparse as sp

from gearfmu.errors import BodyError
from gearfmu.fem.solver import definite_factor
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.oscillators import Oscillators

_ROUNDS = 30  # active sets tried in a step before the slower, certain way


@dataclass(frozen=True, eq=False)
class Member:
    """A body of the run, in the terms of the head of this file.

    mass, stiffness : (N, N); diagonal of a reduced body. rows : (p, N) of all interfaces in their order; rigid (N, r):
    unit rigid motion. residual : (p, p), m/N. body : the finite elements where they are not reduced.
    """

    name: str
    mass: sp.csr_array
    stiffness: sp.csr_array
    rows: sp.csr_array | np.ndarray
    rigid: np.ndarray
    residual: np.ndarray
    body: FullOrder | None = None

    @classmethod
    def whole(cls, body: FullOrder) -> Member:
        """The finite elements themselves. BodyError when something is held by constraint."""
        if body.constraints is not None:
            raise BodyError(f"{body.name}: a body with constraints has no mass of its own; hold it by springs")
        rows = body.rows()
        return cls(body.name, body.mass, body.stiffness, rows, body.rigid, np.zeros((rows.shape[0],) * 2), body)

    @classmethod
    def reduced(cls, model: Oscillators, residual: bool = False) -> Member:
        """Rigid motion and oscillators; residual: with the static flexibility of what they leave out."""
        lower = np.linalg.cholesky(model.rigid_mass)
        rigid = model.rigid_mass.shape[0]
        rows = np.hstack([sl.solve_triangular(lower, model.rigid_rows.T, lower=True).T, model.rows])
        squared = np.concatenate([np.zeros(rigid), model.omega**2])
        start = np.vstack([lower.T, np.zeros((model.size, rigid))])
        extra = model.residual() if residual else np.zeros_like(model.static)
        mass, stiffness = (sp.csr_array(sp.diags_array(values)) for values in (np.ones_like(squared), squared))
        return cls(model.name, mass, stiffness, rows, start, extra)

    def solver(self, factor: float) -> Callable[[np.ndarray], np.ndarray]:
        """(M + factor K)⁻¹ of columns (N, k)."""
        matrix = sp.csr_array(self.mass + factor * self.stiffness)
        if self.body is None:
            inverse = 1 / matrix.diagonal()
            return lambda loads: inverse[:, None] * loads
        return definite_factor(matrix, self.body.cells, self.body.node_of_dof).solve


@dataclass(frozen=True)
class Joints:
    """Springs and contacts between members.

    rows : one (j, p) matrix J a member, of its interface rows. stiffness (j,) N/m or N·m/rad; gap (j,) m, 0 of springs;
    unilateral (j,) bool: a contact, which only presses.
    """

    rows: tuple[sp.csr_array, ...]
    stiffness: np.ndarray
    gap: np.ndarray
    unilateral: np.ndarray

    @property
    def count(self) -> int:
        """Number j of joints."""
        return len(self.stiffness)


@dataclass(frozen=True)
class Assembly:
    """Members, their joints, what loads them and how they begin.

    patterns : per member (p,) loads at its interfaces, N or N·m; history : their common factor over time (s), 0 at 0.
    start : per member (r,) speeds of rigid motion, m/s and rad/s.
    """

    members: tuple[Member, ...]
    joints: Joints
    patterns: tuple[np.ndarray, ...]
    history: Callable[[float], float]
    start: tuple[np.ndarray, ...]

    def with_members(self, *others: Member) -> Assembly:
        """The same assembly with members of the same names replaced."""
        by_name = {member.name: member for member in others}
        assert set(by_name) <= {member.name for member in self.members}
        return replace(self, members=tuple(by_name.get(member.name, member) for member in self.members))


@dataclass(frozen=True)
class Motion:
    """time (T,) s; interfaces: name of member → (T, p) displacements of its rows; tension (T, j) N of the joints;
    energy (T,) J: kinetic, elastic and that of the joints (without residuals)."""

    time: np.ndarray
    interfaces: dict[str, np.ndarray]
    tension: np.ndarray
    energy: np.ndarray


@dataclass(frozen=True)
class Scheme:
    """Step h (s), end of the run (s) and α of HHT, −1/3 … 0."""

    step: float
    end: float
    alpha: float = -0.05

    @property
    def steps(self) -> int:
        """Number of steps."""
        return round(self.end / self.step)


def integrate(assembly: Assembly, scheme: Scheme) -> Motion:
    """The run. BodyError for α outside its bounds, a load that begins with a jump, or contacts closed at the start."""
    _check(assembly, scheme)
    joints, steps = assembly.joints, scheme.steps
    states = [_State(member, start, scheme) for member, start in zip(assembly.members, assembly.start, strict=True)]
    parts = [state.compliance(rows) for state, rows in zip(states, joints.rows, strict=True)]
    solver = _JointSolver(joints, np.sum(parts, axis=0))
    motion = Motion(
        np.arange(steps + 1) * scheme.step,
        {state.member.name: np.zeros((steps + 1, state.member.rows.shape[0])) for state in states},
        np.zeros((steps + 1, joints.count)),
        np.zeros(steps + 1),
    )
    motion.energy[0] = sum(state.energy() for state in states)
    for n in range(1, steps + 1):
        factor = assembly.history(motion.time[n])
        for state, pattern in zip(states, assembly.patterns, strict=True):
            state.predict(factor * pattern)
        free = joints.gap + sum(rows @ state.reading for rows, state in zip(joints.rows, states, strict=True))
        tension = solver.solve(free)
        for state, rows in zip(states, joints.rows, strict=True):
            motion.interfaces[state.member.name][n] = state.correct(rows.T @ tension)
        motion.tension[n] = tension
        motion.energy[n] = sum(state.energy() for state in states) + 0.5 * np.sum(tension**2 / joints.stiffness)
    return motion


def _check(assembly: Assembly, scheme: Scheme) -> None:
    if not -1 / 3 <= scheme.alpha <= 0:
        raise BodyError(f"alpha = {scheme.alpha}: HHT-α is stable and of second order from −1/3 to 0 only")
    if assembly.history(0.0) != 0.0:
        raise BodyError("a load begins with a jump: let its history grow from 0, so that the first acceleration is 0")
    if np.any(assembly.joints.gap[assembly.joints.unilateral] < 0):
        raise BodyError("contacts are closed at the start: begin with gaps of 0 or more")


class _State:
    """One member in motion: q, v, a, and what its interfaces carried."""

    def __init__(self, member: Member, start: np.ndarray, scheme: Scheme):
        self.member, self.h, self.alpha = member, scheme.step, scheme.alpha
        self.beta, self.gamma = (1 - scheme.alpha) ** 2 / 4, 0.5 - scheme.alpha
        self.q = np.zeros(member.mass.shape[0])
        self.v, self.a = member.rigid @ start, np.zeros_like(self.q)
        self.force = np.zeros(member.rows.shape[0])
        self._solve = member.solver((1 + self.alpha) * self.beta * self.h**2)
        loads = member.rows.T.toarray() if sp.issparse(member.rows) else member.rows.T
        self._response = (1 + self.alpha) * self._solve(loads)
        self.reading = np.zeros_like(self.force)

    def compliance(self, rows: sp.csr_array) -> np.ndarray:
        """What tensions of the joints move at the joints within a step: (j, j)."""
        own = self.beta * self.h**2 * (self.member.rows @ self._response) + self.member.residual
        return rows @ (rows @ own).T

    def predict(self, load: np.ndarray) -> None:
        """The step as it were without the joints' tension at its end; sets `reading`."""
        one, alpha, member = 1 + self.alpha, self.alpha, self.member
        before, h = self.q, self.h
        self.q = before + h * self.v + h * h * (0.5 - self.beta) * self.a
        self.v = self.v + h * (1 - self.gamma) * self.a
        force = member.rows.T @ (one * load - alpha * self.force) - member.stiffness @ (one * self.q - alpha * before)
        self.a = self._solve(force[:, None])[:, 0]
        self.force = load
        self.reading = member.rows @ (self.q + self.beta * h * h * self.a) + member.residual @ load

    def correct(self, tension: np.ndarray) -> np.ndarray:
        """The end of the step under the joints' tension (p,) on the interfaces; their displacement (p,)."""
        self.a = self.a - self._response @ tension
        self.q = self.q + self.beta * self.h**2 * self.a
        self.v = self.v + self.gamma * self.h * self.a
        self.force = self.force - tension
        return self.member.rows @ self.q + self.member.residual @ self.force

    def energy(self) -> float:
        """½ vᵀ M v + ½ qᵀ K q."""
        return float(0.5 * (self.v @ (self.member.mass @ self.v) + self.q @ (self.member.stiffness @ self.q)))


class _JointSolver:
    """(S + 1/k) t = e, contacts t ≤ 0 where they are closed: a set that is tried again until it does not change, from
    that of the last step; non-negative least squares where it goes round in circles."""

    def __init__(self, joints: Joints, compliance: np.ndarray):
        self.matrix = 0.5 * (compliance + compliance.T) + np.diag(1 / joints.stiffness)
        self.unilateral = joints.unilateral
        self.active = ~joints.unilateral

    def solve(self, free: np.ndarray) -> np.ndarray:
        """Tensions (j,) for the elongations `free` (j,) that the joints would have without."""
        for _ in range(_ROUNDS):
            tension = self._with(self.active, free)
            left = free - self.matrix @ tension
            active = ~self.unilateral | np.where(self.active, tension < 0, left < 0)
            if np.array_equal(active, self.active):
                return tension
            self.active = active
        return self._certain(free)

    def _with(self, active: np.ndarray, free: np.ndarray) -> np.ndarray:
        tension = np.zeros_like(free)
        at = np.flatnonzero(active)
        if len(at):
            tension[at] = sl.solve(self.matrix[np.ix_(at, at)], free[at], assume_a="pos")
        return tension

    def _certain(self, free: np.ndarray) -> np.ndarray:
        """Springs eliminated, min ½ tᵀ Q t − bᵀ t over t ≤ 0 by Lawson & Hanson's algorithm."""
        one, two = np.flatnonzero(self.unilateral), np.flatnonzero(~self.unilateral)
        springs = self.matrix[np.ix_(two, two)]
        across = np.linalg.solve(springs, np.column_stack([self.matrix[np.ix_(two, one)], free[two]]))
        schur = self.matrix[np.ix_(one, one)] - self.matrix[np.ix_(one, two)] @ across[:, :-1]
        lower = np.linalg.cholesky(0.5 * (schur + schur.T))
        wanted = free[one] - self.matrix[np.ix_(one, two)] @ across[:, -1]
        pressed, _ = so.nnls(lower.T, -sl.solve_triangular(lower, wanted, lower=True))
        self.active[one] = pressed > 0
        return self._with(self.active, free)
