"""A body reduced by several methods, each judged by its transfer matrix (gearfmu.reduction.transfer)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.reduction.basis import Size
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.oscillators import oscillators
from gearfmu.reduction.transfer import Judging, Reference, reference, relative_error, transfer


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
