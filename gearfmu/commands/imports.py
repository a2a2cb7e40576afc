"""The verb for finite elements made elsewhere: import."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from gearfmu.commands.shared import Quantity, echo_pairs


@click.command(name="import")
@click.argument("file", type=click.Path(path_type=Path))
@click.argument("stage", required=False)
@click.argument("gear", required=False)
@click.option("--length", type=Quantity("m"), required=True, help='One length unit of the file: "1 mm".')
@click.option(
    "--axis", type=click.Choice(["x", "y", "z"]), default="z", show_default=True, help="Axis of the gear in the file."
)
@click.option("--bore", default="", help="Node set of the bore; without it the nodes on the stage's bore diameter.")
@click.option("--ignore", multiple=True, help="Node set of reference nodes that belong to no element.")
def import_(file: Path, stage: str | None, gear: str | None, **options: Any) -> None:
    """Check the finite elements in FILE: elements, quality, node sets. With STAGE and GEAR also fit the involutes and
    print the section for the stage file. Writes nothing."""
    if stage is None:
        echo_pairs(mesh_facts(file, options["length"], options["ignore"], options["axis"]))
        return
    from gearfmu.spec.imported import ImportSpec
    from gearfmu.spec.stage import load_pair

    spec = load_pair(stage)
    named = next((g for g in spec.gears if g.name == gear), None)
    if named is None:
        names = ", ".join(g.name for g in spec.gears)
        raise click.BadParameter(f"name a gear of the stage: {names}", param_hint="GEAR")
    from gearfmu.body.imported import check_gear
    from gearfmu.geometry import GearGeometry

    source = ImportSpec(file=str(file), **options)
    found = check_gear(named.model_copy(update={"imported": source}), GearGeometry.of(named, spec.pair))
    echo_pairs(found.facts)
    click.echo("\n" + section(file, gear, options))


def mesh_facts(file: Path, length: float, ignore: tuple[str, ...], axis: str) -> dict[str, Any]:
    """What a mesh file holds, SI; MeshError lists what is wrong with it."""
    import numpy as np

    from gearfmu.errors import MeshError
    from gearfmu.fem import solids
    from gearfmu.fem.mesh_checks import mesh_problems
    from gearfmu.femesh.imported import read_mesh

    mesh = read_mesh(file, length, ignore)
    if problems := mesh_problems(mesh.nodes, mesh.elements, mesh.labels):
        raise MeshError(f"{file}: " + "; ".join(problems))
    quality = np.concatenate(
        [solids.jacobian_quality(mesh.nodes, block, kind) for kind, block in mesh.elements.items()]
    )
    return {
        "file": str(file),
        "nodes": len(mesh.nodes),
        "elements": {kind: len(block) for kind, block in mesh.elements.items()},
        "raised_to_quadratic": mesh.raised,
        "size_mm": [float(1e3 * size) for size in np.ptp(mesh.nodes, axis=0)],
        "axis": axis,
        "scaled_jacobian_min": float(quality.min()),
        "scaled_jacobian_mean": float(quality.mean()),
        "sets": {name: f"{len(nodes)} nodes" for name, nodes in sorted(mesh.sets.items())} or "none",
    }


def section(file: Path, gear: str | None, options: dict[str, Any]) -> str:
    """The lines for the stage file."""
    lines = [f"[gears.{gear}.import]", f'file = "{file.name}"', f'length = "{1e3 * options["length"]:g} mm"']
    lines += [f'bore = "{options["bore"]}"'] if options["bore"] else []
    lines += [f'axis = "{options["axis"]}"'] if options["axis"] != "z" else []
    lines += [f"ignore = {list(options['ignore'])}".replace("'", '"')] if options["ignore"] else []
    return "\n".join(lines)
