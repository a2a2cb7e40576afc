"""From a scene to its trace: model, FMU, units, master, record, price; and the summary of the run.

The summary is plain JSON, SI. It is the trace's meta and summary.json."""

from __future__ import annotations

import datetime
import hashlib
import json
import platform
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from gearfmu import fmu
from gearfmu.body import Body, load_bodies
from gearfmu.cosim.accuracy import ChannelError, Window, coupling_errors
from gearfmu.cosim.coupled import OK, CoupledRun, Plan, Progress, Result, run_coupled
from gearfmu.cosim.drive import Drive, car_drive, rig_drive
from gearfmu.cosim.frames import FramePlan, frame_plan
from gearfmu.cosim.given_fmu import fitted, of_scene
from gearfmu.cosim.kernel_unit import KernelUnit, Source
from gearfmu.cosim.masters import Cut
from gearfmu.cosim.parts import parts_drive
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.shaft_loads import ShaftLoads, loads_drive
from gearfmu.cosim.units import Unit
from gearfmu.errors import CouplingError
from gearfmu.files import write_text
from gearfmu.fmu.opened import read_fmu
from gearfmu.kernel.binding import status_words
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.assembly.model import integrator_of
from gearfmu.stage.assembly.observed import gear_bodies
from gearfmu.stage.run.deformation import FILE_NAME
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.turning import meshings, require_driven, shafts_of
from gearfmu.stagefile.stage import load_stage

OF_FRAMES = ("scene", "description", "stage", "level", "fmu_path")  # of a run's meta, in that of its frames


@dataclass(frozen=True)
class Staged:
    """A scene with the model of its stage, whose ports are those that the scene's drivetrain needs. fmu : the FMU that
    the model was taken from, None for one that was assembled; remarks : differences of the FMU's ports."""

    scene: SceneSpec
    model: StageModel
    fmu: Path | None = None
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        scene: SceneSpec,
        stage: Stage | None = None,
        bodies: Sequence[Body] | None = None,
        observe: Sequence[str] = (),
    ) -> Staged:
        """stage : that of the file that the scene names when None; bodies : of `load_bodies(stage)` when None;
        observe : gears whose motion is an output, beside those that the scene records deformed.
        SpecError, BodyError and ModelError as `load_stage`, `load_bodies` and `assemble`."""
        stage = load_stage(scene.stage.name) if stage is None else stage
        recorded = scene.deformation.gears if scene.deformation is not None else ()
        bodies = load_bodies(stage) if bodies is None else bodies
        observed = list(dict.fromkeys([*recorded, *observe]))
        return cls(scene, assemble(in_drivetrain(scene, stage), bodies, observe=observed))

    @classmethod
    def of_fmu(cls, scene: SceneSpec, path: str | Path, stage: Stage | None = None) -> Staged:
        """The scene with the stage that an FMU was exported from: nothing is read of the scene's stage but its kind.

        stage : the one that the FMU must be of, when given; else it must be of the kind of the scene's. FmuError for a
        file that is no FMU of ours, SpecError with everything that does not fit the scene."""
        opened = read_fmu(path)
        scene = of_scene(scene, opened, stage)
        scene, remarks = fitted(scene, opened, drive_of)
        return cls(scene, opened.model, opened.path, remarks)


def run(
    scene: Staged | SceneSpec | str,
    out_dir: str | Path | None = None,
    unit: str = "fmu",
    verify: bool = False,
    progress: Progress | None = None,
) -> Trace:
    """Run a scene (or the scene file or shipped scene of that name; or one whose stage is assembled already).

    unit : "fmu" (of `Staged.of_fmu`, else exported into out_dir) or "kernel".
    verify : run again with half the communication step and estimate the coupling error. progress : called with
    the part done, 0 … 1. Writes trace.h5 and summary.json into out_dir, and deformation.h5 where the scene has
    [deformation]. The trace's meta is the summary: outcome "ok" or the reason of an early end, last good time,
    CPU time of the whole loop, energy residual of the cut, errors, hashes, versions. Raises CouplingError, SpecError,
    BodyError, FmuError when the run cannot begin.
    """
    if unit not in ("fmu", "kernel"):
        raise CouplingError(f"no unit {unit!r}; choose fmu or kernel")
    named = load_scene(scene) if isinstance(scene, str) else scene
    staged = named if isinstance(named, Staged) else Staged.of(named)
    scene = staged.scene
    with stage_source(staged, unit, out_dir) as source:
        first = _part(progress, 0.0, 1.0 / 3.0 if verify else 1.0)
        planned = None if scene.deformation is None else frame_plan(scene, scene.deformation)
        result = run_once(scene, source, first, frames=planned)
        errors = (
            verified(scene, source, result, _part(progress, 1.0 / 3.0, 1.0))
            if verify and result.outcome == OK
            else None
        )
        meta = summary(scene, source, result, errors) | origin(staged)
        meta["warnings"] = [*staged.remarks, *meta["warnings"]]
        if result.frames is not None and out_dir is not None:
            meta["deformation"] = FILE_NAME
            told = {name: meta[name] for name in OF_FRAMES if name in meta} | {"model": source.model.hash}
            hashes = gear_bodies(source.model.stage, source.model.body_hashes)
            result.frames.frames(hashes, told).save(Path(out_dir) / FILE_NAME)
    trace = Trace(result.trace.time, result.trace.channels, meta)
    if out_dir is not None:
        trace.save(Path(out_dir) / "trace.h5")
        write_text(Path(out_dir) / "summary.json", json.dumps(meta, indent=1, sort_keys=True, allow_nan=False) + "\n")
    return trace


