"""Statics and runs of a stage: loaded transmission error, a run alone, a run in a scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from typing_extensions import Unpack

from gearfmu import cosim
from gearfmu.api.models import AnyStage, PathLike, Progress, load, load_scene, loaded_stage, model_of, reduce
from gearfmu.api.settings import Quantity, RunSettings, Settings, checked, in_si
from gearfmu.cosim.scene_run import Staged
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel, Steady, TeResult, Trace, loaded_te
from gearfmu.stage import simulate as simulate_model
from gearfmu.stage.run.simulate import Inputs
from gearfmu.stage.run.steady import LoadCase, parameters, steady_run
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.profile import Profile, read_profile


def te(
    stage: AnyStage,
    torques: Quantity | Sequence[Quantity],
    positions: int = 41,
    rigid_bearings: bool = False,
    mesh: str | None = None,
    pitches: int = 1,
    **settings: Unpack[Settings],
) -> TeResult:
    """Quasi-static loaded transmission error over one pitch or more, output held, torque on the input (the first port).

    stage : a name or path, a `load`ed stage, or an `assemble`d model.
    torques : one or several, "302 N*m" or in N·m; 0 is the unloaded stage.
    positions : over one pitch, end point left out.
    rigid_bearings : hold the axes, not of sets. mesh : the engagement, None: the first of a train, all of a set.
    pitches : teeth of gear A for deviations that differ from tooth to tooth.
    settings : of the kernel (docs/variables.md): slices=10, **{"effect.hertz": False}.

    Returns te (T, P) m and stage_stiffness (T, P) N/m with shafts and bearings; of a pair or a train mesh_stiffness
    without them and shares of the tooth pairs, of a planetary set load sharing. `failed` names torques without
    equilibrium; SimulationError where none has one.
    """
    wanted = [torques] if isinstance(torques, (str, float, int)) else list(torques)
    values, model = [checked("torque", torque, "torque") for torque in wanted], model_of(stage)
    known = parameters(model, settings)
    if rigid_bearings and (mesh or not model.stage.carriers):
        known["effect.bearings"] = 0.0
    return loaded_te(model, values, positions, mesh, pitches, None, **known)


def simulate(
    stage: AnyStage,
    torque: Quantity | None = None,
    speed: Quantity | tuple[Quantity, Quantity] | None = None,
    duration: Quantity | None = None,
    step: Quantity = 20e-6,
    settle: Quantity = 0.02,
    **settings: Unpack[RunSettings],
) -> Trace:
    """Run a stage alone: the outer ends of input and output turn at constant speed, from one to another or along a
    profile, wound up by the torque.

    stage : as in `te`.
    torque, speed : of the input: "302 N*m", "2000 rpm", or in N·m and rad/s; ("300 rpm", "6000 rpm") is a run-up.
    duration, step : simulated time, time between samples; "0.1 s", or in s. Duration None: of the profile, or 0.1 s.
    settle : from here on the report takes results and spectra.
    settings : of the kernel (docs/variables.md): level="fast", slices=10, **{"effect.hertz": False}.
    profile : among the keyword arguments, torque, speed or both over time in place of the arguments: a CSV file with a
        head like time_[s],torque_[N*m],speed_[rpm], or a `gearfmu.stagefile.tables.profile.Profile` of arrays in SI.

    The trace's meta says the outcome: a run that stops early keeps its samples. Raises ModelError for an unknown
    setting, SpecError for a port that this cannot turn, for a profile that cannot be used and for a torque or a speed
    that is missing or given twice.
    """
    given = settings.pop("profile", None)
    profile = given if given is None or isinstance(given, Profile) else read_profile(Path(given))
    start, *end = (
        None if value is None else in_si(value, "rad/s") for value in (speed if isinstance(speed, tuple) else (speed,))
    )
    driven = LoadCase(
        torque=None if torque is None else in_si(torque, "N*m"),
        speed=start,
        duration=None if duration is None else in_si(duration, "s"),
        step=in_si(step, "s"),
        settle=in_si(settle, "s"),
        end_speed=end[0] if end else None,
        profile=profile,
    )
    model = model_of(stage)
    return steady_run(model, driven, parameters(model, settings))


def drive(
    stage: AnyStage, inputs: Inputs, duration: Quantity, step: Quantity = 20e-6, **settings: Unpack[Settings]
) -> Trace:
    """Run a stage alone under inputs of one's own.

    inputs : time (s) → values by input name, SI ({"pinion.phi": …, "pinion.w": …}); asked at the start of each step.
        `wound_up` gives those that carry a torque at constant speed.
    stage, duration, step, settings : as in `simulate`.
    """
    model = model_of(stage)
    return simulate_model(
        model,
        inputs,
        checked("duration", duration, "duration"),
        checked("step", step, "step"),
        parameters(model, settings),
    )


def wound_up(stage: AnyStage, torque: Quantity, speed: Quantity) -> Steady:
    """Inputs over time with which input and output of a stage turn at constant speed, wound up by the torque: a
    function of time (s) that gives values by input name."""
    return Steady(model_of(stage), checked("speed", speed, "speed"), checked("torque", torque, "torque"))


def run(
    scene: PathLike | SceneSpec,
    out: PathLike | None = None,
    stage: PathLike | Stage | None = None,
    unit: PathLike = "fmu",
    verify: bool = False,
    progress: Progress | None = None,
) -> Trace:
    """Run a scene: its stage in its drivetrain, as the command line's `run` does.

    scene : a name or path, or a `load_scene`d one.
    out : folder of trace.h5, summary.json and the FMU; nothing is written when None.
    stage : another one than the scene's, by name or path or `load`ed (with changes).
    unit : "fmu", exported for this run; "kernel", the same kernel without it: the same bits; or the path of an FMU
        exported earlier: the stage that it was exported from is run, in place of the scene's, and refused where it
        does not fit the scene, or is not `stage`.
    verify : run again at half the communication step and estimate the coupling error.
    progress : called with the part that is done, 0 … 1.

    The trace's meta is the summary, with the outcome: "ok", or the reason of an early end. Raises SpecError, BodyError,
    FmuError and CouplingError where the run cannot begin.
    """
    spec, own = _scene_and_stage(scene, stage)
    folder = None if out is None else Path(out)
    if unit not in ("fmu", "kernel"):
        staged = Staged.of_fmu(spec, Path(unit), own)
        return cosim.run(staged, folder, verify=verify, progress=progress)
    return cosim.run(_staged(spec, own, (), progress), folder, str(unit), verify=verify, progress=progress)


def assemble_in_scene(
    scene: PathLike | SceneSpec,
    stage: PathLike | Stage | None = None,
    observe: Sequence[str] = (),
    progress: Progress | None = None,
) -> StageModel:
    """The model of a stage as a scene needs it: with the shafts and the chains of the scene's drivetrain for ports, and
    the motion of the gears that the scene records as outputs. Exported, it is the FMU to `run` in that scene.

    scene, stage, progress : as in `run`. observe : as in `assemble`, further gears.

    Raises SpecError, MeshError, BodyError, ModelError.
    """
    return _staged(*_scene_and_stage(scene, stage), observe, progress).model


def _scene_and_stage(scene: PathLike | SceneSpec, stage: PathLike | Stage | None) -> tuple[SceneSpec, Stage | None]:
    """The scene with the name of the chosen stage, and that stage; None for the scene's own."""
    spec = scene if isinstance(scene, SceneSpec) else load_scene(scene)
    if stage is None:
        return spec, None
    own = loaded_stage(stage)
    return spec.with_stage(name=str(own.source if own is stage else stage)), own


def _staged(scene: SceneSpec, own: Stage | None, observe: Sequence[str], progress: Progress | None) -> Staged:
    """The scene with the model of the stage, of its own when None; bodies that are missing are made."""
    own = load(scene.stage.name) if own is None else own
    own.require_motion()
    return Staged.of(scene, own, reduce(own, progress=progress), observe)
