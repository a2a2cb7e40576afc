"""One point of a sweep, computed by a worker anywhere, and its numbers: transmission errors over the mesh cycle, key
results and mesh orders of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import version
from typing import Any

import numpy as np

from gearfmu import cosim
from gearfmu.body import Body, load_bodies, reduce_apart, reduce_bodies
from gearfmu.cosim.scene_run import Staged
from gearfmu.errors import GearfmuError, SimulationError
from gearfmu.kernel.build import source_hash, sources
from gearfmu.quantities import to_si
from gearfmu.report.metrics import MetricsError, order_cuts
from gearfmu.report.results import REACHED_THE_END, key_results
from gearfmu.report.signals import bearings, mesh_angles, meshes, window_of_interest
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stage import StageModel, Trace, assemble
from gearfmu.stage.run.steady import LoadCase, parameters, steady_run
from gearfmu.stage.run.te import TeResult, loaded_te
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.sweeps.plan import OWN, RUN, SIMULATE, TE, split

ORDERS = 5  # of the mesh
POSITIONS = 41
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
    values = split(task.what, task.values)[1]
    if task.what == TE:
        return Outcome(OK, "", *te_row(_model(task.variant), values))
    if task.what == RUN:
        trace = run_scene(load_scene(task.subject, values), *_stage(task.variant))
    else:
        trace = run_alone(_model(task.variant), values)
    name, message = ended(trace)
    row = trace_row(trace) if name == OK else {}
    return Outcome(name, message, row, trace=trace if task.traces else None)


@lru_cache(maxsize=4)
def _stage(variant: Variant) -> tuple[Stage, list[Body]]:
    """Spec and bodies."""
    spec = variant.spec()
    return spec, load_bodies(spec, variant.folder)


@lru_cache(maxsize=4)
def _model(variant: Variant) -> StageModel:
    return assemble(*_stage(variant))


def te_row(model: StageModel, values: Mapping[str, object]) -> tuple[dict[str, float], dict[str, list[float]]]:
    """Row and curve of a transmission error. te_mean_um, te_pp_um (peak to peak), te_order_1_um … (rms), means of
    mesh stiffness and stage stiffness; of several meshes with the mesh's name before; of a set stage stiffness alone,
    and K_gamma at sun and ring."""
    own = _own(TE, values)
    settings: dict[str, Any] = _settings(TE, model, values)
    torque, positions = own["torque"], int(own.get("positions", POSITIONS))
    pitches = int(own.get("pitches", 1))
    stage = model.stage
    names = [None] if stage.carriers else [mesh.name for mesh in stage.engagements]
    row: dict[str, float] = {}
    curve: dict[str, list[float]] = {}
    for mesh in names:
        found = loaded_te(model, [torque], positions, mesh=mesh, pitches=pitches, **settings)
        before = f"{mesh}_" * (len(names) > 1)
        row |= _te_numbers(found, before)
        curve |= _curve(found, before)
        row |= {f"K_gamma_{gear}": float(k) for gear, k in zip(found.centrals, found.load_factor[0], strict=True)}
    return row, curve


def run_alone(model: StageModel, values: Mapping[str, object]) -> Trace:
    """`steady_run` at a point."""
    return steady_run(model, LoadCase(**dict[str, Any](_own(SIMULATE, values))), _settings(SIMULATE, model, values))


def run_scene(scene: SceneSpec, stage: Stage, bodies: list[Body]) -> Trace:
    """The scene on the stage of these bodies; by the kernel, which has the bits of its FMU."""
    return cosim.run(Staged.of(scene, stage, bodies), unit="kernel")


def ended(trace: Trace) -> tuple[str, str]:
    """("ok", "") of a run that reached its end, else its outcome and when."""
    name = str(trace.meta["outcome"])
    if name in REACHED_THE_END:
        return "ok", ""
    return name, str(trace.meta.get("message") or f"the run stopped after {trace.time[-1]:.6g} s")


def trace_row(trace: Trace) -> dict[str, float]:
    """`key_results`, and rms amplitudes of mesh orders 1 … 5 of mesh force and bearing forces, over the window of
    interest; NaN where an order lies above the sampling limit or the window is too short. price: processor seconds per
    simulated second."""
    window = window_of_interest(trace)
    part = trace.window(window.start, window.end)
    found, angles, several = dict(key_results(trace)), mesh_angles(part), len(meshes(part)) > 1
    for mesh, angle in angles.items():
        signals = {f"{mesh}_force" if several else "mesh_force": [f"{mesh}.force"]}
        for bearing in bearings(part):
            own = f"bearing_{bearing}_{mesh}" if several else f"bearing_{bearing}"
            signals[own] = [f"bearing.{bearing}.f{d}" for d in "xy"]
        for name, channels in signals.items():
            orders = _orders(part, [c for c in channels if c in part], angle)
            found |= {f"{name}_order_{k + 1}_N": value for k, value in enumerate(orders)}
    return found | {"price": float(trace.meta.get("realtime_factor") or np.nan)}


def _orders(part: Trace, channels: list[str], angle: np.ndarray) -> list[float]:
    """Root of the summed mean squares of the channels, by mesh order."""
    try:
        cuts = [order_cuts(part.time, part[name], angle, ORDERS).amplitude for name in channels]
    except MetricsError:
        cuts = []
    if not cuts:
        return [np.nan] * ORDERS
    return np.sqrt(sum(np.mean(cut**2, axis=1) for cut in cuts)).tolist()


def _own(what: str, values: Mapping[str, Any]) -> dict[str, float]:
    """The values that are no parameters of the kernel, SI."""
    units = OWN[what]
    own = {key: value for key, value in values.items() if key in units}
    return {k: to_si(v, units[k]) if isinstance(v, str) else float(v) for k, v in own.items()}


def _settings(what: str, model: StageModel, values: Mapping[str, object]) -> dict[str, float]:
    return parameters(model, {key: value for key, value in values.items() if key not in OWN[what]})


def _te_numbers(result: TeResult, before: str) -> dict[str, float]:
    te = 1e6 * result.te[0]
    found = {"te_mean_um": te.mean(), "te_pp_um": np.ptp(te)}
    for name, values in result.columns().items():
        if name.endswith("stiffness_N_per_um"):
            found[name.replace("_N_per", "_mean_N_per")] = values.mean()
    found |= {f"te_order_{k + 1}_um": 1e6 * h for k, h in enumerate(result.harmonics(ORDERS)[0])}
    return {before + name: float(value) for name, value in found.items()}


def _curve(result: TeResult, before: str) -> dict[str, list[float]]:
    columns = {name: values.tolist() for name, values in result.columns().items() if name != "torque_Nm"}
    return {name if name == "position" else before + name: values for name, values in columns.items()}
