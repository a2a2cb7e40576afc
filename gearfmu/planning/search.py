"""The search: a candidate from formulas, what it lacks put back by trials, then what it can spare taken out. Every set
that is taken was measured as a set."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from gearfmu.planning.choice import LEAST_SAVING, MODES, SLICED, STEP, Choice, Knob, Space
from gearfmu.planning.formulas import CERTAIN, Conditions, predicted
from gearfmu.planning.judge import Error, error
from gearfmu.planning.request import Request
from gearfmu.planning.trials import Task, Trial, Window, run_trials
from gearfmu.study.ladder import LEVELS
from gearfmu.sweeps.runners import Runner

LADDERS = (STEP, MODES, SLICED)
START = 0.5  # of what is allowed: where a ladder begins by its formula
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Measured:
    """A choice with its trial and its error against the full model."""

    choice: Choice
    trial: Trial
    error: Error

    @property
    def bound(self) -> float:
        return self.error.bound

    @property
    def price(self) -> float:
        """NaN of a failed trial."""
        return self.trial.price


@dataclass
class Bench:
    """What trials of one window share, and what is measured there already."""

    scene: str
    window: Window
    request: Request
    full: Trial
    runner: Runner
    known: dict[Choice, Measured] = field(default_factory=dict)
    cpu: float = 0.0

    def measure(self, choices: Iterable[Choice], priced: bool = True) -> list[Measured]:
        """Errors and, where `priced`, prices; of what is new by trials side by side."""
        wanted = list(dict.fromkeys(choices))
        new = [choice for choice in wanted if choice not in self.known]
        tasks = [Task(self.scene, choice, self.window, self.request, priced) for choice in new]
        for choice, trial in zip(new, run_trials(tasks, self.runner), strict=True):
            self.cpu += trial.cpu
            self.known[choice] = Measured(choice, trial, error(trial.signals, self.full.signals, self.request))
        return [self.known[choice] for choice in wanted]

    def widen(self, window: Window) -> None:
        """Another window: the full model is run again, what was measured is forgotten."""
        self.window, self.known = window, {}
        self.full = self.again(twin=False)

    def again(self, twin: bool) -> Trial:
        """The full model once more; twin: disturbed before it settles."""
        full = self.full.choice
        through = replace(full, level=LEVELS[0]) if twin else None
        task = Task(self.scene, full, self.window, self.request, not twin, through)
        found = run_trials([task], self.runner)[0]
        self.cpu += found.cpu
        return found

    def one(self, choice: Choice) -> Measured:
        """`measure` of one."""
        return self.measure([choice])[0]


@dataclass(frozen=True)
class Found:
    """chosen: the cheapest set that keeps the budget; refused: by knob, what one step further down would have been;
    kept: whether the bound is within the safety."""

    chosen: Measured
    refused: dict[str, Measured]
    kept: bool


def search(space: Space, bench: Bench, known: Conditions, safety: float, tell: Tell) -> Found:
    """The cheapest measured set whose bound times `safety` is at most 1; the full model where none is."""
    most = 1.0 / safety
    now = bench.one(begin(space, known, most))
    tell(_said("candidate", now))
    now = _restored(space, bench, now, most, tell)
    return _pruned(space, bench, now, most, tell)


def begin(space: Space, known: Conditions, most: float) -> Choice:
    """Ladders as far down as their formulas allow, effects out whose formula is a tenth of what is allowed."""
    choice = space.full
    for knob in space.candidates:
        limit = (START if knob.name in LADDERS else CERTAIN) * most
        while (lower := space.cheaper(choice, knob.name)) is not None and predicted(knob, lower, known) < limit:
            choice = lower
    return choice


def _restored(space: Space, bench: Bench, now: Measured, most: float, tell: Tell) -> Measured:
    """Put back what lowers the error most for its price, until the set keeps the budget."""
    while now.bound > most and now.choice != space.full:
        names = [knob.name for knob in space.candidates]
        richer = [c for name in names if (c := space.richer(now.choice, name)) is not None]
        tried = bench.measure(richer)
        better = [m for m in tried if m.bound < 0.98 * now.bound]
        now = max(better, key=lambda m: _gain(now, m)) if better else bench.one(space.all_richer(now.choice))
        tell(_said("put back", now))
    return now


def _gain(now: Measured, richer: Measured) -> float:
    """d log error / d log price; of what is enough at once, the cheaper the better."""
    lower = math.log(min(now.bound, 1e6) / max(richer.bound, 1e-6))
    dearer = math.log(max(richer.price, 1e-9) / max(now.price, 1e-9)) if now.price > 0 else 1.0
    return lower / max(dearer, 0.01)


def _pruned(space: Space, bench: Bench, now: Measured, most: float, tell: Tell) -> Found:
    """Take out what is dearest first, as long as the set keeps the budget; what fails once is not tried again."""
    refused: dict[str, Measured] = {}
    for knob in space.candidates:
        while (lower := space.cheaper(now.choice, knob.name)) is not None:
            tried = bench.one(lower)
            if tried.bound > most or not tried.price < (1.0 - LEAST_SAVING) * now.price:
                refused[knob.name] = tried
                break
            now = tried
            tell(_said("without", now))
    return Found(now, refused, now.bound <= most)


def neighbours(
    step: Callable[[Choice, str], Choice | None], bench: Bench, chosen: Choice, names: Sequence[str]
) -> dict[str, Measured]:
    """One step (`Space.cheaper`, `Space.richer`) from the chosen set by each of these knobs, where there is one."""
    beside = {name: c for name in names if (c := step(chosen, name)) is not None}
    return dict(zip(beside, bench.measure(beside.values(), priced=False), strict=True))


def measurable(knobs: Sequence[Knob]) -> list[str]:
    """Knobs whose error a trial can show: all but those that are kept by their nature."""
    return [knob.name for knob in knobs if not (knob.effect and knob.effect.kept)]


def _said(what: str, measured: Measured) -> str:
    return f"{what}: {measured.choice.words}: {measured.bound:.2g} budgets"
