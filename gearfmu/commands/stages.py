"""Verbs from a stage file to reduced bodies: mesh, reduce; import, for finite elements made elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.models import by_text, reducing
from gearfmu.commands.shared import PATH, echo_pairs, quantity, stage_names

if TYPE_CHECKING:
    from gearfmu.body import Body
    from gearfmu.stagefile.forms.general import Stage


@click.command()
@click.argument("stage", shell_complete=stage_names)
@click.option("--gear", "only", metavar="NAME", help="Only this body: a gear's name, or the carrier.")
@click.option(
    "--scale", type=click.FloatRange(0.2, 4), default=1.0, show_default=True, help="Factor on all element counts."
)
@click.option("--full", is_flag=True, help="All teeth instead of one sector.")
@click.option("--deck", is_flag=True, help="Also <body>.inp for CalculiX, with a step that stores K and M.")
@click.option("--out", type=PATH, default=Path("."), help="Folder of the files.")
def mesh(stage: str, only: str | None, scale: float, full: bool, deck: bool, out: Path) -> None:
    """Mesh the bodies of STAGE, print size and quality, write <body>.vtu."""
    from gearfmu.body.sector import body_sector
    from gearfmu.commands.files import in_units
    from gearfmu.femesh.deck import write_deck
    from gearfmu.femesh.quality import mesh_report, write_vtu
    from gearfmu.stagefile.forms.general import GearBody, RingBody
    from gearfmu.stagefile.forms.shapes import gear_shape
    from gearfmu.stagefile.stage import load_stage

    spec = load_stage(stage)
    if only is not None and only not in spec.files:
        raise click.BadParameter(f"no gear '{only}'; the stage has {', '.join(spec.files)}", param_hint="--gear")
    for name in spec.files if only is None else [only]:
        sector, table = body_sector(spec, name, scale), spec.by_file[name]
        flank: tuple[float, ...] = ()
        if isinstance(table, GearBody | RingBody) and table.imported is None:
            flank = gear_shape(table).r_b, table.body.strip_half_width
        path = out / f"{name}.vtu"
        written = sector.full() if full else sector
        write_vtu(written, path)
        if deck:
            material = None if table.material is None else table.material.model_dump()
            write_deck(written, path.with_suffix(".inp"), material)
        click.echo(name)
        echo_pairs({**in_units(mesh_report(sector, *flank)), "written": str(path)}, "  ")


@click.command()
@click.argument("stage", shell_complete=stage_names)
@click.option("--out", type=PATH, help="Folder of the .h5 files; beside the stage file when not given.")
@click.option("--force", is_flag=True, help="Reduce again even where a body is up to date.")
@click.option(
    "--coarse",
    is_flag=True,
    help="Make the coarse sister of STAGE, coarse/stage.toml beside its file (or in --out): half the element counts, "
    "bodies in seconds.",
)
def reduce(stage: str, out: Path | None, force: bool, coarse: bool) -> None:
    """Reduce the bodies of STAGE to <body>.h5; a body whose input hash matches is left as it is."""
    import time

    from gearfmu.body import current_bodies, reduce_bodies
    from gearfmu.stagefile.proposals.coarse import STATED_ERROR, coarse_stage
    from gearfmu.stagefile.stage import load_stage

    if coarse:
        stage, out = str(coarse_stage(stage, out)), None
        click.echo(f"{stage}\n{STATED_ERROR}")
    spec, started = load_stage(stage), time.perf_counter()
    kept = set() if force else current_bodies(spec, out)
    with reducing() as progress:
        bodies = reduce_bodies(spec, out, force, by_text(progress))
    for body in bodies:
        click.echo(_described(body, body.name in kept))
    made = len(bodies) - len(kept)
    click.echo(f"{made} bodies reduced, {len(kept)} read, in {time.perf_counter() - started:.1f} s")


def _described(body: Body, kept: bool) -> str:
    """A body in two lines: what it is and how good, and what it cost; kept: it was up to date."""
    kind = f"{body.modes} modes" if body.flank is not None else f"{body.modes} oscillators ({body.how.method})"
    error = body.error
    assert error is not None, "a stored body says how good it is"
    return (
        f"{body.name}: {kind} to {body.frequency[-1] / 1e3:.0f} kHz, mass {body.total_mass:.4g} kg, frequency response "
        f"within {error.max_error:.1e} to {error.band[1] / 1e3:.0f} kHz, input {body.how.hash[:12]}\n"
        f"  {_cost(body, kept)}"
    )


def _cost(body: Body, kept: bool) -> str:
    """Size of the finite elements behind a body, and the processor time and memory its reduction took."""
    mesh, made = body.how.mesh, body.how.provenance
    memory, sectors = made["peak_memory_GB"], mesh["teeth"]
    return (
        f"{mesh['dof_body']} DOF, {sectors} sectors of {mesh['dof_sector']}; "
        + ("up to date, only read; it was reduced in " if kept else "reduced in ")
        + f"{made['cpu_s']:g} s CPU time"
        + ("" if memory is None else f" and {memory:g} GB")
    )


@click.command(name="import")
@click.argument("file", type=PATH)
@click.argument("stage", required=False, shell_complete=stage_names)
@click.argument("gear", required=False)
@quantity("--length", 'One length unit of the file: "1 mm".', "length_unit", required=True)
@click.option(
    "--axis", type=click.Choice(["x", "y", "z"]), default="z", show_default=True, help="Axis of the gear in the file."
)
@click.option(
    "--bore",
    default="",
    help="Node set of the bore (of a ring: of its rim); without it the nodes on the stage's diameter.",
)
@click.option("--bolt", "bolts", multiple=True, help="Of a carrier: node set of a bolt's seat, in order from +x.")
@click.option("--ignore", multiple=True, help="Node set of reference nodes that belong to no element.")
def import_(file: Path, stage: str | None, gear: str | None, **options: Any) -> None:
    """Check the finite elements in FILE: elements, quality, node sets. With STAGE and GEAR also fit the involutes and
    print the section for the stage file. Writes nothing."""
    if stage is None:
        echo_pairs(mesh_facts(file, options["length"], options["ignore"], options["axis"]))
        return
    from gearfmu.stagefile.stage import load_stage

    spec = load_stage(stage)
    names = spec.files
    if gear is None or gear not in names:
        raise click.BadParameter(f"name a body of the stage: {', '.join(names)}", param_hint="GEAR")
    echo_pairs(body_facts(spec, gear, str(file), options))
    click.echo("\n" + section(file, spec.table_of(gear), options))


def body_facts(spec: Stage, name: str, file: str, options: dict[str, Any]) -> dict[str, Any]:
    """What the finite elements in `file` are as the body `name` of a stage; MeshError when they are not that body."""
    from gearfmu.reduction.imported.carrier import imported_carrier
    from gearfmu.reduction.imported.gear import checked_gear
    from gearfmu.stagefile.forms.general import GearBody, RingBody
    from gearfmu.stagefile.forms.planetary import CarrierBody
    from gearfmu.stagefile.tables.imported import CarrierImportSpec, ImportSpec, RingImportSpec

    table = spec.by_file[name]
    if isinstance(table, CarrierBody):
        if not options["bore"] or len(options["bolts"]) != (planets := len(table.bolts)):
            raise click.UsageError(f"a carrier needs --bore and {planets} times --bolt, each a node set")
        return imported_carrier(table.model_copy(update={"imported": CarrierImportSpec(file=file, **options)}))[1]
    if not isinstance(table, GearBody | RingBody):
        raise click.UsageError(f"{name} is a housing: write its node sets into the stage file, then gearfmu reduce")
    ring = isinstance(table, RingBody)
    chosen = {"rim" if ring and key == "bore" else key: value for key, value in options.items() if key != "bolts"}
    source = (RingImportSpec if ring else ImportSpec)(file=file, **chosen)
    return checked_gear(table.model_copy(update={"imported": source})).facts


def mesh_facts(file: Path, length: float, ignore: tuple[str, ...], axis: str) -> dict[str, Any]:
    """What a mesh file holds, SI; MeshError lists what is wrong with it."""
    import numpy as np

    from gearfmu.errors import MeshError
    from gearfmu.fem.mesh_checks import mesh_problems
    from gearfmu.femesh.imported import read_mesh
    from gearfmu.reduction.imported import files

    mesh = read_mesh(file, length, ignore)
    if problems := mesh_problems(mesh.nodes, mesh.elements, mesh.labels):
        raise MeshError(f"{file}: " + "; ".join(problems))
    return {
        **files.mesh_facts(mesh),
        "file": str(file),
        "size_mm": [float(1e3 * size) for size in np.ptp(mesh.nodes, axis=0)],
        "axis": axis,
        "sets": {name: f"{len(nodes)} nodes" for name, nodes in sorted(mesh.sets.items())} or "none",
    }


def section(file: Path, place: str, options: dict[str, Any]) -> str:
    """The lines for the stage file."""
    lines = [f"[{place}.import]", f'file = "{file.name}"', f'length = "{1e3 * options["length"]:g} mm"']
    held = "rim" if place == "ring" else "bore"
    lines += [f'{held} = "{options["bore"]}"'] if options["bore"] else []
    lines += [f"bolts = {list(options['bolts'])}".replace("'", '"')] if options["bolts"] else []
    lines += [f'axis = "{options["axis"]}"'] if options["axis"] != "z" else []
    lines += [f"ignore = {list(options['ignore'])}".replace("'", '"')] if options["ignore"] else []
    return "\n".join(lines)
