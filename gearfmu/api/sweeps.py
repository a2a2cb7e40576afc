"""Many points at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gearfmu.api.models import PathLike, Progress
from gearfmu.sweeps.plan import plan
from gearfmu.sweeps.run import sweep as run_sweep
from gearfmu.sweeps.runners import on_cluster, on_this_machine
from gearfmu.sweeps.table import SweepTable


def sweep(
    subject: PathLike,
    over: Mapping[str, Any] | Sequence[Mapping[str, Any]],
    out: PathLike,
    traces: bool = False,
    on: Any = None,
    progress: Progress | None = None,
) -> SweepTable:
    """Compute a scene or a stage at many points; one table.

    subject : a scene, which is run at every point, or a stage, by path or shipped name. A stage is run alone where the
        points have a speed (`simulate`), else its loaded transmission error is taken (`te`).
    over : values by key, a list each or one value: their grid. Or a list of points. Keys: `torque`, `speed`;
        `stage.<field of the stage file>`; of a scene its fields; of a stage alone duration, step, settle, positions
        and parameters of the kernel. Values as text with units ("302 N*m") or SI numbers.
    out : folder of the files. A sweep that was interrupted goes on: points that are there are not computed again.
    traces : keep the trace of every run, as out/traces/*.h5 (`SweepTable.trace`).
    on : number of processes of this machine, all its cores when None; or the address of a dask scheduler
        ("tcp://host:8786"), a dask Client or cluster (gearfmu[dist]).
    progress : called with the part that is done, 0 … 1, and what is done.

    A point that fails, or whose workers die, is a row with its outcome by name (`SweepTable.failures`). Raises
    SweepError, SpecError where no point can be made, BodyError where bodies that are missing cannot be.
    """
    runner = on_this_machine(on) if on is None or isinstance(on, int) else on_cluster(on)
    return run_sweep(plan(subject, over), Path(out), runner, traces, progress)
