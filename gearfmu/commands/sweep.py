"""The verb sweep: many points into one table, and its pictures and page."""

from __future__ import annotations

from pathlib import Path

import click

from gearfmu.commands.shared import progress_bar


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
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), help="Folder; out/sweep_<name> when not given."
)
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
