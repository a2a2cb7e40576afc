"""Verbs over many runs: sweep, many points into one table, its pictures and page; plan, settings by an error budget;
study, what accuracy costs on a stage of yours, as a table, CSV files and a chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.runs import changed_scene
from gearfmu.commands.shared import FILE, FOLDER, progress_bar, quantity, scene_names

if TYPE_CHECKING:
    from gearfmu.study.table import Row

ERRORS = ("level", "integrator", "slices", "n_dyn", "h_us", "te_%", "mean_%", "force_%", "bearing_%", "time", "ratio")


@click.command()
@click.argument("subject", metavar="SCENE")
@click.option(
    "--over",
    multiple=True,
    required=True,
    metavar="KEY=VALUES",
    help='Values of a key: "torque=100, 200, 300 N*m", "speed=1000:6000:11 rpm" (start:end:count), "stage.level=fast"; '
    "may repeat: all combinations, the last key fastest.",
)
@click.option("--out", type=FOLDER, help="Folder; out/sweep_<name> when not given.")
@click.option("--jobs", type=click.IntRange(1), help="Processes of this machine; one a core when not given.")
@click.option("--scheduler", metavar="ADDRESS", help='A dask cluster instead: "tcp://host:8786"; needs gearfmu[dist].')
@click.option("--traces", is_flag=True, help="Keep the trace of every run, traces/*.h5.")
def sweep(
    subject: str, over: tuple[str, ...], out: Path | None, jobs: int | None, scheduler: str | None, traces: bool
) -> int:
    """Run SCENE at many points: one table (Parquet with pyarrow, else CSV), its pictures and a page.

    SCENE may be a STAGE too: with a speed it is run alone as by 'simulate', without one its loaded transmission error
    is taken as by 'te' (Harris map). Keys: torque, speed; stage.<field of the stage file>; of a scene its fields; of a
    stage duration, step, settle, positions, pitches and parameters of docs/variables.md. An interrupted sweep goes on
    when it is called again. Exit code: the number of points that failed (at most 99)."""
    from gearfmu.api.plans import sweep as run_sweep
    from gearfmu.sweeps.charts import write_charts
    from gearfmu.sweeps.page import write_page
    from gearfmu.sweeps.plan import key_and_values

    folder = out or Path("out") / f"sweep_{Path(subject).stem}"
    with progress_bar(f"sweep {subject}") as progress:
        table = run_sweep(subject, dict(map(key_and_values, over)), folder, traces, scheduler or jobs, progress)
    for failure in table.failures:
        click.echo(f"gearfmu: {failure}", err=True)
    for path in [*table.files, *write_charts(table, folder), write_page(table, subject, folder)]:
        click.echo(path)
    failed = len(table.failures)
    click.echo(f"{len(table)} points" + (f", {failed} failed" if failed else ""))
    return min(failed, 99)


@click.command()
@click.argument("scene", shell_complete=scene_names)
@click.option(
    "--output", "outputs", multiple=True, required=True,
    help="Judged outputs: te, bearing.pinion.fx, bearing.pinion, mesh.force …; may repeat.",
)  # fmt: skip
@click.option("--band", nargs=2, required=True, metavar="LOW HIGH", help='Where it is judged, "200 Hz" "5 kHz".')
@click.option("--budget", help='Largest error of the levels in the band, "1 dB".')
@click.option("--waveform", help='Largest error of the waveforms in the band after a common delay, "5 %".')
@click.option("--stage", help="Another STAGE than the scene's.")
@quantity("--torque", 'Another torque on the input than the scene\'s, "302 N*m".')
@quantity("--speed", 'Another speed of the input at the start, "2000 rpm".')
@quantity("--step", "Another communication step than the scene's.")
@click.option(
    "--may-drop", "force", multiple=True, metavar="EFFECT",
    help="An effect that may be left out though it costs little: coast_flank; may repeat.",
)  # fmt: skip
@click.option("--out", type=FILE, default="plan.toml", show_default=True)
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, help="Trials side by side.")
@click.option("--scheduler", help="Address of a dask scheduler that runs the trials, tcp://host:8786.")
@click.option("--fresh", is_flag=True, help="Plan anew, though this was planned before.")
def plan(scene: str, outputs: tuple[str, ...], band: tuple[str, str], out: Path, **how: Any) -> int:
    """Plan SCENE for an error budget: which effects, level, step and slices it needs. Writes plan.toml for
    `gearfmu run --plan`; exit code 1 where no set but the full model keeps the budget."""
    from gearfmu.api.plans import plan as make
    from gearfmu.planning.table import plan_text

    spec = changed_scene(scene, **{key: how.pop(key) for key in ("step", "stage", "torque", "speed")})
    jobs, scheduler, force = how.pop("jobs"), how.pop("scheduler"), how.pop("force")
    with progress_bar(spec.name) as progress:
        how["tell"] = lambda text: progress(None, text)
        found = make(spec, outputs, band, on=scheduler or jobs, may_drop=force, name=scene, **how)
    click.echo(plan_text(found))
    click.echo(found.save(out))
    return 0 if all(segment.kept for segment in found.segments) else 1


@click.command()
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@click.option(
    "--out", type=FOLDER, required=True, help="Folder of the CSV files and charts; an existing study is continued."
)
@click.option("--quick", is_flag=True, help="Few points on a short window.")
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, help="Processes.")
def study(scenes: tuple[str, ...], out: Path, quick: bool, jobs: int) -> None:
    """Error and price of the fidelity levels in SCENE over the internal step and the slices."""
    from gearfmu.commands.models import bodies_for_motion
    from gearfmu.report.study import write_chart
    from gearfmu.scenefile.scene import load_scene
    from gearfmu.study.run import Job
    from gearfmu.study.run import study as run_study
    from gearfmu.sweeps.runners import runner_of

    specs = [load_scene(scene) for scene in scenes]
    for name in dict.fromkeys(spec.stage.name for spec in specs):
        bodies_for_motion(name)
    for spec in specs:
        with progress_bar(spec.name) as progress:
            found = run_study(Job(spec, out, quick, runner=runner_of(jobs)), progress)
        click.echo(error_table(found.rows))
        for note in found.notes:
            click.echo(f"- {note}")
        written = write_chart(found.rows, spec.stage.slices, out / spec.name, f"{spec.name}: {spec.description}")
        click.echo(", ".join(map(str, [out / "study.csv", *written])))


def error_table(rows: Sequence[Row]) -> str:
    """The rows as text: errors in percent of the alternating part, time per simulated second, ratio to level fast."""
    lines = [ERRORS] + [
        (
            *(row.level, row.integrator, str(row.slices), str(row.n_dyn), f"{1e6 * row.h_s:.3g}"),
            *(f"{100 * getattr(row, f'{name}_error'):.2g}" for name in ("te", "te_mean", "force", "bearing")),
            *(f"{row.realtime_factor:.3g}", f"{row.cpu_ratio:.3g}"),
        )
        for row in rows
    ]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in lines)
