"""A sweep from its plan to its table."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.body import body_hashes, load_bodies
from gearfmu.errors import BodyError, GearfmuError
from gearfmu.report.results import strict
from gearfmu.scenefile.scene import load_scene
from gearfmu.stagefile.forms.general import Stage
from gearfmu.sweeps.plan import RUN, Plan, split
from gearfmu.sweeps.points import LOST, OK, Outcome, Task, Variant, compute, prepare, program
from gearfmu.sweeps.runners import Lost, Runner
from gearfmu.sweeps.table import SweepTable, column, column_name

FORMAT = 1  # of the stored points: those of another format are computed anew
JOURNAL, TRACES, BODIES = "points.jsonl", "traces", "bodies"
Progress = Callable[..., None]


class Journal:
    """Results of points in the file points.jsonl of a folder, JSON lines in order of arrival, so that an interrupted
    sweep is continued. Lines that end in the middle, of a process that was killed, are left out."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._known = dict(_lines(path))
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_file() and not path.read_bytes().endswith(b"\n"):
            with path.open("a", encoding="utf-8") as file:
                file.write("\n")

    def get(self, identity: str) -> Outcome | None:
        """Outcome of a point, None where it was not computed."""
        return self._known.get(identity)

    def add(self, identity: str, outcome: Outcome) -> None:
        """One more point; its trace is not kept here."""
        known = self._known[identity] = replace(outcome, trace=None)
        plain = asdict(known)
        del plain["trace"]
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"identity": identity, **strict(plain)}, ensure_ascii=False) + "\n")


def _lines(path: Path) -> list[tuple[str, Outcome]]:
    found = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
        try:
            entry = json.loads(line)
            found.append((entry.pop("identity"), Outcome(**_with_nan(entry))))
        except (ValueError, KeyError, TypeError):
            continue
    return found


def _with_nan(entry: dict[str, Any]) -> dict[str, Any]:
    """The inverse for the numbers of a row and a curve."""
    row = {key: math.nan if value is None else value for key, value in entry["row"].items()}
    curve = {key: [math.nan if v is None else v for v in values] for key, values in entry["curve"].items()}
    return entry | {"row": row, "curve": curve}


def sweep(plan: Plan, out: Path, runner: Runner, traces: bool = False, progress: Progress | None = None) -> SweepTable:
    """Compute the points that are not yet in the folder `out`; returns all.

    Writes points.jsonl after every point; at the end sweep.parquet or sweep.csv, of transmission errors also curves.…;
    traces/*.h5 where `traces`; bodies/ where points need other bodies than those beside the stage file, which are made
    first. A point that fails is a row with its outcome. progress: called with the part done, 0 … 1, and a text.
    """
    told = progress or (lambda fraction, text="": None)
    journal = Journal(out / JOURNAL)
    points = _points(plan, out, traces)
    _prepare([p for p in points if isinstance(p, Task)], runner, told)
    outcomes: list[Outcome | None] = [_kept(p, journal, out, traces) for p in points]
    open_ = [(n, p) for n, p in enumerate(points) if outcomes[n] is None and isinstance(p, Task)]
    failed, done = sum(known is not None and known.name != OK for known in outcomes), len(points) - len(open_)
    for number, result in runner(compute, [point for _, point in open_]):
        (n, point), outcome = open_[number], Outcome(LOST, result.message) if isinstance(result, Lost) else result
        outcomes[n] = _keep(point, outcome, journal, out)
        failed, done = failed + (outcome.name != OK), done + 1
        told(done / len(points), f"{done} of {len(points)} points" + (f", {failed} failed" if failed else ""))
    return _table(plan, points, [o for o in outcomes if o is not None], out)


def _points(plan: Plan, out: Path, traces: bool) -> list[Task | Outcome]:
    """Every point, or why its stage or scene is refused."""
    variants: dict[Variant, tuple[Variant, str]] = {}
    fitting: dict[tuple[str, ...], bool] = {}
    found: list[Task | Outcome] = []
    for values in plan.points:
        try:
            stage, others = split(plan.what, values)
            asked = Variant(str(plan.stage_file(values)), tuple(sorted(stage.items(), key=lambda item: item[0])))
            if asked not in variants:
                variants[asked] = _located(asked, out, fitting)
            variant, fingerprint = variants[asked]
            of_rest = load_scene(plan.subject, others).hash if plan.what == RUN else others
            parts = [FORMAT, plan.what, of_rest, fingerprint, program()]
            found.append(Task(str(plan.subject), plan.what, values, variant, _digest(parts), traces, program()))
        except GearfmuError as error:
            found.append(Outcome(type(error).__name__, str(error)))
    return found


