"""Verbs from numbers to reduced bodies: new, mesh, reduce."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from gearfmu.commands.models import by_text
from gearfmu.commands.shared import echo_pairs, progress_bar


@click.command()
@click.argument("name")
@click.option("--like", default="fzg_c", show_default=True, metavar="STAGE", help="Shipped stage to start from.")
def new(name: str, like: str) -> None:
    """Write NAME/stage.toml, every field commented, as a copy of a shipped stage. Never overwrites."""
    from gearfmu.spec.new import new_stage

    path = new_stage(name, like)
    click.echo(f"{path}\nNext: edit it, then 'gearfmu reduce {path}' and 'gearfmu export {path}'.")


@click.command()
@click.argument("stage")
@click.option("--gear", "only", metavar="NAME", help="Only this gear (pinion or wheel).")
@click.option(
    "--scale", type=click.FloatRange(0.2, 4), default=1.0, show_default=True, help="Factor on all element counts."
)
@click.option("--full", is_flag=True, help="All teeth instead of one sector.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("."), help="Folder of the .vtu files.")
def mesh(stage: str, only: str | None, scale: float, full: bool, out: Path) -> None:
    """Mesh the gears of STAGE, print size and quality, write <gear>.vtu."""
    from gearfmu.femesh import gear_sector, mesh_report, write_vtu
    from gearfmu.geometry import GearGeometry
    from gearfmu.spec.stage import load_stage

    spec = load_stage(stage)
    for gear in _chosen(spec.gears, only):
        counts = gear.body.mesh.model_copy(update={"scale": gear.body.mesh.scale * scale})
        geometry = GearGeometry.of(gear, spec.pair)
        sector = gear_sector(geometry, gear.face_width, counts)
        path = out / f"{gear.name}.vtu"
        write_vtu(sector.full() if full else sector, path)
        click.echo(gear.name)
        echo_pairs({**mesh_report(sector, geometry.r_b, gear.body.strip_half_width), "written": str(path)}, "  ")


@click.command()
@click.argument("stage")
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder of the .h5 files; beside the stage file when not given."
)
@click.option("--force", is_flag=True, help="Reduce again even where a body is up to date.")
def reduce(stage: str, out: Path | None, force: bool) -> None:
    """Reduce the gears of STAGE to <gear>.h5; a body whose input hash matches is left as it is."""
    from gearfmu.body import reduce_stage
    from gearfmu.spec.stage import load_stage

    spec = load_stage(stage)
    with progress_bar("reducing") as progress:
        bodies = reduce_stage(spec, out_dir=out, force=force, progress=by_text(progress))
    for body in bodies:
        click.echo(
            f"{body.name}: {body.modes} modes to {body.frequency[-1] / 1e3:.0f} kHz, mass {body.mass:.4g} kg, "
            f"frequency response within {body.frf.max_error:.1e} to {body.frf.band[1] / 1e3:.0f} kHz, input "
            f"{body.input_hash[:12]}\n  {_cost(body)}"
        )


def _cost(body: Any) -> str:
    """Size of the finite elements behind a body, and the processor time and memory its reduction took."""
    mesh, made = body.mesh, body.provenance
    memory = made["peak_memory_GB"]
    return (
        f"{mesh['dof_body']} DOF, {body.teeth} sectors of {mesh['dof_sector']}; reduced in {made['cpu_s']:g} s CPU time"
        + ("" if memory is None else f" and {memory:g} GB")
    )


def _chosen(gears: tuple, only: str | None) -> list:
    chosen = [gear for gear in gears if only in (None, gear.name)]
    if not chosen:
        raise click.BadParameter(
            f"no gear '{only}'; the stage has {', '.join(gear.name for gear in gears)}", param_hint="--gear"
        )
    return chosen
