"""Reduction methods side by side on one body: error over frequency, size, processor time and memory of each.

Factors and modes that several methods need are made once; each method is charged for all it uses, whoever asked first.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.reduction.basis import Size
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.oscillators import Oscillators, oscillators
from gearfmu.reduction.transfer import Judging, Reference, reference, relative_error, transfer

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Trial:
    """One method on one body: error (F,) of the oscillators alone, mended (F,) with the static residual, loaded (F,) of
    the inputs that are really loaded; seconds of processor time, memory in bytes (0 when not traced)."""

    method: str
    model: Oscillators
    facts: dict[str, Any]
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
    reference_seconds: float
    seconds: float


@dataclass(frozen=True)
class Contest:
    """What is compared: (method, size) pairs, lines and damping, rows of the transfer matrix that are really loaded
    (all when None)."""

    entries: tuple[tuple[str, Size], ...]
    judging: Judging
    loaded: np.ndarray | None = None


def compare(body: FullOrder, contest: Contest, progress: Progress | None = None) -> Comparison:
    """Reduce `body` with every entry and judge it. Raises BodyError of the first method that cannot do its task."""
    started = time.process_time()
    reduced = []
    for number, (method, size) in enumerate(contest.entries):
        _tell(progress, method, number / (len(contest.entries) + 1))
        reduced.append((method, *_reduced(body, method, size, contest.judging.damping_ratio)))
    _tell(progress, "reference", len(reduced) / (len(reduced) + 1))
    clock = time.process_time()
    full = reference(body, contest.judging)
    reference_seconds = time.process_time() - clock
    trials = tuple(_judged(body, full, entry, contest) for entry in reduced)
    return Comparison(full, trials, reference_seconds, time.process_time() - started)


def _reduced(body: FullOrder, method: str, size: Size, damping_ratio: float) -> tuple:
    """Oscillators, facts, processor seconds and bytes of one method, with what it used of the others' making."""
    space = elastic(body)
    there = dict(space.pieces)
    space.touched.clear()
    traced, _ = tracemalloc.get_traced_memory()
    tracemalloc.reset_peak() if tracemalloc.is_tracing() else None
    clock = time.process_time()
    basis = METHODS[method](body, size)
    model = oscillators(body, basis, damping_ratio)
    seconds, peak = time.process_time() - clock, tracemalloc.get_traced_memory()[1] - traced
    before = [piece for name, piece in there.items() if name in space.touched and space.pieces.get(name) is piece]
    seconds += sum(piece.seconds for piece in before)
    return model, basis.facts, seconds, max(peak, 0) + sum(piece.memory for piece in before)


def _judged(body: FullOrder, full: Reference, entry: Sequence[Any], contest: Contest) -> Trial:
    method, model, facts, seconds, memory = entry
    h = transfer(model, contest.judging, body.ground)
    with_residual = transfer(model, contest.judging, body.ground, residual=True)
    error = relative_error(full.matrix, h)
    loaded = error if contest.loaded is None else relative_error(full.matrix, h, contest.loaded)
    return Trial(method, model, facts, error, relative_error(full.matrix, with_residual), loaded, seconds, memory)


def _tell(progress: Progress | None, what: str, share: float) -> None:
    if progress:
        progress(what, share)
