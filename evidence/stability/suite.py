"""The suite: scenes × levels × steps in parallel processes, kept in a table that a later call goes on with."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import multiprocessing
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from evidence.stability.bench import PLAIN, RELIEVED, Variant, geometry, model
from evidence.stability.case import COMPLETED, LEVELS, STEPS, Case, Finding
from evidence.stability.checks import finding
from evidence.stability.clutches import DUMP
from evidence.stability.record import Stopped
from evidence.stability.scenes import SCENES
from evidence.stability.sets import BACKFIRE, planetary
from evidence.stability.trains import CLOSING, train
from gearfmu.errors import GearfmuError, ModelError, SimulationError
from gearfmu.files import write_text
from gearfmu.kernel.build import fingerprint
from gearfmu.spec.scene import scene_path
from gearfmu.stage.build.blob import rounded_hash

COLUMNS = ("scene", "level", "h_s", "outcome", "energy_residual", "penetration_m", "realtime_factor")
GIVEN = "given"  # the step of a case whose h was named
Progress = Callable[..., None]


@dataclass(frozen=True)
class Task:
    """One row to run."""

    scene: str
    case: Case


@dataclass(frozen=True)
class Row:
    """A row of the table: task, finding, and the fingerprint of kernel, bodies and scenes it was made with."""

    scene: str
    case: Case
    finding: Finding
    key: str

    @property
    def failed(self) -> bool:
        """At the default step a scene must run through; at others a named outcome is an answer. What a scene complains
        of (not finite, energy, drift, statistics) is a failure at every step."""
        default = self.case.step == "default" and not self.case.h
        return bool(self.finding.complaints) or (default and self.finding.outcome != COMPLETED)


def tasks(scenes: Sequence[str], levels: Sequence[str], steps: Sequence[str | float]) -> list[Task]:
    """Every combination, slow scenes first. steps: names of STEPS, or seconds. GearfmuError for an unknown scene."""
    unknown = [name for name in scenes if name not in SCENES]
    if unknown:
        raise GearfmuError(f"no scene {', '.join(unknown)}; there are {', '.join(SCENES)}")
    return [
        Task(scene, Case(level, step) if isinstance(step, str) else Case(level, GIVEN, step))
        for scene in SCENES
        if scene in scenes
        for level in levels
        for step in steps
    ]


def usual(task: Task) -> bool:
    """Whether a combination is one of the table: level fast at every step, every level at the default step."""
    return task.case.level == "fast" or task.case.step == "default"


def run_suite(wanted: Sequence[Task], out: Path | None, jobs: int, progress: Progress | None = None) -> list[Row]:
    """Rows of `wanted` in its order. out: the table (CSV) with its facts beside it (JSON), brought up to date after
    every row; rows that are there already with the same fingerprint are not run again. jobs: processes."""
    kept = read(out) if out else []
    keys = {
        scene: key_of(scene) for scene in {task.scene for task in wanted} | {row.scene for row in kept} & set(SCENES)
    }
    done = {Task(row.scene, row.case): row for row in kept if row.key == keys.get(row.scene)}
    left = [task for task in wanted if task not in done]
    for count, (task, found) in enumerate(_judged(left, jobs), 1):
        done[task] = Row(task.scene, task.case, found, keys[task.scene])
        if out:
            write(out, list(done.values()))
        if progress:
            progress(count / len(left), f"{task.scene} {task.case.level}")
    if out:
        write(out, list(done.values()))
    return [done[task] for task in wanted]


def _judged(left: Sequence[Task], jobs: int) -> Iterator[tuple[Task, Finding]]:
    """Findings as they come; one job runs in this process."""
    if jobs == 1:
        yield from ((task, judge(task)) for task in left)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=jobs, mp_context=context) as pool:
        running = {pool.submit(judge, task): task for task in left}
        yield from ((running[future], future.result()) for future in as_completed(running))


def judge(task: Task) -> Finding:
    """The finding of one task; what the kernel refuses or gives up is a named outcome."""
    try:
        return SCENES[task.scene](task.case)
    except Stopped as stop:
        return finding(stop.record, geometry(Variant()))
    except SimulationError as error:
        return _nothing(f"{error.outcome}@{error.time:.6g}", task.case, str(error))
    except ModelError as error:
        return _nothing("refused", task.case, str(error))


def _nothing(outcome: str, case: Case, message: str) -> Finding:
    return Finding(outcome, case.h, 0.0, 0.0, 0.0, (message,) if case.step == "default" else ())


def key_of(scene: str) -> str:
    """SHA-256 (12 hex digits) over the kernel (`kernel.build.fingerprint`) and what the scene is made from: the file of
    the scene and those of this package that it imports, the assembled stages (bodies, damping, cuts), files of scenes.
    """
    used, left = set[str](), [SCENES[scene].__module__.rpartition(".")[2]]
    while left:
        name = left.pop()
        if name not in used:
            used.add(name)
            left += re.findall(r"^from evidence\.stability\.(\w+) import", _source(name), flags=re.MULTILINE)
    digest = hashlib.sha256(fingerprint().encode())
    for name in sorted(used):
        digest.update(_source(name).encode())
        digest.update(_made_from(name, (PLAIN, RELIEVED)).encode())
    return digest.hexdigest()[:12]


@cache
def _source(name: str) -> str:
    """A file of this package."""
    return (Path(__file__).parent / f"{name}.py").read_text(encoding="utf-8")


@cache
def _made_from(name: str, pairs: tuple[str, ...]) -> str:
    """Models and scene files that a file of this package uses; pairs: the stages of the bench."""
    if name == "clutches":
        return scene_path(DUMP).read_text(encoding="utf-8")
    if name == "bench":
        return "".join(rounded_hash(model(Variant(stage)).blob) for stage in pairs)
    if name == "trains":
        return rounded_hash(train().blob) + scene_path(CLOSING).read_text(encoding="utf-8")
    if name in ("sets", "set_bench"):
        return rounded_hash(planetary().blob) + scene_path(BACKFIRE).read_text(encoding="utf-8")
    return ""


def table(rows: Sequence[Row]) -> str:
    """The CSV text of rows."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        numbers = (row.finding.energy_residual, row.finding.penetration, row.finding.realtime_factor)
        shown = [f"{number:.3g}" for number in numbers]
        writer.writerow([row.scene, row.case.level, f"{row.finding.h:.6g}", row.finding.outcome, *shown])
    return text.getvalue()


