"""Spot checks of a planned run: the full model takes over a state of the run, settles, and is compared with what the
run does over the same window. Where a check is missed, richer sets run from the same state tell what would have kept
the budget there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from gearfmu.cosim.coupled import OK, CoupledRun, Saved
from gearfmu.errors import SimulationError
from gearfmu.planning.book import Plan, Segment
from gearfmu.planning.choice import Choice, Knob, space
from gearfmu.planning.judge import FAILED, Signals, error, signals_of
from gearfmu.planning.request import request_of
from gearfmu.planning.road import Road
from gearfmu.planning.search import Measured, Measures, restored
from gearfmu.planning.trials import Trial
from gearfmu.stage import Trace

CHECKS = 2  # a segment
LATE = 6e-3  # s: a check begins at the end of a leg


@dataclass(frozen=True)
class Check:
    """segment; start, s; error of the plan, budgets; allowed: 1 and the noise of the full model; kept; answer: the
    choice that the run went back for and on with, "" where it went on as it was."""

    segment: str
    start: float
    error: float
    allowed: float
    kept: bool
    answer: str = ""


@dataclass(frozen=True)
class Mark:
    """A point to go back to, at the end of a leg: choice, state one communication step before, number of legs."""

    choice: Choice
    before: Saved
    legs: int


@dataclass(frozen=True)
class Spot:
    """A check on its way: due: when it was, s; from where; first and last step of its window; the full model there,
    None where it fails."""

    segment: Segment
    due: float
    mark: Mark
    first: int
    last: int
    full: Trace | None


class SpotChecks:
    """CHECKS windows a segment, judged as soon as the run has gone through them; none where they are not wanted."""

    def __init__(self, plan: Plan, road: Road, wanted: bool = True) -> None:
        self.road, self.asked = road, request_of(road.scene, road.model, plan.request)
        self.step = road.scene.coupling.step
        self.space = space(road.scene, road.model)
        self.due = {segment.name: list(_starts(segment)) if wanted else [] for segment in plan.segments}
        self.begun: list[Spot] = []

    def look(self, at: int, segment: Segment, mark: Mark) -> None:
        """Run the full model over a window that is due now."""
        due = self.due[segment.name]
        if not due or at * self.step < due[0] - segment.settle - 1e-9:
            return
        first = at + round(segment.settle / self.step)
        last = first + round(segment.window / self.step)
        full = self._run(self.space.full, self.road.again(mark.choice, mark.before), first, last)
        self.begun.append(Spot(segment, due.pop(0), mark, first, last, full))

    def over(self, at: int) -> Spot | None:
        """The first check whose window the run has gone through."""
        return next((spot for spot in self.begun if spot.last <= at), None)

    def judged(self, spot: Spot, trace: Trace) -> Check:
        """How far the run was from the full model. trace: of the run, the window at least."""
        allowed = 1.0 + spot.segment.noise
        part = trace.window((spot.first - 0.1) * self.step, (spot.last + 0.1) * self.step)
        far = FAILED if spot.full is None else error(self._signals(part), self._signals(spot.full), self.asked).whole
        return Check(spot.segment.name, spot.first * self.step, far, allowed, far <= allowed)

    def done(self, spot: Spot) -> None:
        """This check is settled."""
        self.begun.remove(spot)

    def back_to(self, spot: Spot) -> None:
        """The run goes back to where this check began: later ones are due again."""
        for later in [s for s in self.begun if s.first > spot.first]:
            self.begun.remove(later)
            self.due[later.segment.name].insert(0, later.due)

    def better(self, spot: Spot, choice: Choice) -> Choice | None:
        """A richer set that keeps the budget, with the safety of the segment, from the state where the check began;
        None where the full model runs already, or fails."""
        if spot.full is None or choice == self.space.full:
            return None
        bench = Measures(lambda new: [self.trial(spot, tried) for tried in new])
        now, most = bench.one(choice), 1.0 / spot.segment.safety
        found = restored(self.space, bench, now, most, lambda text: None, _dearest_first)
        return self.space.all_richer(choice) if found.choice == choice else found.choice

    def trial(self, spot: Spot, choice: Choice) -> Measured:
        """A set over the window of a check, from its state."""
        assert spot.full is not None, "only judged parts are checked again"
        found = self._run(choice, self.road.again(spot.mark.choice, spot.mark.before), spot.first, spot.last)
        values = Signals({}, self.step) if found is None else self._signals(found)
        trial = Trial(choice, "stopped" if found is None else OK, signals=values)
        return Measured(choice, trial, error(values, self._signals(spot.full), self.asked))

    def _run(self, choice: Choice, before: CoupledRun, first: int, last: int) -> Trace | None:
        """From step `first` to `last` with this choice, settled since `before`; None where it fails."""
        run = self.road.kernel(choice, tuple(self.asked.channels))
        try:
            run.take_over(before)
            return run.window(first, last)
        except SimulationError:
            return None

    def _signals(self, part: Trace) -> Signals:
        return signals_of(part, self.asked, self.step)


def _dearest_first(steps: list[tuple[Knob, Choice]], now: Choice) -> list[Choice]:
    return [choice for _, choice in steps]


def _starts(segment: Segment) -> Iterator[float]:
    """Whole within the segment, behind the planning window; one at its end where there is no room behind."""
    first, last = segment.window_start + segment.window + segment.settle, segment.end - segment.window - LATE
    if first > last > segment.window_start:
        yield last
    for k in range(CHECKS):
        if last >= first:
            yield first + (last - first) * k / max(1, CHECKS - 1)
