"""The study of a scene: error and price of every point of the ladder, kept in CSV files as they come, so that a study
that was interrupted goes on where it stopped.

Points are measured against a reference: all stored modes, the step halved until the halving moves it less than a fifth
of the error of the finest point of the study."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from gearfmu.cosim.coupled import OK
from gearfmu.errors import GearfmuError, ModelError
from gearfmu.files import write_text
from gearfmu.kernel.build import fingerprint
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel, Trace
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.stage.run.refinement import twice
from gearfmu.stage.run.trace import TraceError
from gearfmu.study.bench import Point, Price, Run, default_step, measure, models_for, paired_price
from gearfmu.study.ladder import QUICK_STEPS, STEPS, base_point, fitting, points, window
from gearfmu.study.norm import Errors, Signals, band_error, errors, kept_signals, lock_time
from gearfmu.study.table import KeptTable, ReferenceRow, Row, TransientRow
from gearfmu.sweeps.runners import Lost, Runner, in_this_process

FORMAT = 2  # of what is kept: a study of another format is measured anew
Progress = Callable[..., None]
SHARE = 0.2  # of the error of the finest point: the most that a reference may move
FINEST = 0.2e-6  # s: the smallest step of a reference; every shipped scene has one at 0.208 µs
FIRST = 3  # first reference: the finest step of the study over this


@dataclass(frozen=True)
class Reference:
    """Signals at step h (s); moved: distance to the run with twice the step; finest: error of the finest point of
    level full; reached: whether that moved by less than a fifth of it."""

    signals: Signals
    h: float
    n_dyn: int
    moved: Errors
    finest: Errors

    @property
    def reached(self) -> bool:
        return self.moved.below(SHARE, self.finest)


def make_reference(scene: SceneSpec, model: StageModel, slices: int, quick: bool = False) -> Reference:
    """Run the scene with ever smaller steps until `reached`, or at most to FINEST; a helical stage with twice the
    slices."""
    slices = twice(model.stage, slices)

    def run(h: float) -> Run:
        return measure(scene, model, Point("full", h=h, slices=slices))

    h = fitting(scene.coupling.step, min(QUICK_STEPS if quick else STEPS))
    finest, h = run(h).signals, h / FIRST
    coarse = run(h).signals
    while True:
        h /= 2
        made = run(h)
        found = Reference(made.signals, h, made.n_dyn, errors(coarse, made.signals), errors(finest, made.signals))
        if found.reached or h / 2 < FINEST:
            return found
        coarse = made.signals


def kept_reference(path: Path, identity: str) -> Reference | None:
    """The reference in a file, when it is there and of this identity."""
    try:
        trace = Trace.load(path)
    except TraceError:
        return None
    meta = trace.meta
    if meta.get("identity") != identity:
        return None
    parts = {name: Errors(**meta[name]) for name in ("moved", "finest")}
    return Reference(kept_signals(trace), meta["h"], meta["n_dyn"], **parts)


def keep_reference(reference: Reference, path: Path, identity: str) -> None:
    """Write it, for a study that goes on later."""
    parts = {name: vars(getattr(reference, name)) for name in ("moved", "finest")}
    reference.signals.trace({"identity": identity, "h": reference.h, "n_dyn": reference.n_dyn, **parts}).save(path)


@dataclass(frozen=True)
class Study:
    """A finished study of one scene: its rows, what they are measured against by number of slices, and sentences about
    them."""

    scene: SceneSpec
    model: StageModel
    rows: tuple[Row, ...]
    references: Mapping[int, Reference]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Job:
    """A scene, the folder for the files, quick: few points on a short window, defaults: only the default step of each
    level with the scene's slices, runner: who computes."""

    scene: SceneSpec
    out: Path
    quick: bool = False
    defaults: bool = False
    runner: Runner = in_this_process

    @property
    def window(self) -> SceneSpec:
        """The scene as it is run."""
        return window(self.scene, self.quick)


@lru_cache(maxsize=1)
def _bench(text: str) -> tuple[SceneSpec, StageModel, Run]:
    """What every point of a scene shares in one process: scene, model, the run that prices are compared with."""
    scene = SceneSpec.model_validate_json(text)
    model = models_for(scene)
    return scene, model, measure(scene, model, base_point(scene))


def _price_of(text: str, point: Point) -> tuple[Run, Price] | str:
    """A measured point without its recording, or why the kernel refuses it."""
    scene, model, base = _bench(text)
    try:
        run = measure(scene, model, point)
    except ModelError as error:
        return str(error)
    return replace(run, recording=None), paired_price(run, base)


def _reference_of(text: str, quick: bool, slices: int) -> Reference:
    scene, model, _ = _bench(text)
    return make_reference(scene, model, slices, quick)


def identity(scene: SceneSpec, model: StageModel, kernel: str) -> str:
    """Hex digest of what decides the numbers: scene, stage with bodies (the model), kernel library, format."""
    return hashlib.sha256(f"{FORMAT} {scene.hash} {model.hash} {kernel}".encode()).hexdigest()


def study(job: Job, progress: Progress | None = None) -> Study:
    """Measure what is not yet in the folder and return all of it.

    Writes study.csv, references.csv, transient.csv, study.json, reference/*.h5 in job.out, after every point. Raises
    SpecError or BodyError when the scene cannot be run.
    """
    return _Study(job, progress or (lambda fraction, text="": None)).go()


