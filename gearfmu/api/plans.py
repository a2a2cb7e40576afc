"""Effects, level, step and slices by an error budget."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from typing_extensions import Unpack

from gearfmu.api.models import PathLike, Progress, load_scene
from gearfmu.api.settings import PlanOptions
from gearfmu.cosim.scene_run import stage_model
from gearfmu.planning import cache
from gearfmu.planning.book import Plan
from gearfmu.planning.make import Job, make
from gearfmu.planning.request import request
from gearfmu.planning.run import run_planned
from gearfmu.spec.scene import SceneSpec
from gearfmu.stage import Trace
from gearfmu.sweeps.runners import in_this_process, on_cluster, on_this_machine


def plan(
    scene: PathLike | SceneSpec,
    outputs: Sequence[str],
    band: Sequence[str | float],
    budget: str | None = None,
    waveform: str | None = None,
    on: Any = None,
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
        planned before; tell, called with a text as the search goes on; name of the scene in plan.toml.

    `Plan.save(path)` writes plan.toml, `gf.run_plan` runs it. SpecError with all that is wrong with the request;
    PlanError where an output is silent in the band, the full model does not run, or a waveform does not repeat.
    """
    spec = scene if isinstance(scene, SceneSpec) else load_scene(scene)
    model = stage_model(spec)
    asked = request(spec, model, outputs, band, budget, waveform)
    tell = how.get("tell") or (lambda text: None)
    job = Job(spec, model, asked, _runner(on), force=tuple(how.get("may_drop", ())), tell=tell)
    name = str(how.get("name") or (spec.name if isinstance(scene, SceneSpec) else scene))
    known = None if how.get("fresh") else cache.find(job.identity)
    return known or cache.keep(make(job, name))


def run_plan(
    plan: Plan | PathLike,
    out: PathLike | None = None,
    progress: Progress | None = None,
    unit: PathLike = "kernel",
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


def _runner(on: Any) -> Any:
    if on is None or on == 1:
        return in_this_process
    return on_this_machine(on) if isinstance(on, int) else on_cluster(on)
