"""The search: a candidate from formulas, what it lacks put back by trials, then what it can spare taken out. Every set
that is taken was measured as a set."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from gearfmu.planning.choice import MODES, SLICED, STEP, Choice, Knob, Space
from gearfmu.planning.formulas import CERTAIN, Conditions, predicted
from gearfmu.planning.judge import Error, error
from gearfmu.planning.request import Request
from gearfmu.planning.trials import Task, Trial, Window, run_trials
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.sweeps.runners import Runner

LADDERS = (STEP, MODES, SLICED)
START = 0.5  # of what is allowed: where a ladder begins by its formula
UNSEEN = 1  # effects that formulas decided alone and that are measured for the table
DEARER = 1.05  # times the price: so much two runs differ without a reason
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


class Measures:
    """Choices with their errors, each measured once. make: measures new ones."""

    def __init__(self, make: Callable[[list[Choice]], list[Measured]]) -> None:
        self._make, self.known = make, dict[Choice, Measured]()

    def measure(self, choices: Iterable[Choice]) -> list[Measured]:
        """Errors and prices."""
        wanted = list(dict.fromkeys(choices))
        new = [choice for choice in wanted if choice not in self.known]
        self.known.update(zip(new, self._make(new), strict=True))
        return [self.known[choice] for choice in wanted]

    def one(self, choice: Choice) -> Measured:
        """`measure` of one."""
        return self.measure([choice])[0]


class Bench(Measures):
    """What trials of one window share, and what is measured there already; new choices side by side."""

    def __init__(self, scene: str, window: Window, request: Request, full: Trial, runner: Runner) -> None:
        super().__init__(self._by_trials)
        self.scene, self.window, self.request, self.full, self.runner = scene, window, request, full, runner
        self.cpu = full.cpu

    def _by_trials(self, choices: list[Choice]) -> list[Measured]:
        tasks = [Task(self.scene, choice, self.window, self.request) for choice in choices]
        trials = run_trials(tasks, self.runner)
        self.cpu += sum(trial.cpu for trial in trials)
        return [Measured(t.choice, t, error(t.signals, self.full.signals, self.request)) for t in trials]

    def widen(self, window: Window) -> None:
        """Another window: the full model is run again, what was measured is forgotten."""
        self.window, self.known = window, {}
        self.full = self.run(Task(self.scene, self.full.choice, window, self.request, priced=True))

    def twin(self) -> Trial:
        """The full model once more, disturbed before it settles."""
        full = self.full.choice
        return self.run(Task(self.scene, full, self.window, self.request, through=replace(full, level=LEVELS[0])))

    def run(self, task: Task) -> Trial:
        """One trial; what it costs is counted."""
        found = run_trials([task], self.runner)[0]
        self.cpu += found.cpu
        return found


@dataclass(frozen=True)
class Found:
    """chosen: the cheapest set that keeps the budget; refused: by knob, what one step further down would have been;
    tried_from: by knob, the set that this step began at; kept: whether the bound is within the safety."""

    chosen: Measured
    refused: dict[str, Measured]
    tried_from: dict[str, Measured]
    kept: bool


def search(space: Space, bench: Bench, known: Conditions, safety: float, tell: Tell) -> Found:
    """The cheapest measured set whose bound times `safety` is at most 1; the full model where none is."""
    most = 1.0 / safety
    now = bench.one(begin(space, known, most))
    tell(_said("candidate", now))
    now = restored(space, bench, now, most, tell, _worst_first(known))
    return _pruned(space, bench, now, most, tell)


def begin(space: Space, known: Conditions, most: float) -> Choice:
    """Ladders as far down as their formulas allow, effects out whose formula is a tenth of what is allowed."""
    choice = space.full
    for knob in space.candidates:
        limit = (START if knob.name in LADDERS else CERTAIN) * most
        while (lower := space.cheaper(choice, knob.name)) is not None and predicted(knob, lower, known) < limit:
            choice = lower
    return choice


Order = Callable[[list[tuple[Knob, Choice]], Choice], list[Choice]]


def _worst_first(known: Conditions) -> Order:
    """What the formulas say is farthest off comes first; what no formula says comes last."""

    def order(steps: list[tuple[Knob, Choice]], now: Choice) -> list[Choice]:
        far = [predicted(knob, now, known) for knob, _ in steps]
        rank = sorted(range(len(steps)), key=lambda k: -far[k] if far[k] == far[k] else math.inf)
        return [steps[k][1] for k in rank]

    return order


def restored(space: Space, bench: Measures, now: Measured, most: float, tell: Tell, order: Order) -> Measured:
    """Put back what lowers the error most for its price, until the set keeps the budget. Steps are tried in the order
    of `order`; the first that is enough ends the round."""
    while now.bound > most and now.choice != space.full:
        steps = [(knob, c) for knob in space.candidates if (c := space.richer(now.choice, knob.name)) is not None]
        tried: list[Measured] = []
        for choice in order(steps, now.choice):
            tried += bench.measure([choice])
            if tried[-1].bound <= most:
                break
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
    before: dict[str, Measured] = {}
    for place, knob in enumerate(space.candidates, start=1):
        tell(f"what can be left out: {knob.name}, {place} of {len(space.candidates)}")
        while (lower := space.cheaper(now.choice, knob.name)) is not None:
            tried = bench.one(lower)
            if tried.bound > most or not tried.price < DEARER * now.price:
                refused[knob.name], before[knob.name] = tried, now
                break
            now = tried
            tell(_said("without", now))
    return Found(now, refused, before, now.bound <= most)


Pair = tuple[Measured, Measured]


def pairs(space: Space, bench: Bench, chosen: Choice, names: Sequence[str], most: int = UNSEEN) -> dict[str, Pair]:
    """By knob two measured sets that differ by one step of it alone, the poorer first: beside the chosen set where that
    was measured, else beside another. At most `most` of what was never looked at is measured now, one step up."""
    found: dict[str, Pair] = {}
    unseen = 0
    for name in names:
        pair = next(iter(_seen(space, bench, chosen, name)), None)
        richer = space.richer(chosen, name)
        if pair is None and richer is not None and unseen < most:
            unseen += 1
            pair = bench.one(chosen), bench.one(richer)
        if pair is not None:
            found[name] = pair
    return found


def _seen(space: Space, bench: Bench, chosen: Choice, name: str) -> Iterator[Pair]:
    known = bench.known
    for choice in (chosen, space.richer(chosen, name), *reversed(known)):
        if choice in known and (lower := space.cheaper(choice, name)) in known:
            yield known[lower], known[choice]


def _said(what: str, measured: Measured) -> str:
    return f"{what}: {measured.choice.words}: {measured.bound:.2g} budgets"
