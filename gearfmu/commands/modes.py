"""The verb modes: modes of a body as a table, pictures and .vtu files."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearfmu.commands.models import bodies_for_motion, bodies_of, by_text
from gearfmu.commands.shared import PATH, progress_bar, quantity, stage_names
from gearfmu.commands.te import warn_of_limits

if TYPE_CHECKING:
    from gearfmu.modes.linear import StageModes
    from gearfmu.modes.shapes import BodyModes
    from gearfmu.report.campbell import Crossing


COUPLED = (
    "with the couplings of [carrier.coupling]: where they are rigid, bolts and bore stiffen the plate; "
    "--uncoupled shows it without"
)


@click.command()
@click.argument("stage", shell_complete=stage_names)
@click.option("--body", "name", metavar="NAME", help="Modes of this body, with pictures; without: of the whole stage.")
@click.option("--count", type=click.IntRange(1, 400), default=20, show_default=True, help="Modes; a pair is two.")
@click.option("--mounted", is_flag=True, help="The ring of a planetary set on its mounts instead of free.")
@click.option("--uncoupled", is_flag=True, help="The carrier of a set without the couplings of its bolts and bore.")
@quantity("--torque", 'Without --body: torque on the input, "302 N*m"; default: the largest that torque_max allows.')
@click.option("--out", type=PATH, default=Path("modes"), show_default=True, help="Folder to write to.")
def modes(stage: str, name: str | None, count: int, torque: float | None, out: Path, **how: bool) -> None:
    """Natural frequencies of STAGE.

    With --body: elastic modes of one body, with nodal diameters, and per frequency a picture and a .vtu file. Without:
    the stage linearised in loaded contact, gears, shafts, bearings and port springs together, and a Campbell diagram.
    The torque acts on the input, the first port: a pair's pinion.
    """
    if name is None:
        for option, which in (("mounted", "ring"), ("uncoupled", "carrier")):
            if how[option]:
                raise click.BadParameter(f"goes with --body {which}", param_hint=f"--{option}")
        return _of_stage(stage, torque, count, out)
    if torque is not None:
        raise click.BadParameter("modes of a free body have no torque: leave it out", param_hint="--torque")
    body = _shapes(stage, name, count, **how)
    for line in table(body):
        click.echo(line)
    if body.name == "carrier":
        click.echo(COUPLED)
    _write(body, out)
    click.echo(f"{out / body.name}_modes.csv, _sheet.png and per frequency _mode_NN.png, .vtu")


def _of_stage(stage: str, torque: float | None, count: int, out: Path) -> None:
    spec, bodies = bodies_for_motion(stage)
    if torque == 0:
        raise click.BadParameter("must not be 0: flanks have to carry load", param_hint="--torque")
    from gearfmu.modes.linear import stage_modes
    from gearfmu.report.campbell import campbell_columns, crossings, mesh_families, write_campbell
    from gearfmu.stage import assemble
    from gearfmu.stage.run.limits import largest_speed, largest_torque
    from gearfmu.stage.run.trace import write_columns

    model = assemble(spec, bodies)
    found = stage_modes(model, bodies, largest_torque(model) if torque is None else torque, count)
    if torque is not None:
        warn_of_limits(model, (torque,))
    for line in stage_table(found):
        click.echo(line)
    name, families, speed_max = model.shafts.input, mesh_families(model), largest_speed(model)
    for line in crossing_lines(crossings(found, families, speed_max), name, len(found.meshes) > 1):
        click.echo(line)
    out.mkdir(parents=True, exist_ok=True)
    paths = out / f"{spec.name}_frequencies.csv", out / f"{spec.name}_campbell.png"
    write_columns(paths[0], campbell_columns(found))
    write_campbell(found, name, families, speed_max, paths[1])
    click.echo(f"{paths[0]}, {paths[1]}")


def stage_table(found: StageModes) -> list[str]:
    """The linearised stage's modes as lines of a table, means over the pitch; of a train the largest mesh force."""
    lines = [f"linearised at {found.torque:g} N·m, {len(found.position)} positions of one pitch",
             "  mode  frequency   lowest  highest  damping     mesh force    strain energy in %",
             "               Hz       Hz       Hz        %  per te, N/µm   mesh bearings shafts bodies"]  # fmt: skip
    for k in range(found.frequency.shape[1]):
        f, share = found.frequency[:, k], 100 * found.shares[:, k].mean(axis=0)
        lines.append(
            f"{k + 1:6d} {f.mean():10.0f} {f.min():8.0f} {f.max():8.0f} {100 * found.damping_ratio[:, k].mean():8.2f} "
            f"{1e-6 * found.mesh_force[:, k].mean(axis=0).max():13.1f} {share[0]:6.0f} {share[1]:8.0f} {share[2]:6.0f} "
            f"{share[3]:6.0f}"
        )
    if found.rigid.size:
        low, high = found.rigid.min(), found.rigid.max()
        lines.append(
            f"not among them: free rotation of the whole stage, {low:.0f} … {high:.0f} Hz by its loads alone, as no "
            "spring port holds it"
        )
    return lines


