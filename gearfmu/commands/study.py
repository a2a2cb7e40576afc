"""The verb study: what accuracy costs, as tables, CSV files and charts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from gearfmu.commands.shared import Progress, progress_bar

ERRORS = ("level", "integrator", "slices", "n_dyn", "h_us", "te_%", "mean_%", "force_%", "bearing_%", "time", "ratio")

SET_ERRORS = (
    *("planets", "rad/s", "level", "slices", "off", "n_dyn", "h_us", "against"),
    *("te_%", "mean_%", "force_%", "pin_%", "time", "ratio"),
)


@click.command()
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder of the CSV files and charts; an existing study is continued.",
)
@click.option(
    "--table",
    "tables",
    type=click.Choice(["errors", "cuts", "order", "limits", "bodies"]),
    multiple=True,
    default=("errors",),
    show_default=True,
    help="errors: study.csv and the chart; cuts: over the cut frequency; order: observed order of the integrators; "
    "limits: default, too large and refused steps; bodies: distance to refined bodies (reduces them: up to an hour). "
    "May repeat.",
)
@click.option("--quick", is_flag=True, help="Few points on a short window.")
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, help="Processes, for table errors.")
def study(scenes: tuple[str, ...], out: Path, tables: tuple[str, ...], quick: bool, jobs: int) -> None:
    """Error and price of the fidelity levels in SCENE, over the internal step and the slices; of a planetary set also
    over the number of planets and single effects (sets.csv)."""
    from gearfmu.commands.models import bodies_for_motion
    from gearfmu.spec.forms.members import carriers
    from gearfmu.spec.scene import load_scene
    from gearfmu.spec.stage import load_stage, require_pair

    specs = [load_scene(scene) for scene in scenes]
    stages = {spec.stage.name: load_stage(spec.stage.name) for spec in specs}
    sets = {name for name, stage in stages.items() if carriers(stage)}
    if sets and set(tables) != {"errors"}:
        raise click.UsageError(f"{', '.join(sorted(sets))} is a planetary set: it has the table errors alone")
    for name, stage in stages.items():
        if name not in sets:
            require_pair(stage)
        bodies_for_motion(name)
    for table in dict.fromkeys(tables):
        if table == "errors":
            for spec in specs:
                if spec.stage.name in sets:
                    _set_errors(spec, out, quick)
                else:
                    _errors(spec, out, quick, jobs)
        else:
            _other(table, specs, out, quick)


def _errors(spec: Any, out: Path, quick: bool, jobs: int) -> None:
    """Measure the scene's points and write table and chart."""
    from gearfmu.report.study import write_chart
    from gearfmu.study import Job
    from gearfmu.study import study as run_study

    with progress_bar(spec.name) as progress:
        found = run_study(Job(spec, out, quick, workers=jobs), progress)
    click.echo(error_table(found.rows))
    for note in found.notes:
        click.echo(f"- {note}")
    written = write_chart(found.rows, spec.stage.slices, out / spec.name, f"{spec.name}: {spec.description}")
    click.echo(", ".join(map(str, [out / "study.csv", *written])))


def _set_errors(spec: Any, out: Path, quick: bool) -> None:
    """Measure the price list of the scene's set and write table and chart."""
    from gearfmu.report.study import write_chart
    from gearfmu.spec.stage import load_stage
    from gearfmu.study.sets import ladder, set_study

    with progress_bar(spec.name) as progress:
        found = set_study(spec, out, quick, progress)
    click.echo(set_table(found.rows))
    for note in found.notes:
        click.echo(f"- {note}")
    levels = ladder(found.rows, load_stage(spec.stage.name).set.planets)
    written = write_chart(levels, spec.stage.slices, out / spec.name, f"{spec.name}: {spec.description}")
    click.echo(", ".join(map(str, [out / "sets.csv", *written])))


def _other(table: str, specs: Sequence[Any], out: Path, quick: bool) -> None:
    """Measure and write one of the other tables; rows of other scenes in the file stay."""
    from gearfmu.study.table import read_rows, tidy, write_rows

    path = out / f"{table}.csv"
    with progress_bar(table) as progress:
        rows = _rows(table, specs, quick, progress)
    names = {spec.name for spec in specs}
    kept = [row for row in read_rows(path, type(rows[0])) if getattr(row, "scene", None) not in {None, *names}]
    write_rows(path, type(rows[0]), [*kept, *rows])
    click.echo(tidy(rows, [name for name in vars(rows[0]) if name != "message"]))
    for message in dict.fromkeys(row.message for row in rows if getattr(row, "message", "")):
        click.echo(f"- {message}")
    written = [path]
    if table == "bodies":
        from gearfmu.report.study import write_bodies_chart

        written += write_bodies_chart([*kept, *rows], path)
    click.echo(", ".join(map(str, written)))


def _rows(table: str, specs: Sequence[Any], quick: bool, progress: Progress | None) -> list[Any]:
    from gearfmu.stage.build.levels import LEVELS
    from gearfmu.study import cuts, limits, order, refined
    from gearfmu.study.ladder import quick_scene

    windows = [quick_scene(spec) if quick or table in ("order", "limits") else spec for spec in specs]
    if table == "cuts":
        return [row for scene in windows for row in cuts.cut_rows(scene, quick, progress)[0]]
    if table == "limits":
        levels = ("fast",) if quick else LEVELS
        return [row for scene in windows for row in limits.limit_rows(scene, levels, progress=progress)]
    if table == "bodies":
        stages = {spec.stage.name for spec in specs}
        if len(stages) > 1:
            raise click.UsageError(f"--table bodies takes scenes of one stage, not of {' and '.join(sorted(stages))}")
        return refined.body_rows(windows, refined.cheap(windows[0]) if quick else None, progress)
    meshing = ("rigid",) if quick else order.LEVELS
    return order.constant_stiffness() + [
        row for scene in windows for row in order.gear_mesh(scene, meshing, progress=progress)
    ]


def error_table(rows: Any) -> str:
    """The rows as text: errors in percent of the alternating part, time per simulated second, ratio to level fast."""
    lines = [ERRORS] + [
        (
            *(row.level, row.integrator, str(row.slices), str(row.n_dyn), f"{1e6 * row.h_s:.3g}"),
            *(f"{100 * getattr(row, f'{name}_error'):.2g}" for name in ("te", "te_mean", "force", "bearing")),
            *(f"{row.realtime_factor:.3g}", f"{row.cpu_ratio:.3g}"),
        )
        for row in rows
    ]
    return _aligned(lines)


def set_table(rows: Any) -> str:
    """The rows of a planetary set as text, as `error_table`."""
    lines = [SET_ERRORS] + [
        (
            *(str(row.planets), f"{row.speed:g}", row.level, str(row.slices), row.off or "-", str(row.n_dyn)),
            *(f"{1e6 * row.h_s:.3g}", row.against),
            *(f"{100 * getattr(row, f'{name}_error'):.2g}" for name in ("te", "te_mean", "force", "pin")),
            *(f"{row.realtime_factor:.3g}", f"{row.cpu_ratio:.3g}"),
        )
        for row in rows
    ]
    return _aligned(lines)


def _aligned(lines: Sequence[Sequence[str]]) -> str:
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in lines)
