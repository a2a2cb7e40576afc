"""A plan from its request: segments, windows, full model, search, reasons."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from gearfmu.cosim.coupled import OK
from gearfmu.errors import GearfmuError
from gearfmu.kernel import library_path
from gearfmu.planning.book import FORMAT, Line, Plan, Point, Segment
from gearfmu.planning.choice import LEAST_SHARE, MODES, SLICED, STEP, Choice, Knob, Space, space
from gearfmu.planning.formulas import Conditions, predicted
from gearfmu.planning.judge import FAILED, SAFETY, SAFETY_LOSS, error, silent_outputs, trend
from gearfmu.planning.request import Request
from gearfmu.planning.search import UNSEEN, Bench, Found, Measured, Pair, pairs, search
from gearfmu.planning.segments import Part, parts
from gearfmu.planning.trials import Task, Trial, prime, run_trials
from gearfmu.planning.windows import GROWN, GROWN_LOST, LONGEST, QUIET, Noise, mesh_frequency, quiet_enough
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel
from gearfmu.sweeps.runners import Runner

LONGER = 4  # windows that the chosen set is run alone for, to see slow growth
LONGEST_ALONE = 0.4  # s of that
GROWTH = 0.5  # of the budget (of 1 dB where none is given in dB) over these windows
RETRIES = 3
Tell = Callable[[str], None]


class PlanError(GearfmuError):
    """A plan that cannot be made as asked."""


@dataclass(frozen=True)
class Job:
    """What a plan is made of. force: effects that are candidates though they cost little; tell: is told what is
    done."""

    scene: SceneSpec
    model: StageModel
    request: Request
    runner: Runner
    force: tuple[str, ...] = ()
    tell: Tell = field(default=lambda text: None)

    @property
    def identity(self) -> str:
        """Hex digest of what decides the plan: scene, model, request, policy, kernel, format."""
        kernel = hashlib.sha256(library_path().read_bytes()).hexdigest()
        asked = (self.scene.hash, self.model.hash, sorted(self.request.plain.items()), LEAST_SHARE, self.force)
        return hashlib.sha256(f"{FORMAT} {asked} {kernel}".encode()).hexdigest()


def make(job: Job, name: str) -> Plan:
    """The plan of a scene, which is written down as `name`. PlanError where the full model does not run, where an
    output has no signal in the band, and where a waveform is asked of a motion that does not repeat."""
    segments, cpu, unit = [], 0.0, 0.0
    for part in parts(job.scene, job.model, job.request):
        made = _Made(job, part)
        segments.append(made.segment())
        cpu, unit = cpu + made.bench.cpu, unit + made.bench.full.run
    asked, step = job.request.plain, job.scene.coupling.step
    return Plan(name, job.identity, step, asked, tuple(segments), cpu / unit, cpu, (), job.model.hash)


class _Made:
    """One segment in the making."""

    def __init__(self, job: Job, part: Part) -> None:
        self.job, self.part = job, part
        self.space: Space = space(job.scene, job.model, force=job.force)
        self.text = job.scene.model_dump_json()
        prime(self.text, job.scene, job.model)
        task = Task(self.text, self.space.full, part.window, job.request, priced=True)
        job.tell(f"{part.name}: full model over {1e3 * part.window.length:.3g} ms")
        full = run_trials([task], job.runner)[0]
        if full.outcome != OK:
            raise PlanError(f"the full model does not run through {part.name}: {full.outcome}: {full.message}")
        self.bench = Bench(self.text, part.window, job.request, full, job.runner)

    def segment(self) -> Segment:
        """Window, noise, search, slow growth, reasons."""
        job, bench = self.job, self.bench
        looser = self.space.cheaper(self.space.full, STEP) or self.space.full
        full, window, noise = quiet_enough(bench, self.part.longest, self.part.kind == "loaded", looser)
        self._refuse_silence()
        self._refuse_chaos(noise, looser)
        safety = SAFETY_LOSS if full.loses_contact else SAFETY
        speed = self.part.speed
        known = Conditions(job.model, job.request, full.force, speed, mesh_frequency(job.model, speed), full)
        found, priced, notes = self._search(known, safety)
        if full.loses_contact and noise.split > QUIET:
            notes.append(
                f"noise floor: two halves of the full model's window differ by {noise.split:.2g} budgets: no window up "
                f"to {LONGEST:g} s, or in the part, says more"
            )
        own = self._own()
        lines = tuple(self._lines(found, known, safety))
        return Segment(
            self.part.name,
            self.part.start,
            self.part.end,
            "contact_loss" if full.loses_contact else self.part.kind,
            found.chosen.choice,
            window.start,
            window.length,
            window.settle,
            found.chosen.bound,
            found.chosen.error.whole,
            safety,
            self._noise(noise),
            priced.price,
            priced.realtime,
            full.price,
            own.price,
            error(own.signals, full.signals, job.request).whole,
            lines,
            self._points(found.chosen, own),
            tuple(notes),
        )

    def _noise(self, noise: Noise) -> float:
        """Of the full model, in budgets of what is asked for."""
        asked = self.job.request
        if asked.level is None and asked.waveform is not None:
            return noise.waveform / asked.waveform
        return max(noise.split if self.bench.full.loses_contact else 0.0, noise.twin)

    def _points(self, chosen: Measured, own: Trial) -> tuple[Point, ...]:
        """All that was measured and ran, what the scene asks for itself and the full model among it."""
        full, asked = self.bench.full, self.job.request
        known = [m for m in self.bench.known.values() if m.price > 0 and m.bound < FAILED]
        made = [Point(m.choice.words, m.price, m.bound, m == chosen) for m in known]
        bound = error(own.signals, full.signals, asked).bound
        if own.choice != chosen.choice and bound < FAILED:
            made.append(Point(f"the scene's own, {own.choice.words}", own.price, bound, False))
        return (*made, Point(f"full model, {full.choice.words}", full.price, 0.0, False))

    def _own(self) -> Trial:
        """What the scene asks for itself."""
        stage, bench = self.job.scene.stage, self.bench
        choice = Choice(stage.level, stage.h, stage.slices, tuple(sorted(stage.effects.off)))
        return bench.run(Task(self.text, choice, bench.window, self.job.request, priced=True))

    def _refuse_silence(self) -> None:
        silent = silent_outputs(self.bench.full.signals, self.job.request)
        if silent:
            low, high = self.job.request.band
            raise PlanError(
                f"{', '.join(silent)}: no signal in {low:g} … {high:g} Hz, its level has no error: leave it out, or "
                "choose another band"
            )

    def _refuse_chaos(self, noise: Noise, looser: Choice) -> None:
        budget, lost = self.job.request.waveform, self.bench.full.loses_contact
        if budget is None or not noise.waveform > (GROWN_LOST if lost else GROWN) * budget:
            return
        what = f"a step of {1e6 * looser.h:.3g} µs" if lost else "a small disturbance before it"
        raise PlanError(
            f"{self.part.name}: the waveform does not repeat: {what} changes that of the full model by "
            f"{100 * noise.waveform:.2g} %, so that no set keeps {100 * budget:g} %. Ask for levels, which repeat "
            f'within {noise.twin * (self.job.request.level or 1.0):.2g} dB here: --budget "1 dB"'
        )

    def _search(self, known: Conditions, safety: float) -> tuple[Found, Trial, list[str]]:
        """The search, again from a richer set while the chosen one grows slowly; and the trial that says its price."""
        job, notes = self.job, list[str]()
        found = search(self.space, self.bench, known, safety, job.tell)
        for _ in range(RETRIES):
            alone, grown = self._alone_for_longer(found.chosen.choice)
            if grown is None:
                break
            notes.append(grown)
            job.tell(grown)
            richer = self.bench.one(self.space.all_richer(found.chosen.choice))
            found = replace(found, chosen=richer, kept=richer.bound * safety <= 1)
        if not found.kept:
            notes.append("no set cheaper than the full model keeps the budget: the full model is taken")
        return found, self.bench.full if found.chosen.choice == self.space.full else alone, notes

    def _alone_for_longer(self, choice: Choice) -> tuple[Trial, str | None]:
        """The chosen set run alone over LONGER windows, at most LONGEST_ALONE and no less than one, and how it grows
        there, where the scene is steady, beyond what the full model does over its window: None when it stays."""
        window, steady = self.bench.window, self.part.kind == "loaded"
        room = min(LONGER, LONGEST_ALONE / window.length)
        longer = room if steady and room >= 2 else 1.0
        window = replace(window, length=longer * window.length)
        trial = self.bench.run(Task(self.text, choice, window, self.job.request, priced=True))
        if not steady:
            return trial, None
        if trial.outcome != OK:
            stopped = f"does not reach {window.end:.3g} s: {trial.outcome}"
            return trial, f"{choice.words}: {stopped}: put all back by one step"
        rise = trend(trial.signals, self.job.request) - trend(self.bench.full.signals, self.job.request)
        if rise <= GROWTH * (self.job.request.level or 1.0):
            return trial, None
        return trial, f"{choice.words}: grows by {rise:.2g} dB in {window.length:.3g} s: put all back by one step"

    # -- reasons -------------------------------------------------------------------------------------------------------
    def _lines(self, found: Found, known: Conditions, safety: float) -> Iterator[Line]:
        """A line for every knob, with what the search measured of it."""
        names = [k.name for k in self.space.knobs if not k.by_nature and k.name not in found.refused]
        names.sort(key=lambda name: name not in self.job.force)  # what was asked about is measured in any case
        known_pairs = pairs(self.space, self.bench, found.chosen.choice, names, UNSEEN + len(self.job.force))
        known_pairs |= {n: (lower, found.tried_from[n]) for n, lower in found.refused.items()}
        for knob in self.space.knobs:
            yield self._line(knob, found, known_pairs.get(knob.name), known, 1.0 / safety)

    def _line(self, knob: Knob, found: Found, pair: Pair | None, known: Conditions, most: float) -> Line:
        """pair: two measured sets that differ by one step of this knob, where there are such."""
        chosen, lower = found.chosen, found.refused.get(knob.name)
        verdict = _setting(knob, chosen.choice)
        formula = predicted(knob, self.space.cheapest(knob.name), known) if not knob.by_nature else math.nan
        alone = saved = math.nan
        if pair is not None:
            poorer, richer = pair
            alone = error(poorer.trial.signals, richer.trial.signals, self.job.request).whole
            saved = 1.0 - poorer.price / richer.price
        if knob.kept:
            return Line(knob.name, verdict, "policy", knob.kept, formula, alone, saved)
        if lower is None:
            reason = f"the set without it is {chosen.bound:.2g} budgets"
        elif math.isinf(lower.bound):
            reason = f"{_setting(knob, lower.choice)} does not reach the end of the window"
        elif lower.bound > most:
            reason = f"{_setting(knob, lower.choice)} makes the set {lower.bound:.2g} budgets, {most:.2g} is allowed"
        else:
            reason = f"{_setting(knob, lower.choice)} saves nothing"
        return Line(knob.name, verdict, "measured", reason, formula, alone, saved)


def _setting(knob: Knob, choice: Choice) -> str:
    """What a choice says of a knob."""
    ladders = {MODES: choice.level, STEP: f"{1e6 * choice.h:.3g} µs", SLICED: str(choice.slices)}
    return ladders.get(knob.name, "off" if knob.name in choice.off else "on")
