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
from gearfmu.planning.search import Bench, Found, Measured, measurable, neighbours, search
from gearfmu.planning.segments import Part, parts
from gearfmu.planning.trials import Task, run_trials
from gearfmu.planning.windows import GROWN, LONGEST, QUIET, Noise, mesh_frequency, quiet_enough
from gearfmu.spec.scene import SceneSpec
from gearfmu.stage import StageModel
from gearfmu.sweeps.runners import Runner

LONGER = 4  # windows that the chosen set is run alone for, to see slow growth
GROWTH = 0.5  # of the budget (of 1 dB where none is given in dB) over these windows
RETRIES = 3
Tell = Callable[[str], None]


class PlanError(GearfmuError):
    """A plan that cannot be made as asked."""


@dataclass(frozen=True)
class Job:
    """What a plan is made of. least_share: effects that cost less of a step stay on; force: effects that are candidates
    nevertheless; tell: is told what is done."""

    scene: SceneSpec
    model: StageModel
    request: Request
    runner: Runner
    least_share: float = LEAST_SHARE
    force: tuple[str, ...] = ()
    tell: Tell = field(default=lambda text: None)

    @property
    def identity(self) -> str:
        """Hex digest of what decides the plan: scene, model, request, policy, kernel, format."""
        kernel = hashlib.sha256(library_path().read_bytes()).hexdigest()
        asked = (self.scene.hash, self.model.hash, sorted(self.request.plain.items()), self.least_share, self.force)
        return hashlib.sha256(f"{FORMAT} {asked} {kernel}".encode()).hexdigest()


def make(job: Job, name: str) -> Plan:
    """The plan of a scene, which is written down as `name`. PlanError where the full model does not run, where an
    output has no signal in the band, and where a waveform is asked of a motion that does not repeat."""
    segments, cpu, unit = [], 0.0, 0.0
    for part in parts(job.scene, job.model, job.request):
        made = _Made(job, part)
        segments.append(made.segment())
        cpu, unit = cpu + made.bench.cpu, unit + made.bench.full.cpu
    return Plan(name, job.identity, job.scene.coupling.step, job.request.plain, tuple(segments), cpu / unit, cpu)