def origin(staged: Staged) -> dict[str, Any]:
    """For a trace's meta: the FMU that the stage was taken from, where it was."""
    return {} if staged.fmu is None else {"fmu_path": str(staged.fmu.resolve())}


def stage_model(scene: SceneSpec) -> StageModel:
    """The scene's stage with the ports that its drivetrain needs, assembled from the bodies beside the stage file."""
    return Staged.of(scene).model


def drive_of(scene: SceneSpec, stage: Stage) -> Drive:
    """The drive of a scene on this stage: the only place that asks which table it has. SpecError where it leaves a
    spring port alone, or has something for a port that the stage does not have."""
    shafts = shafts_of(stage)
    if scene.shaft_loads is not None:
        return loads_drive(scene, scene.shaft_loads, stage, shafts.input)
    if scene.drivetrain is not None:
        return parts_drive(scene, scene.drivetrain, stage)
    require_driven(stage, (shafts.input, shafts.output), "a scene")
    if scene.passenger_car is not None:
        return car_drive(scene, scene.passenger_car, shafts)
    assert scene.test_rig is not None, "a scene has one of the four"
    return rig_drive(scene, scene.test_rig, shafts)


def in_drivetrain(scene: SceneSpec, stage: Stage) -> Stage:
    """The stage with the ports that the scene's drive needs. SpecError: `drive_of`, and for a stage that does not say
    all that it needs to move."""
    stage.require_motion()
    return with_ports(stage, drive_of(scene, stage).ports)


@contextmanager
def stage_source(staged: Staged, unit: str, out_dir: str | Path | None) -> Iterator[Source]:
    """Where the stage of a run comes from. unit: "kernel", or "fmu": the one that was given, else exported into out_dir
    (a temporary folder when None)."""
    model = staged.model
    if unit == "kernel" or staged.fmu is not None:
        yield Source(model, None if unit == "kernel" else staged.fmu)
        return
    with tempfile.TemporaryDirectory(prefix="gearfmu-") as folder:
        yield Source(model, fmu.export(model, Path(out_dir or folder) / f"{model.name}.fmu", platforms=("host",)))


def run_once(
    scene: SceneSpec,
    source: Source,
    progress: Progress | None = None,
    frames: FramePlan | None = None,
) -> Result:
    """One run of the scene with fresh units; frames: of moving gears, from a model that observes them, as `stage_model`
    makes it."""
    drive = drive_of(scene, source.model.stage)
    stage = source.unit(_parameters(scene, drive))
    try:
        plan = replace(_plan(scene, drive), progress=progress, frames=frames)
        return run_coupled(_cut(scene, drive, stage, source.model), plan)
    finally:
        stage.close()


def coupled_run(scene: SceneSpec, source: Source) -> CoupledRun:
    """A run of the scene that is stepped from outside; not begun."""
    drive = drive_of(scene, source.model.stage)
    stage = source.unit(_parameters(scene, drive))
    return CoupledRun(_cut(scene, drive, stage, source.model), _plan(scene, drive))


def _parameters(scene: SceneSpec, drive: Drive) -> dict[str, float | str]:
    """Of the stage: values that the scene chooses or that follow from it."""
    choice = scene.stage
    return {
        "level": choice.level,
        "integrator": choice.integrator,
        "contact": choice.contact,
        "slices": choice.slices,
        "h": choice.h,
        **{f"effect.{name}": 0.0 for name in choice.effects.off},
        **drive.start(),
    }


def _plan(scene: SceneSpec, drive: Drive) -> Plan:
    coupling = scene.coupling
    return Plan(coupling.master, coupling.step, scene.steps, scene.record, omit=drive.silent)


def _cut(scene: SceneSpec, drive: Drive, stage: Unit, model: StageModel) -> Cut:
    """stage: of the model."""
    if not callable(drive.partner):
        speeds = {name.removesuffix(".w_start"): speed for name, speed in drive.start().items()}
        return Cut(stage, ShaftLoads(drive.partner, speeds))

    def rest(torques: Mapping[str, float]) -> Mapping[str, float]:
        kernel = KernelUnit(model.blob, _parameters(scene, drive)).kernel
        kernel.prepare()
        return kernel.rest(torques)

    return Cut(stage, PyUnit(drive.partner(rest), scene.coupling.micro_step or None), drive.signals)