def crossing_lines(found: Iterable[Crossing], shaft: str, several: bool) -> list[str]:
    """A line for each mode and each kind of equal meshes: the orders that meet it, and where. several: the stage has
    several meshes, whose names are given."""
    lines: dict[tuple[str, int], list[str]] = {}
    for crossing in found:
        rpm = 30 / math.pi * crossing.speed
        lines.setdefault((crossing.family.name, crossing.mode), []).append(f"{crossing.order} at {rpm:.0f}")
    return [
        f"mode {mode} meets mesh order {', '.join(orders)} rpm of the {shaft}" + (f" ({name})" if several else "")
        for (name, mode), orders in lines.items()
    ]


def table(body: BodyModes) -> list[str]:
    """The modes as lines of a table."""
    lines = ["    mode    frequency  damping  nodal      motion        energy in %              shape",
             "                   Hz        %  diameters                radial tangent. axial"]  # fmt: skip
    for mode in body.modes:
        radial, tangential, axial = 100 * mode.energy
        numbers = "–".join(map(str, mode.numbers))
        share = "" if mode.harmonic_share > 0.995 else f" ({100 * mode.harmonic_share:.0f} %)"
        lines.append(
            f"{numbers:>8} {mode.frequency:12.1f} {100 * mode.damping_ratio:8.2f}  "
            f"{f'{mode.nodal_diameter}{share}':<9}  "
            f"{mode.motion:<12} {radial:6.0f} {tangential:8.0f} {axial:6.0f}    {mode.name}"
        )
    return lines


def _shapes(stage: str, name: str, count: int, mounted: bool, uncoupled: bool) -> BodyModes:
    """mounted: the ring on its mounts; uncoupled: the carrier without couplings."""
    from gearfmu.modes.bodies import body_modes, gear_modes, mounted_ring_modes, uncoupled_carrier_modes
    from gearfmu.stagefile.forms.expand import CARRIER
    from gearfmu.stagefile.stage import load_stage

    spec = load_stage(stage)
    if uncoupled and not (spec.carriers and name == CARRIER):
        raise click.BadParameter("only the carrier of a planetary set has couplings", param_hint="--uncoupled")
    if mounted and not (spec.carriers and name == "ring"):
        raise click.BadParameter("only the ring of a planetary set has mounts", param_hint="--mounted")
    if name not in spec.files:
        raise click.BadParameter(f"no body '{name}'; the stage has {', '.join(spec.files)}", param_hint="--body")
    bodies = [] if spec.carriers else bodies_of(stage)[1]
    with progress_bar("shapes") as progress:
        tell = by_text(progress)
        if bodies:
            return gear_modes(spec, bodies[spec.files.index(name)], count, tell)
        if mounted:
            return mounted_ring_modes(spec, count, tell)
        return uncoupled_carrier_modes(spec, count, tell) if uncoupled else body_modes(spec, name, count, tell)


def _write(body: BodyModes, out: Path) -> None:
    """Table, contact sheet, and a picture and a .vtu a frequency."""
    from gearfmu.modes.vtu import write_mode
    from gearfmu.report.modes import mode_columns, write_contact_sheet, write_mode_picture
    from gearfmu.stage.run.trace import write_columns

    out.mkdir(parents=True, exist_ok=True)
    write_columns(out / f"{body.name}_modes.csv", mode_columns(body.modes))
    with progress_bar("pictures") as progress:
        write_contact_sheet(body, out / f"{body.name}_sheet.png")
        for done, mode in enumerate(body.modes):
            progress(done / len(body.modes))
            base = out / f"{body.name}_mode_{mode.numbers[0]:02d}"
            write_mode_picture(body, mode, base.with_suffix(".png"))
            write_mode(body, mode, base.with_suffix(".vtu"))