def facts_path(out: Path) -> Path:
    """The file of facts beside a table."""
    return out.with_suffix(".json")


def write(out: Path, rows: Sequence[Row]) -> None:
    """Table and facts, in the order of the scenes."""
    placed = in_order(rows)
    entries = ",\n".join(json.dumps(asdict(row), ensure_ascii=False) for row in placed)
    write_text(facts_path(out), f"[\n{entries}\n]\n")
    write_text(out, table(placed))


def in_order(rows: Sequence[Row]) -> list[Row]:
    """Rows by scene, level and step."""
    scenes, steps = list(SCENES), [*STEPS, GIVEN]
    return sorted(
        rows,
        key=lambda r: (scenes.index(r.scene), LEVELS.index(r.case.level), steps.index(r.case.step), -r.finding.h),
    )


def read(out: Path) -> list[Row]:
    """Rows of a table written before; none when there is no such file. GearfmuError when its facts cannot be read."""
    path = facts_path(out)
    if not out.exists() or not path.exists():
        return []
    try:
        return [_row(entry) for entry in json.loads(path.read_text(encoding="utf-8"))]
    except (ValueError, KeyError, TypeError) as error:
        remedy = "remove the file or name another"
        raise GearfmuError(f"{path}: these are no facts of the suite ({error}); {remedy}") from None


def _row(entry: dict[str, Any]) -> Row:
    found = entry["finding"] | {"complaints": tuple(entry["finding"]["complaints"])}
    return Row(entry["scene"], Case(**entry["case"]), Finding(**found), entry["key"])
