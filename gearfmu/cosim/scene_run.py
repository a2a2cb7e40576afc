"""From a scene to its trace: model, FMU, units, master, record, price."""
from __future__ import annotations

import datetime
import hashlib
import json
import platform
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from gearfmu import fmu
from gearfmu.body import load_stage_bodies
from gearfmu.cosim.accuracy import Window, coupling_errors
from gearfmu.cosim.coupled import OK, Plan, Progress, Result, run_coupled
from gearfmu.cosim.drivetrain import Shafts, build, stage_ports, stage_signals, stage_start
from gearfmu.cosim.fmu_unit import FmuUnit
from gearfmu.cosim.kernel_unit import KernelUnit
from gearfmu.cosim.masters import Cut
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.errors import CouplingError
from gearfmu.files import write_text
from gearfmu.spec.scene import SceneSpec, load_scene
from gearfmu.spec.stage import StageSpec, load_stage
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.trace import Trace

TORQUES = ("{}.shaft.tau", "{}.tau")  # whose coupling error is the run's: the input shaft's torque, inside a chain or in the port


@dataclass(frozen=True)
class Source:
    """Where the stage comes from: the kernel itself or an FMU."""

    model: StageModel
    fmu_path: Path | None

    def unit(self, parameters: dict[str, Any]) -> FmuUnit | KernelUnit:
        """A fresh instance."""
        return KernelUnit(self.model.blob, parameters) if self.fmu_path is None else FmuUnit(self.fmu_path, parameters)


def run(scene: SceneSpec | str, out_dir: str | Path | None = None, unit: str = "fmu", fmu_path: str | Path | None = None, verify: bool = False,
        progress: Progress | None = None) -> Trace:
    """Run a scene (or the scene file or shipped scene of that name).

    unit : "fmu" (exported into out_dir, or taken from fmu_path, which must have the scene's ports) or "kernel". verify : run again with half the
    communication step and estimate the coupling error. progress : told the done fraction 0 … 1.
    Writes trace.h5 and summary.json into out_dir. The trace's meta is the summary: outcome "ok" or the name of what stopped the run, last good time, CPU
    time of the whole loop, energy residual of the cut, errors, hashes, versions.
    Raises CouplingError, SpecError, BodyError, FmuError when the run cannot begin.
    """
    if unit not in ("fmu", "kernel"):
        raise CouplingError(f"no unit {unit!r}; choose fmu or kernel")
    scene = scene if isinstance(scene, SceneSpec) else load_scene(scene)
    model = stage_model(scene)
    with _source(model, unit, fmu_path, out_dir) as source:
        result = run_once(scene, source, _part(progress, 0.0, 1.0 / 3.0 if verify else 1.0))
        errors = verified(scene, source, result, _part(progress, 1.0 / 3.0, 1.0)) if verify and result.outcome == OK else None
        meta = summary(scene, source, result, errors)
    trace = Trace(result.trace.time, result.trace.channels, meta)
    if out_dir is not None:
        trace.save(Path(out_dir) / "trace.h5")
        write_text(Path(out_dir) / "summary.json", json.dumps(meta, indent=1, sort_keys=True, allow_nan=False) + "\n")
    return trace


def stage_model(scene: SceneSpec) -> StageModel:
    """The scene's stage with the ports that its drivetrain needs, assembled from the bodies beside the stage file."""
    spec = load_stage(scene.stage.name)
    bodies = load_stage_bodies(spec)
    return assemble(spec.model_copy(update={"ports": stage_ports(scene, shafts_of(spec))}), bodies)


def shafts_of(spec: StageSpec) -> Shafts:
    """Names and ratio of the stage's shafts."""
    pinion, wheel = spec.gears
    return Shafts(pinion.name, wheel.name, wheel.teeth / pinion.teeth)


@contextmanager
def _source(model: StageModel, unit: str, fmu_path: str | Path | None, out_dir: str | Path | None) -> Iterator[Source]:
    if unit == "kernel" or fmu_path is not None:
        yield Source(model, Path(fmu_path) if fmu_path is not None and unit == "fmu" else None)
        return
    with tempfile.TemporaryDirectory(prefix="gearfmu-") as folder:
        yield Source(model, fmu.export(model, Path(out_dir or folder) / f"{model.name}.fmu"))


