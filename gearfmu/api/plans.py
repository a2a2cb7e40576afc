"""Effects, level, step and slices by an error budget; sweeps of many points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from typing_extensions import Unpack

from gearfmu.api.models import PathLike, Progress, load_scene
from gearfmu.api.settings import PlanOptions
from gearfmu.cosim.scene_run import stage_model
from gearfmu.planning.book import Plan, keep_plan, kept_plan
from gearfmu.planning.make import Job, make
from gearfmu.planning.request import request
from gearfmu.planning.run import run_planned
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import Trace
from gearfmu.sweeps.plan import plan as points_of
from gearfmu.sweeps.run import sweep as run_sweep
from gearfmu.sweeps.runners import on_cluster, on_this_machine, runner_of
from gearfmu.sweeps.table import SweepTable


def plan(
    scene: PathLike | SceneSpec,
    outputs: Sequence[str],
    band: Sequence[str | float],
    budget: str | None = None,
    waveform: str | None = None,
    on: object = None,
    **how: Unpack[PlanOptions],
) -> Plan:
    """Plan a scene for an error budget: which effects, level, step and slices it needs.

    scene : a name or path, or a `load_scene`d one.
    outputs : `te`, "bearing.pinion.fx", "bearing.pinion" for both directions, "mesh.force", …
    band : two frequencies, ("200 Hz", "5 kHz") or Hz.
    budget : largest error of the levels in the band, "1 dB"; None where only the waveform counts.
    waveform : largest error of the waveforms in the band after a common delay, "5 %".
    on : number of processes for the trials, this one when None; or a dask scheduler's address, Client or cluster.
    how : may_drop, names of effects that may be left out though they cost little; fresh=True plans anew what was
        planned before; tell, called with a text during the search; name of the scene in plan.toml.

    `Plan.save(path)` writes plan.toml, `gf.run_plan` runs it. SpecError with all that is wrong with the request;
    PlanError where an output is silent in the band, the full model does not run, or a waveform does not repeat.
    """
    spec = scene if isinstance(scene, SceneSpec) else load_scene(scene)
    model = stage_model(spec)
    asked = request(spec, model, outputs, band, budget, waveform)
    tell = how.get("tell") or (lambda text: None)
    job = Job(spec, model, asked, runner_of(on), force=tuple(how.get("may_drop", ())), tell=tell)
    name = str(how.get("name") or (spec.name if isinstance(scene, SceneSpec) else scene))
    known = None if how.get("fresh") else kept_plan(job.identity)
    return known or keep_plan(make(job, name))


def run_plan(
    plan: Plan | PathLike, out: PathLike | None = None, progress: Progress | None = None, unit: PathLike = "kernel"
) -> Trace:
    """Run the scene of a plan as it says, with tripwires: where the run leaves what was planned for it goes back to its
    last saved state and on with the effect that was missing; where a spot check is missed, back to where the check
    began and on with a richer set. meta["plan"] of the trace tells.

    plan : a Plan or the path of a plan.toml.
    out : folder of trace.h5; nothing is written when None.
    progress : called with the part that is done, 0 … 1.
    unit : "kernel", "fmu" (exported into `out`) or the path of an FMU exported earlier. Both give the same numbers.
    """
    known = plan if isinstance(plan, Plan) else Plan.load(Path(plan))
    return run_planned(
        known, None if out is None else Path(out), progress, unit=unit if isinstance(unit, str) else Path(unit)
    )


def sweep(
    subject: PathLike,
    over: Mapping[str, object] | Sequence[Mapping[str, object]],
    out: PathLike,
    traces: bool = False,
    on: object = None,
    progress: Progress | None = None,
) -> SweepTable:
    """Compute a scene or a stage at many points; one table.

    subject : a scene, which is run at every point, or a stage, by path or shipped name. A stage is run alone where the
        points have a speed (`simulate`), else its loaded transmission error is taken (`te`).
    over : values by key, a list each or one value: their grid. Or a list of points. Keys: `torque`, `speed`;
        `stage.<field of the stage file>`; of a scene its fields; of a stage alone duration, step, settle, positions
        and parameters of the kernel. Values as text with units ("302 N*m") or SI numbers.
    out : folder of the files. An interrupted sweep is continued: finished points are not computed again.
    traces : keep the trace of every run, as out/traces/*.h5 (`SweepTable.trace`).
    on : number of processes of this machine, all its cores when None; or the address of a dask scheduler
        ("tcp://host:8786"), a dask Client or cluster (gearfmu[dist]).
    progress : called with the part done, 0 … 1, and the present task.

    A point that fails, or whose workers die, is a row with its outcome by name (`SweepTable.failures`). Raises
    SweepError, SpecError where no point can be made, BodyError where bodies that are missing cannot be.
    """
    runner = on_this_machine(on) if on is None or isinstance(on, int) else on_cluster(on)
    return run_sweep(points_of(subject, over), Path(out), runner, traces, progress)
