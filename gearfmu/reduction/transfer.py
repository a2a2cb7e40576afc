"""Transfer matrices of full and reduced bodies and their distance, the relative Frobenius error (paper eq. 3), by which
reduction methods are judged.

    H(Ω) = Σ N Nᵀ/(ω²(1 + 2iζ) − Ω²) + rigid motion,    e(Ω) = ‖H − H̄‖_F / ‖H‖_F

between the interfaces that are not ground, the ground interfaces of a free body held. Structural damping K(1 + 2iζ),
the same in both, is modal damping ζ at resonance. Rotations are multiplied, moments divided, by the body's length.

Reference: the full model on so many moments (`moments`: 0 and points in the band) that the next blocks change H
nowhere in the band by more than 1e-12 of its norm or by what rounding leaves. Theory, eqs. 26 and 27.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.errors import BodyError
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import BAND, Expansion, Growing, Size
from gearfmu.reduction.oscillators import Oscillators, decoupled, oscillators

LINES = 400
_POINTS = (0.0, 0.5, 1.0)  # expansion points of a reference, in parts of the band's upper end
_CONVERGED = 1e-12
_ROUNDING = 1e-9  # below this a change that no longer shrinks is rounding
_BLOCKS = 24
_CHECKED = 25  # lines at which the growth of a reference is watched


@dataclass(frozen=True)
class Judging:
    """Lines and damping of a comparison: frequency (F,) Hz, damping ratio ζ of K(1 + 2iζ)."""

    frequency: np.ndarray
    damping_ratio: float = 0.01

    @classmethod
    def over(cls, band: tuple[float, float] = BAND, lines: int = LINES, damping_ratio: float = 0.01) -> Judging:
        """Logarithmically spaced lines over a band, Hz."""
        return cls(np.geomspace(*band, lines), damping_ratio)


@dataclass(frozen=True)
class Reference:
    """Full-order transfer matrix: H (F, m, m), m/N; `labels` of its rows; change : by how much the last block of
    moments moved it at most, relative; size : vectors it took."""

    judging: Judging
    matrix: np.ndarray
    labels: tuple[tuple[str, str], ...]
    change: float
    size: int


def transfer(model: Oscillators, judging: Judging, ground: tuple[str, ...] = (), residual: bool = False) -> np.ndarray:
    """H (F, m, m) of a reduced body, rotations scaled, `ground` held. residual : with the static residual of the modes
    left out."""
    rows, rigid = model.rows * model.scales[:, None], model.rigid_rows * model.scales[:, None]
    extra = model.residual() * np.outer(model.scales, model.scales) if residual else np.zeros((len(rows),) * 2)
    held, free = model.select(*ground), np.setdiff1d(np.arange(len(rows)), model.select(*ground))
    stiffness = 1 + 2j * judging.damping_ratio
    result = np.empty((len(judging.frequency), len(free), len(free)), complex)
    for line, f in enumerate(judging.frequency):
        squared = (2 * np.pi * f) ** 2
        receptance = 1 / (model.omega**2 * stiffness - squared)
        h = (rows * receptance.real) @ rows.T + 1j * ((rows * receptance.imag) @ rows.T) + extra / stiffness
        result[line] = _held(h, rigid, -squared * model.rigid_mass, free, held)
    return result


def _held(h: np.ndarray, rigid: np.ndarray, dynamic: np.ndarray, free: np.ndarray, held: np.ndarray) -> np.ndarray:
    """H between `free` rows with `held` rows at rest, rigid motion (dynamic stiffness −Ω²M_r) solved for along with the
    reactions, so that its large part at low frequency never appears: [−Ω²M_r Gᵀ; G −H_gg] [q_r; λ] = [R_fᵀ; −H_gf]."""
    count = rigid.shape[1]
    if not count and not len(held):
        return h
    system = np.block([[dynamic, rigid[held].T], [rigid[held], -h[np.ix_(held, held)]]])
    known = np.vstack([rigid[free].T, -h[np.ix_(held, free)]])
    size = np.sqrt(np.abs(system).max(axis=1))
    solved = np.linalg.solve(system / np.outer(size, size), known / size[:, None]) / size[:, None]
    return h[np.ix_(free, free)] + rigid[free] @ solved[:count] - h[np.ix_(free, held)] @ solved[count:]


def relative_error(reference: np.ndarray, model: np.ndarray) -> np.ndarray:
    """‖H − H̄‖_F/‖H‖_F at every line (F,)."""
    return np.linalg.norm(reference - model, axis=(1, 2)) / np.linalg.norm(reference, axis=(1, 2))


def reference(body: FullOrder, judging: Judging) -> Reference:
    """The full model's H at all lines. Raises BodyError when its moments do not converge."""
    top = 2 * np.pi * judging.frequency.max()
    moments = _Moments(body, [(share * top) ** 2 for share in _POINTS])
    step = max(1, len(judging.frequency) // _CHECKED)
    watched = Judging(judging.frequency[::step], judging.damping_ratio)
    without_residual = np.zeros((len(moments.rows),) * 2)
    last: np.ndarray | None = None
    best = float("inf")
    for _ in range(_BLOCKS):
        grown = moments.grow()
        model = decoupled(body, moments.stiffness, moments.rows, without_residual, judging.damping_ratio)
        now = transfer(model, watched, body.ground)
        change = float("inf") if last is None else float(relative_error(now, last).max())
        if change < _CONVERGED or not grown or (best < _ROUNDING and change > 0.2 * best):
            labels = tuple(label for label in model.labels if label[0] not in body.ground)
            matrix = transfer(model, judging, body.ground)
            return Reference(judging, matrix, labels, min(change, best), model.size)
        last, best = now, min(best, change)
    raise BodyError(f"{body.name}: the reference did not converge: the last moments changed it by {best:.1e}")


class _Moments:
    """The full model on a growing number of moments, projected as it grows."""

    def __init__(self, body: FullOrder, shifts: list[float]):
        self.body, self.basis = body, Growing(elastic(body))
        self.points = [Expansion(body, shift) for shift in shifts]
        self.stiffness = np.zeros((0, 0))
        self.rows = np.zeros((body.rows().shape[0], 0))

    def grow(self) -> int:
        """One more power at every point; returns how many vectors came."""
        before = self.basis.size
        for point in self.points:
            point.advance(self.basis)
            self._project()
        return self.basis.size - before

    def _project(self) -> None:
        before = len(self.stiffness)
        added = self.basis.vectors[:, before:]
        new = self.basis.vectors.T @ (self.body.stiffness @ added)
        grown = np.empty((self.basis.size,) * 2)
        grown[:before, :before], grown[:, before:], grown[before:, :] = self.stiffness, new, new.T
        self.stiffness = grown
        self.rows = np.hstack([self.rows, self.body.rows() @ added])


@dataclass(frozen=True)
class Trial:
    """A method on the body: matrix (F, m, m) of the oscillators alone, error (F,) of it, mended (F,) with the static
    residual, seconds of processor time beyond what methods before it had made."""

    method: str
    size: int
    matrix: np.ndarray
    error: np.ndarray
    mended: np.ndarray
    seconds: float


@dataclass(frozen=True)
class Judgement:
    """full : the body; exact : its own transfer matrix; trials : one a method, in the order asked for."""

    full: FullOrder
    exact: Reference
    trials: tuple[Trial, ...]

    @property
    def frequency(self) -> np.ndarray:
        """Lines (F,), Hz."""
        return self.exact.judging.frequency

    @property
    def rows(self) -> list[str]:
        """Names of the m rows and columns of the matrices: "bolt0.ux"."""
        return [".".join(label) for label in self.exact.labels]


def judged(full: FullOrder, methods: Sequence[tuple[str, Size]], judging: Judging) -> Judgement:
    """The body reduced by each method, against itself."""
    exact = reference(full, judging)
    return Judgement(full, exact, tuple(_tried(full, exact, *entry) for entry in methods))


def _tried(full: FullOrder, exact: Reference, method: str, size: Size) -> Trial:
    clock, judging = time.process_time(), exact.judging
    model = oscillators(full, METHODS[method](full, size), judging.damping_ratio)
    seconds = time.process_time() - clock
    matrix = transfer(model, judging, full.ground)
    mended = transfer(model, judging, full.ground, residual=True)
    errors = relative_error(exact.matrix, matrix), relative_error(exact.matrix, mended)
    return Trial(method, model.size, matrix, *errors, seconds)
