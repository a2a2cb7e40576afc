"""The price list of a planetary set: error and processor time over level, step, slices, number of planets and effects.

What is judged and how it is timed is as in the study of a pair (norm.py, bench.py), on the first milliseconds of the
scene: a set's step costs some 200 µs. Levels and steps are measured against level full with a step that is halved once
more to see what it still moves; numbers of planets each against their own; slices and effects against the same run with
five slices and all effects, so that their error is what they change and not that of time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from gearfmu.body import load_bodies
from gearfmu.body.planetary import reduce_set_body
from gearfmu.errors import ModelError, SimulationError
from gearfmu.spec.planetary import PlanetarySpec
from gearfmu.spec.scene import SceneSpec
from gearfmu.spec.stage import load_stage
from gearfmu.stage import StageModel
from gearfmu.study.bench import Point, Price, Replay, Run, measure, models_for, replayed_price
from gearfmu.study.ladder import LEVELS, fitting
from gearfmu.study.norm import Errors, Signals, errors

SETTLE, DURATION = 5e-3, 15e-3  # s
STEPS = (10e-6, 6.7e-6, 5e-6, 2.5e-6, 1.25e-6)  # s
BASE_STEP, FINEST = 5e-6, 0.3125e-6  # s
SLICES = (1, 3, 10)
PLANETS = (2, 3, 5)
COARSE = 0.5  # of the element counts of a carrier made for another number of planets
EFFECTS = ("hertz", "coast_flank", "contact_damping", "tip_relief", "tip_contact", "modal_damping", "elastic")
TURNING = ("coriolis", "centrifugal")
FAST_SPEED = 300.0  # rad/s of the input: the effects of turning axes are shown there too
QUICK_STEPS = (10e-6, 5e-6)

Tell = Callable[..., None]


@dataclass(frozen=True)
class SetRow:
    """One point of the price list. speed (rad/s): of the input at the start; off: the effect that is off; against: what
    the errors are measured against. Errors: study/norm.py, pin: the worst planet's. realtime_factor: processor seconds
    of the stage per simulated second; cpu_ratio: that over the cost of the shipped number of planets at level fast and
    5 µs, measured in turn."""

    scene: str
    planets: int
    speed: float
    level: str
    h_s: float
    slices: int
    off: str
    n_dyn: int
    against: str
    te_error: float
    te_mean_error: float
    force_error: float
    pin_error: float
    realtime_factor: float
    cpu_ratio: float

    @property
    def integrator(self) -> str:
        """The only one of the list."""
        return "dg4"

    @property
    def bearing_error(self) -> float:
        """The pins', by the name that rows of a pair have."""
        return self.pin_error


@dataclass(frozen=True)
class SetStudy:
    """Rows of a scene; sentences about them: what the kernel refused or said, and what the references still move."""

    rows: tuple[SetRow, ...]
    notes: tuple[str, ...]


def set_study(scene: SceneSpec, quick: bool = False, progress: Tell | None = None) -> SetStudy:
    """The price list of the scene's planetary set; quick: few points on a short window. Raises what a run raises."""
    return _SetStudy(scene, quick, progress or (lambda fraction, text="": None)).go()


def window(scene: SceneSpec, quick: bool = False) -> SceneSpec:
    """The part of the scene that is run."""
    share = 0.2 if quick else 1.0
    update = {"settle": min(scene.settle, share * SETTLE), "duration": min(scene.duration, share * DURATION)}
    return scene.model_copy(update=update)


def at_speed(scene: SceneSpec, speed: float) -> SceneSpec:
    """The scene with another speed (rad/s) of its input at the start, and loads that follow speeds in proportion."""
    share = speed / scene.start.pinion_speed
    loads = {
        name: load
        if load.proportional is None
        else load.model_copy(
            update={"proportional": load.proportional.model_copy(update={"speed": share * load.proportional.speed})}
        )
        for name, load in (scene.shaft_loads or {}).items()
    }
    start = scene.start.model_copy(update={"pinion_speed": speed})
    return scene.model_copy(update={"start": start, "shaft_loads": loads or None})


def with_planets(spec: PlanetarySpec, planets: int) -> PlanetarySpec:
    """The set with another number of planets, as evenly spaced as its teeth allow, on a coarsely meshed carrier."""
    teeth = spec.sun.teeth + spec.ring.teeth
    places = None if teeth % planets == 0 else tuple(round(k * teeth / planets) for k in range(planets))
    mesh = spec.carrier.mesh.model_copy(update={"scale": COARSE * spec.carrier.mesh.scale})
    update = {
        "set": spec.set.model_copy(update={"planets": planets, "positions": places, "pin_errors": {}}),
        "carrier": spec.carrier.model_copy(update={"mesh": mesh, "coupling": {}, "modes": 30 * planets}),
    }
    return spec.model_copy(update=update)


def ladder(rows: Sequence[SetRow], planets: int) -> list[SetRow]:
    """The rows of levels and steps of a set with so many planets: those measured against level full."""
    return [row for row in rows if row.planets == planets and row.against.startswith("full") and not row.off]


