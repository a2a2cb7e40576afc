"""The verb bearings: rolling bearings of a stage under a torque."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from gearfmu.commands.shared import FILE, quantity, stage_names

if TYPE_CHECKING:
    from gearfmu.stage.run.bearings import BearingState


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
