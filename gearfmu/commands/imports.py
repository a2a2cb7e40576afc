"""The verb for finite elements made elsewhere: import."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.shared import PATH, echo_pairs, quantity, stage_names

if TYPE_CHECKING:
    from gearfmu.stagefile.forms.general import Stage


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
