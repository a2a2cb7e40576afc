"""The price list of a planetary set: error and processor time over level, step, slices, number of planets and effects.

    python -m evidence.study.sets SCENE …

What is judged and how it is timed is as in the study of a pair (norm.py, bench.py), on the first milliseconds of the
scene: a set's step costs some 200 µs. Levels and steps are measured against level full with a step that is halved once
more to see what it still moves; numbers of planets each against their own; slices and effects against the same run with
five slices and all effects, so that their error is what they change and not that of time.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

from evidence.tables import told
from gearfmu.body import load_bodies, reduce_body
from gearfmu.commands.models import bodies_for_motion
from gearfmu.commands.shared import progress_bar
from gearfmu.errors import ModelError, SimulationError
from gearfmu.files import write_text
from gearfmu.kernel.build import fingerprint
from gearfmu.report.study import write_chart
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stage import StageModel
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.bench import Point, Replay, Run, measure, models_for, replayed_price
from gearfmu.study.ladder import fitting, window
from gearfmu.study.norm import Errors, Signals, errors
from gearfmu.study.run import identity
from gearfmu.study.table import KeptTable

STEPS = (10e-6, 6.7e-6, 5e-6, 2.5e-6, 1.25e-6)  # s
BASE_STEP, FINEST = 5e-6, 0.4e-6  # s
SLICES = (1, 10)
PLANETS = (3, 5)
COARSE = 0.5  # of the element counts of a carrier made for another number of planets
EFFECTS = ("hertz", "contact_damping", "tip_relief", "tip_contact", "elastic")
TURNING = ("coriolis", "centrifugal")
FAST_SPEED = 300.0  # rad/s of the input: the effects of turning axes are shown there too
HERE = Path(__file__).parent

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


def with_planets(spec: Stage, planets: int) -> Stage:
    """The set with another number of planets, as evenly spaced as its teeth allow, on a coarsely meshed carrier."""
    teeth = spec.written.sun.teeth + spec.written.ring.teeth
    places = None if teeth % planets == 0 else tuple(round(k * teeth / planets) for k in range(planets))
    mesh = spec.written.carrier.mesh.model_copy(update={"scale": COARSE * spec.written.carrier.mesh.scale})
    of_pins: dict[str, Any] = {"pin_errors": {}, "planet_eccentricity": {}}
    update = {
        "set": spec.written.set.model_copy(update={"planets": planets, "positions": places} | of_pins),
        "carrier": spec.written.carrier.model_copy(update={"mesh": mesh, "coupling": {}, "modes": 30 * planets}),
    }
    return rewritten(spec, **update)


def ladder(rows: Sequence[SetRow], planets: int) -> list[SetRow]:
    """The rows of levels and steps of a set with so many planets: those measured against level full."""
    return [row for row in rows if row.planets == planets and row.against.startswith("full") and not row.off]


@dataclass(frozen=True)
class _Case:
    """What points share: scene, model, and what their errors are measured against, made when it is needed first."""

    scene: SceneSpec
    model: Callable[[], StageModel]
    planets: int
    against: str
    wanted: Callable[[], Signals]


class SetStudy:
    """A price list that is being made: what sets.csv does not have yet is measured. Sets.csv is written after every
    point; sets.json says what the rows belong to: those of another kernel, stage or scene are dropped. Raises what a
    run raises, but a point that the kernel refuses is said.

    said: what the kernel refused or said, and what the references still move.
    """

    def __init__(self, scene: SceneSpec, tell: Tell) -> None:
        self.scene, self.tell = window(scene), tell
        spec = load_stage(scene.stage.name)
        self.spec, self.bodies, self.slices = spec, load_bodies(spec), scene.stage.slices
        self.planets = spec.written.set.planets
        self.model = self._model_of(spec, self.bodies)
        self.base = Point("fast", h=self._fitting(BASE_STEP), slices=self.slices)
        self.table = KeptTable(HERE / "sets.csv", SetRow)
        self.identity = identity(self.scene, self.model, fingerprint())
        kept = self._facts().get(scene.name, {})
        fits = kept.get("identity") == self.identity
        self.said: list[str] = kept.get("said", []) if fits else []
        if not fits:
            self.table.drop(scene.name)

    def rows(self) -> list[SetRow]:
        """Levels and steps, slices and effects of the shipped set, then other numbers of planets."""
        self._say()
        own, planets = (lambda: self.model), self.planets
        plain = f"fast, {1e6 * self.base.h:.3g} µs, {self.slices} slices"
        here = _Case(self.scene, own, planets, plain, lambda: self._base_run.signals)
        steps = [self._fitting(h) for h in STEPS]
        points = [Point(level, h=h, slices=self.slices) for level in LEVELS for h in steps]
        self._add(self._against_full(own, planets), points)
        self._add(here, [replace(self.base, slices=n) for n in SLICES if n != self.slices])
        self._add(here, [replace(self.base, off=(effect,)) for effect in EFFECTS + TURNING])
        fast = at_speed(self.scene, FAST_SPEED)
        there = _Case(fast, own, planets, plain, cache(lambda: measure(fast, self.model, self.base).signals))
        self._add(there, [replace(self.base, off=(effect,)) for effect in TURNING])
        for count in (n for n in PLANETS if n != planets):
            self._add(self._against_full(cache(partial(self._with_planets, count)), count), [self.base])
        return self.table.of(self.scene.name)

    def _model_of(self, spec: Stage, bodies: Sequence[Any]) -> StageModel:
        return models_for(self.scene, bodies, **{name: getattr(spec.written, name) for name in ("set", "carrier")})

    def _with_planets(self, planets: int) -> StageModel:
        self.tell(0.0, f"carrier of {planets} planets")
        spec = with_planets(self.spec, planets)
        return self._model_of(spec, [*self.bodies[:3], reduce_body(spec, "carrier")])

    def _fitting(self, wished: float) -> float:
        return fitting(self.scene.coupling.step, wished)

    @cached_property
    def _base_run(self) -> Run:
        """What slices and effects at the scene's speed, and all prices, are compared with."""
        return measure(self.scene, self.model, self.base)

    @cached_property
    def _base_replay(self) -> Replay:
        assert self._base_run.recording is not None
        return Replay(self._base_run.recording)

    def _against_full(self, model: Callable[[], StageModel], planets: int) -> _Case:
        """Points against level full at the finest step."""
        h = self._fitting(FINEST)

        def wanted() -> Signals:
            self.tell(0.0, "reference")
            coarse, fine = (
                measure(self.scene, model(), Point("full", h=step, slices=self.slices)) for step in (2 * h, h)
            )
            moved = _percent(errors(coarse.signals, fine.signals))
            self._say(f"reference of {planets} planets, full, {1e6 * h:.3g} µs: halved last it moved {moved}")
            return fine.signals

        return _Case(self.scene, model, planets, f"full, {1e6 * h:.3g} µs", cache(wanted))

    def _add(self, case: _Case, points: Sequence[Point]) -> None:
        for point in points:
            if any(_is_at(row, case, point) for row in self.table.of(self.scene.name)):
                continue
            where = f"{case.planets} planets, {case.scene.start.pinion_speed:g} rad/s, {point.level}, "
            where += f"{1e6 * point.h:.3g} µs, {point.slices} slices" + "".join(f", {off} off" for off in point.off)
            self.tell(min(len(self.table.of(self.scene.name)) / 40, 1.0), where)
            wanted = case.wanted()
            try:
                run = measure(case.scene, case.model(), point)
            except (ModelError, SimulationError) as error:
                self._say(f"{where}: {error}")
                continue
            if run.warning:
                self._say(f"{where}: {run.warning}")
            self.table.add(self._row(case, run, wanted))

    def _row(self, case: _Case, run: Run, wanted: Signals) -> SetRow:
        assert run.recording is not None
        e, price = errors(run.signals, wanted), replayed_price(Replay(run.recording), self._base_replay)
        head = (self.scene.name, case.planets, case.scene.start.pinion_speed, run.point.level, run.h, run.point.slices)
        found = (e.te, e.te_mean, e.force, e.bearing, price.realtime_factor, price.cpu_ratio)
        return SetRow(*head, " ".join(run.point.off), run.n_dyn, case.against, *found)

    def _facts(self) -> dict[str, Any]:
        try:
            return dict(json.loads((HERE / "sets.json").read_text(encoding="utf-8")))
        except (OSError, ValueError):
            return {}

    def _say(self, *texts: str) -> None:
        """Kept beside the table: a study that goes on says it again."""
        self.said = list(dict.fromkeys([*self.said, *texts]))
        facts = self._facts() | {self.scene.name: {"identity": self.identity, "said": self.said}}
        write_text(HERE / "sets.json", json.dumps(facts, indent=1, sort_keys=True) + "\n")


def _is_at(row: SetRow, case: _Case, point: Point) -> bool:
    """Whether the row is this point."""
    same = (row.planets, row.speed, row.level, row.slices, row.off, row.against)
    wanted = (case.planets, case.scene.start.pinion_speed, point.level, point.slices, " ".join(point.off), case.against)
    return same == wanted and math.isclose(row.h_s, point.h, rel_tol=1e-4)


def _percent(e: Errors) -> str:
    return f"te {100 * e.te:.2g} %, mesh forces {100 * e.force:.2g} %, pins {100 * e.bearing:.2g} %"


def main(scenes: Sequence[str]) -> None:
    """Price lists of the scenes' sets, and their charts."""
    for spec in map(load_scene, scenes):
        bodies_for_motion(spec.stage.name)
        with progress_bar(spec.name) as progress:
            study = SetStudy(spec, progress)
            rows = study.rows()
        told(map(asdict, rows))
        print(*(f"- {note}" for note in study.said), sep="\n")
        title = f"{spec.name}: {spec.description}"
        write_chart(ladder(rows, study.planets), spec.stage.slices, HERE / spec.name, title)


if __name__ == "__main__":
    main(sys.argv[1:])