class _SetStudy:
    """A price list that is being made."""

    def __init__(self, scene: SceneSpec, quick: bool, tell: Tell) -> None:
        self.scene, self.quick, self.tell = window(scene, quick), quick, tell
        spec = load_stage(scene.stage.name)
        assert isinstance(spec, PlanetarySpec)
        self.spec, self.bodies = spec, load_bodies(spec)
        self.slices = scene.stage.slices
        self.rows: list[SetRow] = []
        self.said: list[str] = []
        self.base: Replay | None = None

    def go(self) -> SetStudy:
        model = self._model(self.spec, self.bodies)
        base = Point("fast", h=self._fitting(BASE_STEP), slices=self.slices)
        first = measure(self.scene, model, base)
        assert first.recording is not None
        self.base = Replay(first.recording)
        self._ladder(model)
        self._changes(self.scene, model, first)
        if not self.quick:
            fast = at_speed(self.scene, FAST_SPEED)
            self._changes(fast, model, measure(fast, model, base), TURNING)
            for planets in (n for n in PLANETS if n != self.spec.set.planets):
                self._planets(planets, base)
        return SetStudy(tuple(self.rows), tuple(dict.fromkeys(self.said)))

    def _model(self, spec: PlanetarySpec, bodies: Sequence[Any]) -> StageModel:
        return models_for(self.scene, bodies, **{name: getattr(spec, name) for name in ("set", "carrier")})

    def _fitting(self, wished: float) -> float:
        return fitting(self.scene.coupling.step, wished)

    def _ladder(self, model: StageModel) -> None:
        """Levels and steps against level full."""
        wanted, name = self._reference(self.scene, model)
        steps = [self._fitting(h) for h in (QUICK_STEPS if self.quick else STEPS)]
        levels = ("rigid", "fast") if self.quick else LEVELS
        for level in levels:
            for h in steps:
                self._add(self.scene, model, Point(level, h=h, slices=self.slices), wanted, name)

    def _changes(self, scene: SceneSpec, model: StageModel, plain: Run, effects: Sequence[str] = ()) -> None:
        """Slices and effects, or these effects alone, against the same run with all of them."""
        point = plain.point
        name = f"{point.level}, {1e6 * plain.h:.3g} µs, {point.slices} slices"
        if not effects:
            for slices in (count for count in (SLICES[:1] if self.quick else SLICES) if count != point.slices):
                self._add(scene, model, replace(point, slices=slices), plain.signals, name)
        for effect in effects or (TURNING if self.quick else EFFECTS + TURNING):
            self._add(scene, model, replace(point, off=(effect,)), plain.signals, name)

    def _planets(self, planets: int, point: Point) -> None:
        """Another number of planets at level fast against its own reference."""
        self.tell(0.0, f"carrier of {planets} planets")
        spec = with_planets(self.spec, planets)
        model = self._model(spec, [*self.bodies[:3], reduce_set_body(spec, "carrier")])
        wanted, name = self._reference(self.scene, model)
        self._add(self.scene, model, point, wanted, name)

    def _reference(self, scene: SceneSpec, model: StageModel) -> tuple[Signals, str]:
        """Level full at twice and once the finest step, and its name."""
        finest = 4 * FINEST if self.quick else FINEST
        self.tell(0.0, "reference")
        coarse, fine = (
            measure(scene, model, Point("full", h=self._fitting(h), slices=self.slices)) for h in (2 * finest, finest)
        )
        moved, name = errors(coarse.signals, fine.signals), f"full, {1e6 * fine.h:.3g} µs"
        assert isinstance(model.spec, PlanetarySpec)
        self.said.append(
            f"reference of {model.spec.set.planets} planets, {name}: halved last it moved {_percent(moved)}"
        )
        return fine.signals, name

    def _add(self, scene: SceneSpec, model: StageModel, point: Point, wanted: Signals, against: str) -> None:
        assert isinstance(model.spec, PlanetarySpec)
        planets, off = model.spec.set.planets, " ".join(point.off)
        where = f"{planets} planets, {point.level}, {1e6 * point.h:.3g} µs, {point.slices} slices"
        where += f", {off} off" if off else ""
        self.tell(min(len(self.rows) / 40, 1.0), where)
        try:
            run = measure(scene, model, point)
        except (ModelError, SimulationError) as error:
            self.said.append(f"{where}: {error}")
            return
        if run.warning:
            self.said.append(f"{where}: {run.warning}")
        e, price = errors(run.signals, wanted), self._price(run)
        head = (self.scene.name, planets, scene.start.pinion_speed, point.level, run.h, point.slices, off, run.n_dyn)
        self.rows.append(
            SetRow(*head, against, e.te, e.te_mean, e.force, e.bearing, price.realtime_factor, price.cpu_ratio)
        )

    def _price(self, run: Run) -> Price:
        assert self.base is not None and run.recording is not None
        return replayed_price(Replay(run.recording), self.base)


def _percent(e: Errors) -> str:
    return f"te {100 * e.te:.2g} %, mesh forces {100 * e.force:.2g} %, pins {100 * e.bearing:.2g} %"
