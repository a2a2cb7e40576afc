"""Reduction methods side by side on one body: error over frequency, size, processor time and memory of each.

Factors and modes that several methods need are made once; each method is charged for all it uses, whoever asked first.
What shares modes or shifted factors is a lane; lanes may run in processes of their own (Linux), which start from the
factor of K that all of them use.
"""

from __future__ import annotations

import multiprocessing
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.reduction.basis import Size
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import static_response
from gearfmu.reduction.oscillators import Oscillators, oscillators
from gearfmu.reduction.transfer import Judging, Reference, reference, relative_error, transfer

Progress = Callable[[str, float], None]

_REFERENCE = "reference"
_LANES = ({"modal", "rubin"}, {"krylov", _REFERENCE})  # free modes, shifted factors; any other method is a lane
_STARTED: list[Any] = []  # body and contest of a worker: they come with the fork


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
    """All trials against one reference; seconds : processor time of everything together, in all processes."""

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


def compare(body: FullOrder, contest: Contest, progress: Progress | None = None, processes: int = 1) -> Comparison:
    """Reduce `body` with every entry and judge it, in up to `processes` processes where the system can fork.

    Raises BodyError of the first method that cannot do its task."""
    clock = time.process_time()
    made: dict[int, Any] = {}
    elsewhere = 0.0
    for lane, seconds in _finished(body, contest, processes):
        made |= lane
        elsewhere += seconds
        last = max(lane)
        _tell(progress, contest.entries[last][0] if last >= 0 else _REFERENCE, len(made) / (len(contest.entries) + 1))
    full, reference_seconds = made.pop(-1)
    trials = tuple(_judged(body, full, (contest.entries[k][0], *made[k]), contest) for k in sorted(made))
    return Comparison(full, trials, reference_seconds, time.process_time() - clock + elsewhere)


def _finished(body: FullOrder, contest: Contest, processes: int) -> Iterator[tuple[dict[int, Any], float]]:
    """What the lanes made, as they end, and processor seconds that other processes took for it."""
    lanes = _lanes(contest)
    if processes < 2 or len(lanes) < 2 or sys.platform != "linux":
        for lane in lanes:
            yield _run(body, contest, lane), 0.0
        return
    static_response(body)
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(processes, context, _STARTED.extend, ((body, contest),)) as pool:
        waiting: list[Future] = [pool.submit(_lane, lane) for lane in lanes]
        for future in as_completed(waiting):
            yield future.result()


def _lanes(contest: Contest) -> list[list[int]]:
    """Numbers of the entries (−1: the reference) that share what they make, the longest lanes first."""
    names = [*(method for method, _ in contest.entries), _REFERENCE]
    keys = [next((str(k) for k, lane in enumerate(_LANES) if name in lane), name) for name in names]
    lanes = [[k for k, own in enumerate(keys) if own == key] for key in dict.fromkeys(keys)]
    lanes = [[-1 if k == len(contest.entries) else k for k in lane] for lane in lanes]
    return sorted(lanes, key=len, reverse=True)


def _lane(lane: list[int]) -> tuple[dict[int, Any], float]:
    """A lane in a process of its own, and the processor seconds that it took there."""
    clock = time.process_time()
    body, contest = _STARTED
    return _run(body, contest, lane), time.process_time() - clock


def _run(body: FullOrder, contest: Contest, lane: list[int]) -> dict[int, Any]:
    made: dict[int, Any] = {}
    for number in lane:
        if number < 0:
            clock = time.process_time()
            made[number] = (reference(body, contest.judging), time.process_time() - clock)
        else:
            made[number] = _reduced(body, *contest.entries[number], contest.judging.damping_ratio)
    return made


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


def _judged(body: FullOrder, full: Reference, entry: tuple, contest: Contest) -> Trial:
    method, model, facts, seconds, memory = entry
    h = transfer(model, contest.judging, body.ground)
    with_residual = transfer(model, contest.judging, body.ground, residual=True)
    error = relative_error(full.matrix, h)
    loaded = error if contest.loaded is None else relative_error(full.matrix, h, contest.loaded)
    return Trial(method, model, facts, error, relative_error(full.matrix, with_residual), loaded, seconds, memory)


def _tell(progress: Progress | None, what: str, share: float) -> None:
    if progress:
        progress(what, share)