def verified(
    scene: SceneSpec, source: Source, result: Result, progress: Progress | None = None
) -> dict[str, ChannelError]:
    """Coupling error of every real-valued channel by Richardson, from a run with half the communication step.

    Both runs take the same internal step, so that its error does not count as the coupling's: where the step of
    `result` does not fit half the communication step, the scene is run twice with the next smaller one.
    """
    step, used = scene.coupling.step, result.facts["solver.h"]
    count = round(step / used)
    even, coarse = count + count % 2, result
    if count % 2:
        coarse = _verifying(scene, source, (step, step / even), _part(progress, 0.0, 1.0 / 3.0))
    fine = _verifying(scene, source, (0.5 * step, step / even), _part(progress, 1.0 / 3.0 if count % 2 else 0.0, 1.0))
    return coupling_errors(coarse.trace, fine.trace, coarse.order, Window(scene.settle, steady=scene.settle > 0.0))


def _verifying(scene: SceneSpec, source: Source, steps: tuple[float, float], progress: Progress | None) -> Result:
    """A run with another communication and internal step; CouplingError when it does not reach the end."""
    result = run_once(scene.with_coupling(step=steps[0]).with_stage(h=steps[1]), source, progress)
    if result.outcome != OK:
        raise CouplingError(
            f"no coupling error: the run with a communication step of {steps[0]:g} s stopped at "
            f"{result.trace.time[-1]:g} s: {result.message}; run without verification, or with other steps"
        )
    return result


def _part(progress: Progress | None, start: float, end: float) -> Progress | None:
    return None if progress is None else lambda fraction: progress(start + (end - start) * fraction)


# whose coupling error is the run's: the torque of the input shaft, in a chain or in the port; or its speed
TORQUES = ("{}.shaft.tau", "{}.tau", "{}.w")
COUNTS = {"n_dyn": "solver.n_dyn", "internal_steps": "solver.steps", "retried_steps": "solver.retried_steps"}


def summary(scene: SceneSpec, source: Source, result: Result, errors: dict[str, ChannelError] | None) -> dict[str, Any]:
    """Subject of a run, its outcome, price and origin.

    errors : coupling error by channel, None when the run was not verified.
    """
    return subject(scene, source) | _price(result) | _accuracy(source, result, errors) | _origin(scene, source)


def subject(scene: SceneSpec, source: Source) -> dict[str, Any]:
    """Of a `summary`: scene and stage, how both are computed, and how often the meshes meet."""
    clutch = any(port.chain is not None for port in source.model.stage.ports.values())
    return {
        "scene": scene.name,
        "description": scene.description,
        "stage": scene.stage.name,
        "level": scene.stage.level,
        "integrator": integrator_of(scene.stage.level, scene.stage.integrator, clutch),
        "contact": scene.stage.contact,
        "slices": scene.stage.slices,
        "effects_off": list(scene.stage.effects.off),
        "H": scene.coupling.step,
        "master": scene.coupling.master,
        "settle": scene.settle,
        "unit": "kernel" if source.fmu_path is None else "fmu",
        "chain_in_fmu": scene.chain_in_fmu,
        "meshes": {mesh: known.plain for mesh, known in meshings(source.model.stage).items()},
    }


def _price(result: Result) -> dict[str, Any]:
    end = float(result.trace.time[-1])
    counts = {key: int(result.facts[name]) for key, name in COUNTS.items() if name in result.facts}
    return counts | {
        "outcome": result.outcome,
        "message": result.message,
        "warnings": status_words(int(result.facts.get("solver.status", 0))),
        "simulated_s": end,
        "cpu_s": result.cpu_s,
        "realtime_factor": result.cpu_s / end if end else None,
        "stage_cpu_s": result.stage_cpu_s,
        "stage_realtime_factor": result.stage_cpu_s / end if end else None,
        "h": result.facts.get("solver.h"),
    }


def _accuracy(source: Source, result: Result, errors: dict[str, ChannelError] | None) -> dict[str, Any]:
    port, errors = source.model.shafts.input, errors or {}
    torque = next((name for name in (text.format(port) for text in TORQUES) if name in errors), None)
    return {
        "coupling_error": errors[torque].relative if torque else None,
        "coupling_error_rms_Nm": errors[torque].rms if torque and torque.endswith(".tau") else None,
        "coupling_error_of": torque,
        "coupling_errors": {name: error.relative for name, error in errors.items()},
        "energy_residual": result.energy_residual,
        "exchanged_work_J": result.throughput,
    }


def _origin(scene: SceneSpec, source: Source) -> dict[str, Any]:
    hashes = {f"body {name}": text for name, text in source.model.bodies.items()}
    hashes |= {"scene": scene.hash, "model": source.model.hash}
    if source.fmu_path is not None:
        hashes["fmu"] = hashlib.sha256(source.fmu_path.read_bytes()).hexdigest()
    versions = {name: version(name) for name in ("gearfmu", "numpy", "scipy", "fmpy")}
    finished = datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")
    return {"hashes": hashes, "versions": {"python": platform.python_version(), **versions}, "finished": finished}