def run_once(scene: SceneSpec, source: Source, progress: Progress | None = None) -> Result:
    """One run of the scene with fresh units."""
    shafts, choice = shafts_of(source.model.spec), scene.stage
    parameters = {"level": choice.level, "integrator": choice.integrator, "slices": choice.slices, "h": choice.h, **stage_start(scene, shafts)}
    stage = source.unit(parameters)
    try:
        drive = PyUnit(build(scene, shafts), scene.coupling.micro_step or None)
        cut = Cut(stage, drive, (shafts.pinion, shafts.wheel), stage_signals(scene, shafts))
        return run_coupled(cut, Plan(scene.coupling.master, scene.coupling.step, scene.steps, scene.record, progress))
    finally:
        stage.close()


def verified(scene: SceneSpec, source: Source, coarse: Result, progress: Progress | None = None) -> dict[str, float]:
    """Coupling error of every real-valued channel, relative to its AC part: Richardson's estimate from a run with half the communication step."""
    halved = scene.model_copy(update={"coupling": scene.coupling.model_copy(update={"step": 0.5 * scene.coupling.step})})
    fine = run_once(halved, source, progress)
    if fine.outcome != OK:
        raise CouplingError(f"the run with half the communication step stopped at {fine.trace.time[-1]:g} s: {fine.message}")
    return coupling_errors(coarse.trace, fine.trace, coarse.order, Window(scene.settle, steady=scene.settle > 0.0))


def summary(scene: SceneSpec, source: Source, result: Result, errors: dict[str, float] | None) -> dict[str, Any]:
    """What the run was, how it ended and what it cost: plain JSON, SI."""
    spec, facts, end = source.model.spec, result.facts, float(result.trace.time[-1])
    whole = {key: int(facts[name]) for key, name in (("n_dyn", "solver.n_dyn"), ("internal_steps", "solver.steps"), ("trouble", "solver.trouble")) if name in facts}
    found = {
        "scene": scene.name, "description": scene.description, "stage": scene.stage.name, "outcome": result.outcome, "message": result.message,
        "simulated_s": end, "cpu_s": result.cpu_s, "realtime_factor": result.cpu_s / end if end else None, "energy_residual": result.energy_residual,
        "exchanged_work_J": result.throughput, "level": scene.stage.level, "integrator": scene.stage.integrator, "slices": scene.stage.slices,
        "h": facts.get("solver.h"), "H": scene.coupling.step, "master": scene.coupling.master, "settle": scene.settle,
        "unit": "kernel" if source.fmu_path is None else "fmu", "chain_in_fmu": bool(scene.passenger_car and scene.passenger_car.chain_in_fmu),
        "teeth": {gear.name: gear.teeth for gear in spec.gears}, "coupling_error": None, "coupling_errors": errors,
        "hashes": _hashes(scene, source), "versions": _versions(), "started": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
    }  # fmt: skip
    if errors is not None:
        found["coupling_error"] = next((errors[name] for name in (text.format(spec.gears[0].name) for text in TORQUES) if name in errors), None)
    return found | whole


def _hashes(scene: SceneSpec, source: Source) -> dict[str, str]:
    names = [gear.name for gear in source.model.spec.gears]
    bodies = {f"body {name}": text for name, text in zip(names, source.model.body_hashes, strict=True)}
    own = {"scene": scene.hash, "model": source.model.hash, **bodies}
    return own if source.fmu_path is None else own | {"fmu": hashlib.sha256(source.fmu_path.read_bytes()).hexdigest()}


def _versions() -> dict[str, str]:
    return {"python": platform.python_version(), **{name: version(name) for name in ("gearfmu", "numpy", "scipy", "fmpy")}}


def _part(progress: Progress | None, start: float, end: float) -> Progress | None:
    return None if progress is None else lambda fraction: progress(start + (end - start) * fraction)
