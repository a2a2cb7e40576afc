"""Hard cases at every level: python -m evidence.stability [--level …] [--h …] [--scene …] [--out TABLE]"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import click

from evidence.stability.case import LEVELS, STEPS
from gearfmu.commands.shared import Quantity, progress_bar


class StepSize(Quantity):
    """ "default", "half" or "quarter" of the kernel's own step, or a step with a unit."""

    name = '"default|half|quarter|<number> s"'

    def __init__(self) -> None:
        super().__init__("internal_step")
        self.name = StepSize.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The word, or seconds."""
        return value if value in STEPS else super().convert(value, param, ctx)


@click.command()
@click.option(
    "--level",
    "levels",
    multiple=True,
    type=click.Choice(LEVELS),
    help="Level; may repeat. All when not given.",
)
@click.option(
    "--h",
    "steps",
    multiple=True,
    type=StepSize(),
    help="Internal step; may repeat. The three words when not given, at level fast alone.",
)
@click.option("--scene", "scenes", multiple=True, help="Scene; may repeat. All when not given.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Table (CSV), with the statistics beside it (JSON); a later call continues it.",
)
@click.option(
    "--jobs",
    type=click.IntRange(1),
    default=os.cpu_count() or 1,
    show_default="number of processors",
    help="Processes.",
)
@click.option("--list", "listed", is_flag=True, help="Describe the scenes and run nothing.")
def stability(
    levels: tuple[str, ...], steps: tuple[Any, ...], scenes: tuple[str, ...], out: Path | None, jobs: int, listed: bool
) -> int:
    """Run the hard cases. Exit code: the number of failures (at most 99), 0 for none."""
    from evidence.stability import suite
    from evidence.stability.scenes import SCENES, what

    if listed:
        click.echo("\n".join(f"{name}: {what(name)}" for name in scenes or SCENES))
        return 0
    wanted = suite.tasks(scenes or tuple(SCENES), levels or LEVELS, steps or tuple(STEPS))
    wanted = wanted if levels or steps else list(filter(suite.usual, wanted))
    with progress_bar("stability") as progress:
        rows = suite.run_suite(wanted, out, jobs, progress)
    click.echo(suite.table(rows), nl=False)
    failures = [row for row in rows if row.failed]
    for row in failures:
        said = "; ".join(row.finding.complaints) or "must run through at the default step"
        click.echo(f"{row.scene}, {row.case.level}, h = {row.finding.h:.4g} s, {row.finding.outcome}: {said}", err=True)
    click.echo(f"{len(rows)} cases, {len(failures)} failed", err=True)
    return min(len(failures), 99)


if __name__ == "__main__":
    sys.exit(stability(standalone_mode=False))
