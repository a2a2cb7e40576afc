"""One point of a sweep, computed by a worker anywhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import version
from typing import Any

from gearfmu.body import Body, load_bodies, reduce_apart, reduce_bodies
from gearfmu.errors import GearfmuError, SimulationError
from gearfmu.kernel.build import source_hash, sources
from gearfmu.scenefile.scene import load_scene
from gearfmu.stage import StageModel, Trace, assemble
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.sweeps.plan import RUN, TE, split

OK = "ok"
INTERNAL, LOST, OTHER = "internal error", "worker lost", "other version"


@dataclass(frozen=True)
class Variant:
    """A stage of a sweep. file: of the stage; changes: of its fields, as pairs; folder: of its bodies, None for that of
    the file."""

    file: str
    changes: tuple[tuple[str, Any], ...] = ()
    folder: str | None = None

    def spec(self) -> Stage:
        """Its numbers; SpecError."""
        return load_stage(self.file, dict(self.changes))


@dataclass(frozen=True)
class Task:
    """A point for a worker. subject, what, values: of the plan; variant: of its stage; identity: fingerprint of all
    that decides its numbers; traces: whether the trace comes back; program: what `program` says where the sweep
    began."""

    subject: str
    what: str
    values: Mapping[str, Any]
    variant: Variant
    identity: str
    traces: bool
    program: str


@dataclass(frozen=True)
class Outcome:
    """Outcome of a point. name: OK or the fault, described in `message`; row: numbers by column; curve: columns
    over the mesh cycle, of a transmission error."""

    name: str
    message: str = ""
    row: Mapping[str, float] = field(default_factory=dict)
    curve: Mapping[str, list[float]] = field(default_factory=dict)
    trace: Trace | None = None


@lru_cache(maxsize=1)
def program() -> str:
    """Version of the package and fingerprint of its kernel's sources, equal on all workers."""
    return f"{version('gearfmu')} {source_hash(sources())[:16]}"


def compute(task: Task) -> Outcome:
    """The point of a task; whatever goes wrong is its outcome."""
    if task.program != program():
        return Outcome(OTHER, f"the worker has gearfmu {program()}, the sweep {task.program}: install the same")
    try:
        return _computed(task)
    except SimulationError as error:
        return Outcome(error.outcome, str(error))
    except GearfmuError as error:
        return Outcome(type(error).__name__, str(error))
    except Exception as error:  # one point must not end a sweep
        return Outcome(INTERNAL, f"{type(error).__name__}: {error}")


def prepare(variant: Variant) -> str:
    """Make the missing bodies of a variant; returns "" or the fault."""
    try:
        spec = variant.spec()
        if variant.folder is None:
            reduce_bodies(spec)
        else:
            reduce_apart(spec, variant.folder)
    except GearfmuError as error:
        return str(error)
    except Exception as error:  # as in compute
        return f"{INTERNAL}, {type(error).__name__}: {error}"
    return ""


def _computed(task: Task) -> Outcome:
    from gearfmu.sweeps import rows

    values = split(task.what, task.values)[1]
    if task.what == TE:
        return Outcome(OK, "", *rows.te_row(_model(task.variant), values))
    if task.what == RUN:
        trace = rows.run_scene(load_scene(task.subject, values), *_stage(task.variant))
    else:
        trace = rows.run_alone(_model(task.variant), values)
    name, message = rows.ended(trace)
    row = rows.trace_row(trace) if name == OK else {}
    return Outcome(name, message, row, trace=trace if task.traces else None)


@lru_cache(maxsize=4)
def _stage(variant: Variant) -> tuple[Stage, list[Body]]:
    """Spec and bodies."""
    spec = variant.spec()
    return spec, load_bodies(spec, variant.folder)


@lru_cache(maxsize=4)
def _model(variant: Variant) -> StageModel:
    return assemble(*_stage(variant))