def _located(variant: Variant, out: Path, fitting: dict[tuple[str, ...], bool]) -> tuple[Variant, str]:
    """The variant with the folder of its bodies, and a fingerprint of its numbers: a stage that was changed so that
    the bodies beside its file do not fit has bodies of its own in `out`. fitting: results of this check, by the
    fingerprints of bodies."""
    spec = variant.spec()
    hashes = body_hashes(spec)
    fingerprint = _digest([spec.written.model_dump(mode="json", exclude={"source"}), list(hashes)])
    key = (variant.file, *hashes)
    if variant.changes and key not in fitting:
        fitting[key] = _fit(spec, None)
    if not variant.changes or fitting[key]:
        return variant, fingerprint
    return replace(variant, folder=str((out / BODIES / _digest(list(hashes))[:12]).resolve())), fingerprint


def _fit(spec: Stage, folder: str | None) -> bool:
    """Whether the stored bodies are those of the stage."""
    try:
        load_bodies(spec, folder)
    except BodyError:
        return False
    return True


def _prepare(points: list[Task], runner: Runner, told: Progress) -> None:
    """Make missing bodies, a variant a task; BodyError where that fails."""
    variants = {(v.folder or v.file): v for v in (point.variant for point in points)}
    missing = [variant for variant in variants.values() if not _fit(variant.spec(), variant.folder)]
    problems = []
    for number, (_, problem) in enumerate(runner(prepare, missing)):
        problems += [problem.message if isinstance(problem, Lost) else problem] if problem else []
        told(0.0, f"bodies of {number + 1} of {len(missing)} stages")
    if problems:
        raise BodyError("\n".join(problems))


def _kept(point: Task | Outcome, journal: Journal, out: Path, traces: bool) -> Outcome | None:
    """Known outcome of a point: refused ones, and those of the journal that need not be computed again."""
    if isinstance(point, Outcome):
        return point
    known = journal.get(point.identity)
    if known is None or known.name != OK or (traces and not (out / trace_name(point.identity)).is_file()):
        return None
    return known


def _keep(point: Task, outcome: Outcome, journal: Journal, out: Path) -> Outcome:
    """The outcome without its trace, which is now in a file, noted in the journal."""
    if outcome.trace is not None:
        outcome.trace.save(out / trace_name(point.identity))
    journal.add(point.identity, outcome)
    return replace(outcome, trace=None)


def trace_name(identity: str) -> str:
    """File of a point's trace in the folder of the sweep."""
    return f"{TRACES}/{identity[:16]}.h5"


def _table(plan: Plan, points: list[Task | Outcome], outcomes: list[Outcome], out: Path) -> SweepTable:
    keys = {key: column_name(key, plan.unit(key)) for key in plan.points[0]}
    columns = {"point": np.arange(len(outcomes))}
    columns |= {name: column([plan.number(key, p[key]) for p in plan.points]) for key, name in keys.items()}
    files = [trace_name(p.identity) if isinstance(p, Task) else "" for p in points]
    columns["outcome"] = column([outcome.name for outcome in outcomes])
    columns["message"] = column([outcome.message for outcome in outcomes])
    columns["trace"] = column([name if name and (out / name).is_file() else "" for name in files])
    for name in dict.fromkeys(name for outcome in outcomes for name in outcome.row):
        columns[name] = np.array([outcome.row.get(name, np.nan) for outcome in outcomes], dtype=float)
    table = SweepTable(columns, tuple(keys[axis] for axis in plan.axes), out, _curves(columns, keys, outcomes))
    table.write()
    return table


def _curves(
    columns: Mapping[str, np.ndarray], keys: Mapping[str, str], outcomes: list[Outcome]
) -> dict[str, np.ndarray]:
    """The curves of all points, one below the other, with the point and its values in every line."""
    lengths = [len(outcome.curve.get("position", ())) for outcome in outcomes]
    if not sum(lengths):
        return {}
    found = {name: np.repeat(columns[name], lengths) for name in ("point", *keys.values())}
    for name in dict.fromkeys(name for outcome in outcomes for name in outcome.curve):
        empty = [[np.nan] * length for length in lengths]
        parts = [outcome.curve.get(name, none) for outcome, none in zip(outcomes, empty, strict=True)]
        found[name] = np.concatenate([np.asarray(part, dtype=float) for part in parts])
    return found


def _digest(value: object) -> str:
    """SHA-256, hex, of a JSON value."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()
