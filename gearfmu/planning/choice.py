"""One choice of fidelity, and those next to it: a level, an internal step, slices, effects that are off."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.stage.effects import EFFECTS, Effect, costs
from gearfmu.stage.run.refinement import twice
from gearfmu.study.ladder import SLICES, STEPS, fitting

LEAST_SHARE = 0.03  # of the cost of a step: what saves less stays on
FULL = "full"
FULL_STEP, FULL_STEP_OF_SETS = 2e-6, 4e-6  # s; a step of a set costs twenty times as much
MODES, SLICED, STEP = "modes", "slices", "step"


@dataclass(frozen=True)
class Choice:
    """level; h: internal step, s; slices; off: names of the effects that are off, sorted."""

    level: str
    h: float
    slices: int
    off: tuple[str, ...] = ()

    def of(self, scene: SceneSpec) -> SceneSpec:
        """The scene with this choice."""
        effects = scene.stage.effects.model_copy(update=dict.fromkeys(self.off, False))
        return scene.with_stage(level=self.level, h=self.h, slices=self.slices, effects=effects)

    def without(self, effect: str) -> Choice:
        """The choice with this effect off."""
        return replace(self, off=tuple(sorted({*self.off, effect})))

    def with_(self, effect: str) -> Choice:
        """The choice with this effect on."""
        return replace(self, off=tuple(name for name in self.off if name != effect))

    @property
    def words(self) -> str:
        """ "fast, 10 µs, 1 slice, hertz off"."""
        slices = f"{self.slices} slice{'s' * (self.slices > 1)}"
        step = f"{1e6 * self.h:.3g} µs" if self.h else "default step"
        return ", ".join([self.level, step, slices, *(f"{name} off" for name in self.off)])


@dataclass(frozen=True)
class Knob:
    """What may be chosen: `modes`, `step` and `slices` have a ladder, an effect is on or off. share: of the cost of a
    step that goes with it; kept: why it is no candidate, "" where it is one."""

    name: str
    share: float
    kept: str = ""
    effect: Effect | None = None

    @property
    def by_nature(self) -> bool:
        """Whether it is kept by its nature: no trial shows its error."""
        return bool(self.effect and self.effect.kept)


@dataclass(frozen=True)
class Space:
    """All choices for a scene: `full`, what all is measured against, and steps downward from any choice."""

    full: Choice
    knobs: tuple[Knob, ...]
    steps: tuple[float, ...]
    slices: tuple[int, ...]

    @property
    def candidates(self) -> list[Knob]:
        """What is not kept by policy, the dearest first."""
        return sorted((knob for knob in self.knobs if not knob.kept), key=lambda knob: -knob.share)

    def cheaper(self, choice: Choice, knob: str) -> Choice | None:
        """One step down; None at the end."""
        if knob == MODES:
            at = LEVELS.index(choice.level)
            return replace(choice, level=LEVELS[at - 1]) if at else None
        if knob == STEP:
            larger = [h for h in self.steps if h > choice.h * (1 + 1e-9)]
            return replace(choice, h=min(larger)) if larger else None
        if knob == SLICED:
            fewer = [n for n in self.slices if n < choice.slices]
            return replace(choice, slices=max(fewer)) if fewer else None
        return None if knob in choice.off else choice.without(knob)

    def richer(self, choice: Choice, knob: str) -> Choice | None:
        """One step up; None at the end."""
        if knob == MODES:
            at = LEVELS.index(choice.level)
            return replace(choice, level=LEVELS[at + 1]) if choice.level != self.full.level else None
        if knob == STEP:
            smaller = [h for h in self.steps if h < choice.h * (1 - 1e-9)]
            return replace(choice, h=max(smaller)) if smaller else None
        if knob == SLICED:
            more = [n for n in self.slices if n > choice.slices]
            return replace(choice, slices=min(more)) if more else None
        return choice.with_(knob) if knob in choice.off else None

    def all_richer(self, choice: Choice) -> Choice:
        """Every knob one step up."""
        for knob in (MODES, STEP, SLICED, *choice.off):
            choice = self.richer(choice, knob) or choice
        return choice

    def cheapest(self, knob: str) -> Choice:
        """`full` with the knob as far down as it goes."""
        choice = self.full
        while (lower := self.cheaper(choice, knob)) is not None:
            choice = lower
        return choice


def space(scene: SceneSpec, model: StageModel, least_share: float = LEAST_SHARE, force: Iterable[str] = ()) -> Space:
    """What may be chosen for a scene. Effects that the scene switches off stay off; of the others the table of effects
    says which are kept. least_share: effects that cost less stay on, but those of `force`."""
    step = scene.coupling.step
    finest = FULL_STEP_OF_SETS if model.stage.carriers else FULL_STEP
    steps = sorted({fitting(step, h) for h in (*STEPS, finest) if h >= finest})
    own = scene.stage.slices
    most = twice(model.stage, own)  # a discretisation of helical stages: what all is measured against is finer
    slices = tuple(sorted({n for n in SLICES if n < own} | {own, most}))
    full = Choice(FULL, fitting(step, finest), most, tuple(sorted(scene.stage.effects.off)))
    return Space(full, tuple(_knobs(scene, model, least_share, tuple(force))), tuple(steps), slices)


def _can_be_off(effect: Effect, starts: Mapping[str, float]) -> bool:
    """Whether the stage has it, on, with a parameter that turns it off."""
    off = effect.off_setting
    return bool(off) and set(off) <= set(starts) and any(starts[name] != value for name, value in off.items())


def _knobs(scene: SceneSpec, model: StageModel, least: float, force: tuple[str, ...]) -> Iterator[Knob]:
    known, starts = costs(), {v.name: v.start for v in model.kernel_variables()}
    for effect in EFFECTS:
        share = known[effect.name].share if effect.name in known else float("nan")
        if effect.name in (MODES, SLICED):
            yield Knob(effect.name, share, effect=effect)
        elif effect.name in scene.stage.effects.off or not _can_be_off(effect, starts):
            continue
        else:
            small = f"costs {share:.1%} of a step" if share < least and effect.name not in force else ""
            yield Knob(effect.name, share, effect.kept or small, effect)
    yield Knob(STEP, 1.0 - FULL_STEP / max(STEPS))
