"""The verb study: what accuracy costs on a stage of yours, as a table, CSV files and a chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearfmu.commands.shared import FOLDER, progress_bar

if TYPE_CHECKING:
    from gearfmu.study.table import Row

ERRORS = ("level", "integrator", "slices", "n_dyn", "h_us", "te_%", "mean_%", "force_%", "bearing_%", "time", "ratio")


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