class _Made:
    """One segment in the making."""

    def __init__(self, job: Job, part: Part) -> None:
        self.job, self.part = job, part
        self.space: Space = space(job.scene, job.model, job.least_share, job.force)
        self.text = job.scene.model_dump_json()
        task = Task(self.text, self.space.full, part.window, job.request)
        job.tell(f"{part.name}: full model over {1e3 * part.window.length:.3g} ms")
        full = run_trials([task], job.runner)[0]
        if full.outcome != OK:
            raise PlanError(f"the full model does not run through {part.name}: {full.outcome}: {full.message}")
        self.bench = Bench(self.text, part.window, job.request, full, job.runner, cpu=full.cpu)

    def segment(self) -> Segment:
        """Window, noise, search, slow growth, reasons."""
        job, bench = self.job, self.bench
        full, window, noise = quiet_enough(bench, self.part.longest, self.part.kind == "loaded")
        self._refuse_silence()
        self._refuse_chaos(noise)
        safety = SAFETY_LOSS if full.loses_contact else SAFETY
        known = Conditions(job.model, job.request, full.force, self.part.speed, self._mesh_hz(), full)
        found, notes = self._search(known, safety)
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
            max(noise.split if full.loses_contact else 0.0, noise.twin),
            found.chosen.price,
            found.chosen.trial.realtime,
            full.price,
            own.price,
            own.error.whole,
            lines,
            self._points(found.chosen),
            (*notes, *_noise_notes(noise, full.loses_contact)),
        )

    def _points(self, chosen: Measured) -> tuple[Point, ...]:
        """All that was measured and ran, the full model among it."""
        full = self.bench.full
        known = [m for m in self.bench.known.values() if m.price > 0 and m.bound < FAILED]
        made = [Point(m.choice.words, m.price, m.bound, m == chosen) for m in known]
        return (*made, Point(f"full model, {full.choice.words}", full.price, 0.0, False))

    def _mesh_hz(self) -> float:
        return mesh_frequency(self.job.model, self.part.speed)

    def _own(self) -> Measured:
        """What the scene asks for itself."""
        choice = self.job.scene.stage
        return self.bench.one(Choice(choice.level, choice.h, choice.slices, tuple(sorted(choice.effects.off))))

    def _refuse_silence(self) -> None:
        silent = silent_outputs(self.bench.full.signals, self.job.request)
        if silent:
            low, high = self.job.request.band
            raise PlanError(
                f"{', '.join(silent)}: no signal in {low:g} … {high:g} Hz, its level has no error: leave it out, or "
                "choose another band"
            )

    def _refuse_chaos(self, noise: Noise) -> None:
        budget = self.job.request.waveform
        if budget is None or not noise.waveform > GROWN * budget:
            return
        raise PlanError(
            f"{self.part.name}: the waveform does not repeat: a small disturbance before it changes it by "
            f"{100 * noise.waveform:.2g} %, so that no model keeps {100 * budget:g} %. Ask for levels, which repeat "
            f'within {noise.twin * (self.job.request.level or 1.0):.2g} dB here: --budget "1 dB"'
        )

    def _search(self, known: Conditions, safety: float) -> tuple[Found, list[str]]:
        """The search, again from a richer set while the chosen one grows slowly."""
        job, notes = self.job, list[str]()
        found = search(self.space, self.bench, known, safety, job.tell)
        for _ in range(RETRIES):
            grown = self._growth(found)
            if grown is None:
                break
            notes.append(grown)
            job.tell(grown)
            richer = self.bench.one(self.space.all_richer(found.chosen.choice))
            found = replace(found, chosen=richer, kept=richer.bound * safety <= 1)
        if not found.kept:
            notes.append("no set cheaper than the full model keeps the budget: the full model is taken")
        return found, notes

    def _growth(self, found: Found) -> str | None:
        """What the chosen set does alone over LONGER windows, where the scene is steady: None when it stays."""
        if self.part.kind != "loaded":
            return None
        window = replace(self.bench.window, length=LONGER * self.bench.window.length)
        choice = found.chosen.choice
        trial = run_trials([Task(self.text, choice, window, self.job.request, priced=False)], self.job.runner)[0]
        self.bench.cpu += trial.cpu
        if trial.outcome != OK:
            return f"{choice.words}: does not reach {window.end:.3g} s: {trial.outcome}: put all back by one step"
        rise = trend(trial.signals, self.job.request)
        if rise <= GROWTH * (self.job.request.level or 1.0):
            return None
        return f"{choice.words}: grows by {rise:.2g} dB in {window.length:.3g} s: put all back by one step"

    # -- reasons -------------------------------------------------------------------------------------------------------
    def _lines(self, found: Found, known: Conditions, safety: float) -> Iterator[Line]:
        """A line for every knob. What the search left open is measured: one step down, where there is none one up."""
        chosen = found.chosen.choice
        names = measurable(self.space.knobs)
        lower = neighbours(self.space.cheaper, self.bench, chosen, [n for n in names if n not in found.refused])
        lower |= found.refused
        richer = neighbours(self.space.richer, self.bench, chosen, [n for n in names if n not in lower])
        for knob in self.space.knobs:
            pair = lower.get(knob.name), richer.get(knob.name)
            yield self._line(knob, found.chosen, pair, known, 1.0 / safety)

    def _line(
        self,
        knob: Knob,
        chosen: Measured,
        beside: tuple[Measured | None, Measured | None],
        known: Conditions,
        most: float,
    ) -> Line:
        """beside: the chosen set with a step down and with a step up of this knob, where there are such."""
        verdict, lower = _verdict(knob, chosen.choice), beside[0]
        formula = predicted(knob, self.space.cheapest(knob.name), known) if not _by_nature(knob) else math.nan
        alone = self._alone(chosen, lower or beside[1])
        if knob.kept:
            return Line(knob.name, verdict, "policy", knob.kept, formula, alone, knob.share)
        if lower is None:
            reason = f"the set without it is {chosen.bound:.2g} budgets"
        elif lower.bound > most:
            reason = f"{_step_down(knob, lower.choice)} makes the set {lower.bound:.2g} budgets, {most:.2g} is allowed"
        else:
            reason = f"{_step_down(knob, lower.choice)} saves nothing"
        return Line(knob.name, verdict, "measured", reason, formula, alone, knob.share)

    def _alone(self, chosen: Measured, other: Measured | None) -> float:
        """What this one knob changes: distance of the two runs, budgets."""
        if other is None:
            return math.nan
        return error(other.trial.signals, chosen.trial.signals, self.job.request).whole


def _by_nature(knob: Knob) -> bool:
    return bool(knob.effect and knob.effect.kept)


def _verdict(knob: Knob, choice: Choice) -> str:
    if knob.name == MODES:
        return choice.level
    if knob.name == STEP:
        return f"{1e6 * choice.h:.3g} µs"
    if knob.name == SLICED:
        return str(choice.slices)
    return "off" if knob.name in choice.off else "on"


def _step_down(knob: Knob, lower: Choice) -> str:
    """What the step down is."""
    return {MODES: lower.level, STEP: f"{1e6 * lower.h:.3g} µs", SLICED: f"{lower.slices}"}.get(knob.name, "off")


def _noise_notes(noise: Noise, lost: bool) -> Iterator[str]:
    if lost and noise.split > QUIET:
        yield (
            f"noise floor: two halves of the full model's window differ by {noise.split:.2g} budgets: no window up to "
            f"{LONGEST:g} s, or in the part, says more"
        )