class _Study:
    def __init__(self, job: Job, tell: Progress) -> None:
        self.job, self.tell, self.scene = job, tell, job.window
        self.text = self.scene.model_dump_json()
        self.model = models_for(self.scene)
        self.kernel = fingerprint()
        self.identity = identity(self.scene, self.model, self.kernel)
        self.tables = {kind: KeptTable(job.out / name, kind) for name, kind in FILES.items()}
        kept = _facts(job.out).get(self.scene.name, {})
        self.said: list[str] = kept.get("said", [])
        if kept.get("identity") != self.identity:
            self.said = []
            for table in self.tables.values():
                table.drop(self.scene.name)

    def go(self) -> Study:
        """References first, then the points."""
        wanted = self.wanted()
        slices = sorted({point.slices for point in wanted})
        known = self.tables[Row].of(self.scene.name)
        missing = [point for point in wanted if not any(_is_at(row, point) for row in known)]
        self._write_facts()
        references = self.references(slices)
        for done, (point, found) in enumerate(self._each(partial(_price_of, self.text), missing)):
            self.tell((done + 1) / (len(missing) + 1), f"{point.level} {point.integrator}, {point.slices} slices")
            self._keep(point, found, references[point.slices])
        known = self.tables[Row].of(self.scene.name)
        rows = tuple(row for row in known if any(_is_at(row, point) for point in wanted))
        return Study(self.scene, self.model, rows, references, tuple(self.said))

    def wanted(self) -> list[Point]:
        """Points with their default steps as numbers, each once."""
        all_points = points(self.scene, self.job.quick)
        if self.job.defaults:
            own = self.scene.stage.slices
            all_points = [p for p in all_points if not p.h and p.slices == own and p.level in LEVELS]
        found = [p if p.h else replace(p, h=default_step(self.scene, self.model, p)) for p in all_points]
        once: dict[tuple, Point] = {}
        for point in found:
            once.setdefault((point.level, point.integrator, f"{point.h:.6g}", point.slices), point)
        return list(once.values())

    def references(self, slices: list[int]) -> dict[int, Reference]:
        """Reference by number of slices, made or taken from the folder."""
        folder = self.job.out / "reference"
        paths = {count: folder / f"{self.scene.name}_{count}.h5" for count in slices}
        kept = {count: kept_reference(path, self.identity) for count, path in paths.items()}
        found = {count: reference for count, reference in kept.items() if reference is not None}
        missing = [count for count in slices if count not in found]
        for count, reference in self._each(partial(_reference_of, self.text, self.job.quick), missing):
            found[count] = reference
            keep_reference(reference, paths[count], self.identity)
        table = self.tables[ReferenceRow]
        table.drop(self.scene.name, slices)
        for count, r in sorted(found.items()):
            moved = (r.moved.te, r.moved.force, r.moved.bearing)
            table.add(ReferenceRow(self.scene.name, count, r.h, r.n_dyn, *moved, r.reached))
        return found

    def _each(self, work: Callable, items: list) -> Iterator[tuple]:
        """(item, work(item)) as they are done."""
        self.tell(None, "references" if items and isinstance(items[0], int) else "points")
        for number, found in self.job.runner(work, items):
            if isinstance(found, Lost):
                raise GearfmuError(f"{self.scene.name}: {found.message}")
            yield items[number], found

    def _keep(self, point: Point, found: tuple[Run, Price] | str, reference: Reference) -> None:
        where = f"{point.level}, {point.slices} slices"
        if isinstance(found, str):
            return self._say(f"{where}, {1e6 * point.h:.3g} µs: refused: {found}")
        run, price = found
        if run.outcome != OK:
            self._say(f"{where}, {1e6 * run.h:.3g} µs: stopped: {run.outcome}")
        if run.warning:
            self._say(f"{where}: {run.warning}")
        self.tables[Row].add(_row(self.scene, run, price, reference))
        if not reference.signals.steady:
            self.tables[TransientRow].add(_transient(self.scene, run, reference))

    def _say(self, text: str) -> None:
        """Kept beside the tables: a study that goes on says it again."""
        self.said = list(dict.fromkeys([*self.said, text]))
        self._write_facts()

    def _write_facts(self) -> None:
        facts = _facts(self.job.out)
        facts[self.scene.name] = {
            "identity": self.identity,
            "model": self.model.hash,
            "bodies": list(self.model.body_hashes),
            "kernel": self.kernel,
            "duration_s": self.scene.duration,
            "settle_s": self.scene.settle,
            "machine": platform.machine(),
            "said": self.said,
        }
        write_text(self.job.out / "study.json", json.dumps(facts, indent=1, sort_keys=True) + "\n")


FILES = {"study.csv": Row, "references.csv": ReferenceRow, "transient.csv": TransientRow}


def _is_at(row: Row, point: Point) -> bool:
    """Whether the row is this point; the step of rk45 is its own."""
    same = (row.level, row.slices) == (point.level, point.slices)
    adaptive = row.integrator == "rk45"
    if point.level == "paper":
        return same
    return same and row.integrator == point.integrator and (adaptive or bool(np.isclose(row.h_s, point.h, rtol=1e-4)))


def _facts(folder: Path) -> dict:
    try:
        return json.loads((folder / "study.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def _row(scene: SceneSpec, run: Run, price: Price, reference: Reference) -> Row:
    e, p = errors(run.signals, reference.signals), run.point
    head = (scene.name, p.level, run.integrator, run.h, run.n_dyn, p.slices)
    return Row(*head, e.te, e.te_mean, e.force, e.bearing, price.realtime_factor, price.cpu_ratio)


def _transient(scene: SceneSpec, run: Run, reference: Reference) -> TransientRow:
    wanted = reference.signals
    locked = lock_time(wanted)
    at = len(wanted.te) if np.isnan(locked) else round((locked - wanted.start) / wanted.interval)
    bands = [band_error(run.signals, wanted, part) for part in (slice(0, at), slice(at, None))]
    head = (scene.name, run.point.level, run.integrator, run.h, run.point.slices)
    return TransientRow(*head, lock_time(run.signals) - locked, *bands)
