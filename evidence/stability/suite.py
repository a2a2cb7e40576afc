"""The suite: scenes × levels × steps in parallel processes, into one table."""

from __future__ import annotations

import csv
import io
import json
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from evidence.stability.case import CASES, COMPLETED, LEVELS, STEPS, Case, Finding
from evidence.stability.record import Stopped
from evidence.stability.scenes import SCENES
from gearfmu.errors import GearfmuError, ModelError, SimulationError
from gearfmu.files import write_text

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
    """A row of the table."""

    scene: str
    case: Case
    finding: Finding

    @property
    def failed(self) -> bool:
        """At the default step a scene must run through; at others a named outcome is an answer. What a scene complains
        of (not finite, energy, drift, statistics) is a failure at every step."""
        default = self.case.step == "default" and not self.case.h
        return bool(self.finding.complaints) or (default and self.finding.outcome != COMPLETED)


def tasks(scenes: Sequence[str] = (), cases: Sequence[Case] = CASES) -> list[Task]:
    """Every combination, slow scenes first; all scenes when none is named. GearfmuError for an unknown scene."""
    unknown = [name for name in scenes if name not in SCENES]
    if unknown:
        raise GearfmuError(f"no scene {', '.join(unknown)}; there are {', '.join(SCENES)}")
    return [Task(scene, case) for scene in SCENES if scene in (scenes or SCENES) for case in cases]


def run_suite(wanted: Sequence[Task], out: Path | None, jobs: int, progress: Progress | None = None) -> list[Row]:
    """Rows of `wanted`. out: the table (CSV) with its facts beside it (JSON). jobs: processes."""
    done: list[Row] = []
    for task, found in _judged(wanted, jobs):
        done.append(Row(task.scene, task.case, found))
        if progress:
            progress(len(done) / len(wanted), f"{task.scene} {task.case.level}")
    rows = in_order(done)
    if out:
        write(out, rows)
    return rows


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
        return stop.bench.finding(stop.record)
    except SimulationError as error:
        return _nothing(f"{error.outcome}@{error.time:.6g}", task.case, str(error))
    except ModelError as error:
        return _nothing("refused", task.case, str(error))


def _nothing(outcome: str, case: Case, message: str) -> Finding:
    return Finding(outcome, case.h, 0.0, 0.0, 0.0, (message,) if case.step == "default" else ())


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


def write(out: Path, rows: Sequence[Row]) -> None:
    """Table and facts."""
    entries = ",\n".join(json.dumps(asdict(row), ensure_ascii=False) for row in rows)
    write_text(out.with_suffix(".json"), f"[\n{entries}\n]\n")
    write_text(out, table(rows))


def in_order(rows: Sequence[Row]) -> list[Row]:
    """Rows by scene, level and step."""
    scenes, steps = list(SCENES), [*STEPS, GIVEN]
    return sorted(
        rows,
        key=lambda r: (scenes.index(r.scene), LEVELS.index(r.case.level), steps.index(r.case.step), -r.finding.h),
    )


def read(out: Path) -> list[Row]:
    """Rows of a table written before. GearfmuError when its facts cannot be read."""
    path = out.with_suffix(".json")
    try:
        return [_row(entry) for entry in json.loads(path.read_text(encoding="utf-8"))]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise GearfmuError(f"{path}: these are no facts of the suite ({error}); make it again") from None


def _row(entry: dict[str, Any]) -> Row:
    found = entry["finding"] | {"complaints": tuple(entry["finding"]["complaints"])}
    return Row(entry["scene"], Case(**entry["case"]), Finding(**found))
