"""Reduction methods side by side on one body: error over frequency, size, processor time and memory of each.

Each method begins with nothing made: it is charged for every factor and mode that it uses.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evidence.reduction.methods import METHODS
from gearfmu.errors import BodyError
from gearfmu.reduction.basis import Size
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.oscillators import Oscillators, oscillators
from gearfmu.reduction.transfer import Judging, Reference, reference, relative_error, transfer


@dataclass(frozen=True)
class Trial:
    """One method on one body: error (F,) of the oscillators alone, mended (F,) with the static residual, loaded (F,) of
    the inputs that are really loaded; seconds of processor time, memory in bytes (0 when not traced)."""

    method: str
    model: Oscillators
    error: np.ndarray
    mended: np.ndarray
    loaded: np.ndarray
    seconds: float
    memory: int


@dataclass(frozen=True)
class Comparison:
    """All trials against one reference; seconds : processor time of everything together."""

    reference: Reference
    trials: tuple[Trial, ...]
    seconds: float


@dataclass(frozen=True)
class Contest:
    """What is compared: (method, size) pairs, lines and damping, rows of the transfer matrix that are really loaded
    (all when None)."""

    entries: tuple[tuple[str, Size], ...]
    judging: Judging
    loaded: np.ndarray | None = None


def compare(body: FullOrder, contest: Contest) -> Comparison:
    """Reduce `body` with every entry and judge it. Raises BodyError of the first method that cannot do its task."""
    clock = time.process_time()
    full = reference(replace(body), contest.judging)
    trials = tuple(_tried(replace(body), full, contest, *entry) for entry in contest.entries)
    return Comparison(full, trials, time.process_time() - clock)


def _tried(body: FullOrder, full: Reference, contest: Contest, method: str, size: Size) -> Trial:
    traced = tracemalloc.get_traced_memory()[0]
    tracemalloc.reset_peak() if tracemalloc.is_tracing() else None
    clock = time.process_time()
    model = oscillators(body, METHODS[method](body, size), contest.judging.damping_ratio)
    seconds, memory = time.process_time() - clock, max(tracemalloc.get_traced_memory()[1] - traced, 0)
    h = transfer(model, contest.judging, body.ground)
    with_residual = transfer(model, contest.judging, body.ground, residual=True)
    error = relative_error(full.matrix, h)
    loaded = error if contest.loaded is None else relative_error(full.matrix, h, contest.loaded)
    return Trial(method, model, error, relative_error(full.matrix, with_residual), loaded, seconds, memory)


def rows_named(labels: Sequence[tuple[str, str]], names: str) -> np.ndarray:
    """Indices of the rows "interface.component" whose name is among the comma-separated `names`; "bolt*.ux" stands for
    every bolt."""
    from fnmatch import fnmatch

    patterns, rows = names.split(","), [".".join(label) for label in labels]
    found = [k for k, row in enumerate(rows) if any(fnmatch(row, pattern) for pattern in patterns)]
    if not found:
        raise BodyError(f"'{names}' names none of {', '.join(rows[:8])} …")
    return np.array(found)
