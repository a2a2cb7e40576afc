"""Verbs on a stage under load: te, the transmission error as a table and a picture; efficiency, losses of meshes to
friction; bearings, the rolling bearings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from gearfmu.commands.models import model_of
from gearfmu.commands.shared import FILE, PATH, Quantity, echo_pairs, level_option, progress_bar, quantity, stage_names
from gearfmu.errors import SimulationError

if TYPE_CHECKING:
    from gearfmu.stage import StageModel, TeResult
    from gearfmu.stage.run.bearings import BearingState


@click.command()
@click.argument("stage", shell_complete=stage_names)
@click.option(
    "--torque",
    "torques",
    multiple=True,
    required=True,
    type=Quantity("torque"),
    help='Torque on the input, "302 N*m"; "0 N*m" for the unloaded stage; may repeat.',
)
@click.option(
    "--positions",
    type=click.IntRange(2, 100_000),
    default=41,
    show_default=True,
    help="Positions over one pitch, end point left out.",
)
@click.option(
    "--pitches",
    type=click.IntRange(1, 10_000),
    default=1,
    show_default=True,
    help="Pitches that follow each other: as many as gear A has teeth for deviations that differ from tooth to tooth.",
)
@click.option("--rigid-bearings", is_flag=True, help="Hold the axes.")
@click.option(
    "--bore",
    type=click.Choice(["averaging", "rigid"]),
    help="Bores of all gears: averaging (they may deform about their mean motion) or rigid (on stiff shafts); as the "
    "stage file says when not given. Other bodies than the stage's are reduced once, into a folder beside it.",
)
@level_option
@click.option(
    "--twice-slices/--once",
    "doubled",
    default=None,
    help="With helical teeth: state what orders 1 to 8 change by with twice the slices, over one pitch. Of itself for "
    "pairs alone; a train or set takes three times as long with it.",
)
@click.option(
    "--out",
    type=PATH,
    default=Path("te.csv"),
    show_default=True,
    help="Table; the plot has the same name. Of a train one of each for every mesh, its name added.",
)
def te(stage: str, torques: tuple[float, ...], bore: str | None, doubled: bool | None, out: Path, **where: Any) -> None:
    """Loaded transmission error of STAGE over one pitch or more, output held: te_um = 1e6·(r_bA φ_A + r_bB φ_B) of
    every mesh. Mesh stiffness is that of the mesh alone, bores held on their axes; stage stiffness that with shafts and
    bearings.

    Of a planetary set te_um = 1e6·r_b,s (φ_s − (1 + z_r/z_s) φ_c) over one mesh period, and how its planets share the
    load at sun and ring: normal force over the mean of all planets, and the mesh load factor K_γ (ISO 6336-1).

    The torque acts on the input, the first port: a pair's pinion. The output is the second port. A torque without
    equilibrium is named and NaN in the table, and the exit code is 1."""
    from gearfmu.commands.models import level_of
    from gearfmu.report.te import write_flanks, write_plot
    from gearfmu.stage import loaded_te
    from gearfmu.stage.run.trace import write_columns

    model = model_of(stage, bores=bore)
    where |= level_of(model, where.pop("level"))
    carried = bool(model.stage.carriers)
    if where.pop("rigid_bearings"):
        if carried:
            raise click.BadParameter(
                "the load of a planetary set is shared by the compliance of its bearings", param_hint="--rigid-bearings"
            )
        where["effect.bearings"] = 0.0
    meshes, failed = [None] if carried else [mesh.name for mesh in model.stage.engagements], False
    for mesh in meshes:
        with progress_bar(f"te {model.name}") as progress:
            result = loaded_te(model, torques, mesh=mesh, progress=progress, **where)
        path = out.with_stem(f"{out.stem}_{mesh}") if len(meshes) > 1 else out
        write_columns(path, result.columns())
        picture = path.with_suffix(".png")
        write_plot(result, picture, None if carried else _unloaded(model, torques, mesh=mesh, **where))
        if len(meshes) > 1:
            click.echo(mesh)
        for torque, text in result.rows:
            click.echo(f"{torque:>12}: {text}" if torque else f"{'':14}{text}")
        if len(model.stage.engagements) == 1 if doubled is None else doubled:
            _tell_slices(model, torques, mesh, where)
        for text in above_sharing(result, model.stage.load_sharing):
            click.echo(f"warning: {text}", err=True)
        click.echo(f"{path}, {picture}")
        failed |= any(result.failed)
    flanks = out.with_name(f"{out.stem}_flanks.png")
    if write_flanks(model.stage, flanks):
        click.echo(str(flanks))
    warn_of_limits(model, torques)
    if failed:
        click.get_current_context().exit(1)


def _tell_slices(model: StageModel, torques: Sequence[float], mesh: str | None, where: Mapping[str, float]) -> None:
    """Changes of the harmonics of a helical stage with twice the slices, over one pitch."""
    from gearfmu.stage.run.refinement import left_of_slices

    parameters = {key: where[key] for key in where.keys() - {"positions", "pitches"}}
    left = left_of_slices(model, torques, None, mesh, **parameters)
    if left is not None:
        click.echo(f"{'':14}{left.text}")


def _unloaded(model: StageModel, torques: Sequence[float], **where: Any) -> TeResult | None:
    """The transmission error without load, for the picture; None where it is among those asked for, or not found."""
    from gearfmu.stage import loaded_te

    try:
        return None if 0.0 in torques else loaded_te(model, [0.0], **where)
    except SimulationError:
        return None


def warn_of_limits(model: StageModel, torques: Sequence[float]) -> None:
    """Say on standard error which torques (N·m) on the input are beyond the limits of the stage."""
    from gearfmu.stage.run.limits import beyond_limits

    for torque in torques:
        for text in beyond_limits(model, torque):
            click.echo(f"warning: {text}", err=True)


def above_sharing(result: TeResult, load_sharing: float) -> list[str]:
    """Where a planet of a set carries more than `load_sharing` of the stage file."""
    return [
        f"{torque:g} N·m: K_gamma {most:.3f} at the {gear}, above load_sharing = {load_sharing:g} of the stage file"
        for torque, factors in zip(result.torque, result.load_factor, strict=True)
        for gear, most in zip(result.centrals, factors, strict=True)
        if most > load_sharing
    ]


@click.command()
@click.argument("stage", shell_complete=stage_names)
@quantity("--torque", 'Torque on the input, "302 N*m".', required=True)
@quantity("--speed", 'Speed of the input, "2000 rpm".', required=True)
@click.option(
    "--pitches", type=click.IntRange(1, 10_000), default=8, show_default=True, help="Whole pitches of the slowest mesh."
)
@level_option
def efficiency(stage: str, torque: float, speed: float, pitches: int, level: str | None) -> None:
    """Efficiency of the meshes of STAGE at constant load: mean friction power of a run over whole pitches, and
    P mu H_V with the tooth loss factor of Ohlendorf (ISO/TR 14179-2) and the run's mean coefficient of friction. Power
    is that which rolls through a mesh: in a planetary set less than the input's.

    The coefficient follows the stage file ([contact] friction), else it is 0.05. Losses of bearings, seals and
    churned oil are in neither number."""
    from gearfmu.commands.models import level_of
    from gearfmu.stage.run.efficiency import mesh_efficiency

    model = model_of(stage)
    echo_pairs(mesh_efficiency(model, torque, speed, level_of(model, level), pitches=pitches).columns())


@click.command()
@click.argument("stage", shell_complete=stage_names)
@quantity("--torque", 'Torque on the input, "100 N*m"; that of the file if not given.')
@click.option("--csv", "table", type=FILE, help="Write the table as CSV file.")
def bearings(stage: str, torque: float | None, table: Path | None) -> None:
    """Rolling bearings of STAGE under a torque: loads of the shaft, displacement of the inner ring, rolling elements
    that carry, largest contact pressure, stiffness at that load, how often rolling elements pass and how far that moves
    the shaft. Numbers that no one has given are proposed from bore and outside diameter, and marked so."""
    from gearfmu.api.stages import bearings as found_bearings

    found = found_bearings(stage, torque)
    click.echo(
        f"{found.name} at {found.torque:g} N*m on the input; load and stiffness agree in {found.iterations} iterations"
    )
    for state in found.states:
        click.echo("\n" + "\n".join(_lines(state)))
    if table is not None:
        from gearfmu.files import write_text

        columns = found.columns()
        rows = [",".join(columns), *(",".join(map(_cell, row)) for row in zip(*columns.values(), strict=True))]
        write_text(table, "\n".join(rows) + "\n")
        click.echo(f"\nwrote {table}")


def _lines(state: BearingState) -> list[str]:
    """What is printed of one bearing."""
    given = [f"{name} {_number(name, value)}" for name, value in state.numbers.items() if name not in state.proposed]
    proposed = [f"{name} {_number(name, value)}" for name, value in state.numbers.items() if name in state.proposed]
    lines = [f"{state.support}: bearing {state.bearing}" + (f", {', '.join(given)}" if given else "")]
    if proposed:
        lines.append(f"  proposed      {', '.join(proposed)}")
    n, m = "N", "N*m"
    k = np.diag(state.stiffness)
    lines += [
        f"  load          {_row(state.load[:3], n)}    {_row(state.load[3:], m)}",
        f"  displacement  {_row(1e6 * state.displacement[:3], 'um')}    {_row(1e3 * state.displacement[3:], 'mrad')}",
        f"  carry         {state.loaded} of {state.elements} rolling elements, {state.largest_load:.0f} N and "
        f"{1e-6 * state.pressure:.0f} MPa at most",
        f"  stiffness     {_row(1e-6 * k[:3], 'N/um')}    {_row(1e-3 * k[3:], 'kN*m/rad')}",
        f"  pass          {state.orders[0]:.3f} and {state.orders[1]:.3f} times a revolution, outer and inner ring",
    ]
    if np.isfinite(state.swing).all():
        lines.append(f"  swing         {_row(1e6 * state.swing[:3], 'um')}    {_row(1e3 * state.swing[3:], 'mrad')}")
    return lines


def _row(values: np.ndarray, unit: str) -> str:
    return " ".join(f"{value:9.3g}" if abs(value) < 1000 else f"{value:9.0f}" for value in values) + f" {unit}"


def _number(name: str, value: float) -> str:
    """A number of rolling elements, lengths in mm."""
    return f"{1e3 * value:.2f} mm" if name.endswith(("diameter", "length")) else f"{value:g}"


def _cell(value: str | float) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
