"""The verb modes: modes of a body as a table, pictures and .vtu files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from gearfmu.commands.models import bodies_of, by_text
from gearfmu.commands.shared import progress_bar


@click.command()
@click.argument("stage")
@click.option("--body", "name", required=True, metavar="NAME", help="Which body: its free modes, with pictures.")
@click.option("--count", type=click.IntRange(1, 400), default=20, show_default=True, help="Modes; a pair counts as two.")
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("modes"), show_default=True, help="Folder of what is written."
)
def modes(stage: str, name: str, count: int, out: Path) -> None:
    """Elastic modes of a body of STAGE: frequencies, nodal diameters, and per frequency a picture and a .vtu file."""
    body = _shapes(stage, name, count)
    for line in table(body):
        click.echo(line)
    _write(body, out)
    click.echo(f"{out / name}_modes.csv, _sheet.png and per frequency _mode_NN.png, .vtu")


def table(body: Any) -> list[str]:
    """The modes as lines of a table."""
    lines = ["    mode    frequency  damping  nodal      motion        energy in %              shape",
             "                   Hz        %  diameters                radial tangent. axial"]  # fmt: skip
    for mode in body.modes:
        radial, tangential, axial = 100 * mode.energy
        numbers = "–".join(map(str, mode.numbers))
        share = "" if mode.harmonic_share > 0.995 else f" ({100 * mode.harmonic_share:.0f} %)"
        lines.append(
            f"{numbers:>8} {mode.frequency:12.1f} {100 * mode.damping_ratio:8.2f}  {f'{mode.nodal_diameter}{share}':<9}  "
            f"{mode.motion:<12} {radial:6.0f} {tangential:8.0f} {axial:6.0f}    {mode.name}"
        )
    return lines


def _shapes(stage: str, name: str, count: int) -> Any:
    spec, bodies = bodies_of(stage)
    names = [gear.name for gear in spec.gears]
    if name not in names:
        raise click.BadParameter(f"no body '{name}'; the stage has {', '.join(names)}", param_hint="--body")
    from gearfmu.modes.gear import gear_modes

    index = names.index(name)
    with progress_bar("shapes") as progress:
        return gear_modes(spec, index, bodies[index], count, by_text(progress))


def _write(body: Any, out: Path) -> None:
    """Table, contact sheet, and a picture and a .vtu a frequency."""
    from gearfmu.modes.vtu import write_mode
    from gearfmu.report.modes import mode_columns, write_contact_sheet, write_mode_picture
    from gearfmu.stage.trace import write_columns

    out.mkdir(parents=True, exist_ok=True)
    write_columns(out / f"{body.name}_modes.csv", mode_columns(body.modes))
    with progress_bar("pictures") as progress:
        write_contact_sheet(body, out / f"{body.name}_sheet.png")
        for done, mode in enumerate(body.modes):
            if progress:
                progress(done / len(body.modes))
            base = out / f"{body.name}_mode_{mode.numbers[0]:02d}"
            write_mode_picture(body, mode, base.with_suffix(".png"))
            write_mode(body, mode, base.with_suffix(".vtu"))
