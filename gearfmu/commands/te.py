"""The verb te: loaded transmission error as a table and a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from gearfmu.commands.models import model_of
from gearfmu.commands.shared import Quantity


@click.command()
@click.argument("stage")
@click.option(
    "--torque",
    "torques",
    multiple=True,
    required=True,
    type=Quantity("N*m"),
    help='Torque on the input, "302 N*m"; "0 N*m" for the unloaded stage; may repeat.',
)
@click.option(
    "--positions",
    type=click.IntRange(2, 100_000),
    default=41,
    show_default=True,
    help="Positions over one pitch, end point left out.",
)
@click.option("--rigid-bearings", is_flag=True, help="Hold the axes.")
@click.option(
    "--bore",
    type=click.Choice(["averaging", "rigid"]),
    help="Bores of all gears: averaging (they may deform about their mean motion) or rigid (on stiff shafts); as the "
    "stage file says when not given. Other bodies than the stage's are reduced once, into a folder beside it.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("te.csv"),
    show_default=True,
    help="Table; the plot has the same name. Of a train one of each for every mesh, its name added.",
)
def te(
    stage: str, torques: tuple[float, ...], positions: int, rigid_bearings: bool, bore: str | None, out: Path
) -> None:
    """Loaded transmission error of STAGE over one pitch, output held: te_um = 1e6·(r_bA φ_A + r_bB φ_B) of every mesh.

    The torque acts on the input, the first port: a pair's pinion. The output is the second port."""
    model = model_of(stage, bores=bore)
    from gearfmu.report.te import write_plot
    from gearfmu.stage import loaded_te
    from gearfmu.stage.trace import write_columns

    meshes = [mesh.name for mesh in model.stage.engagements]
    for mesh in meshes:
        result = loaded_te(model, list(torques), positions, rigid_bearings, mesh)
        held = result if rigid_bearings else loaded_te(model, list(torques), positions, True, mesh)
        path = out.with_stem(f"{out.stem}_{mesh}") if len(meshes) > 1 else out
        write_columns(path, te_columns(result))
        picture = path.with_suffix(".png")
        write_plot(result, picture)
        if len(meshes) > 1:
            click.echo(mesh)
        _tell(result, held)
        click.echo(f"{path}, {picture}")


def _tell(result: Any, held: Any) -> None:
    """One line a torque; held: the same with rigid bearings."""
    for torque, row, mesh, stiffness in zip(result.torque, result.te, held.stiffness, result.stiffness, strict=True):
        with_bearings = "" if held is result else f", with the bearings {1e-6 * stiffness.mean():.1f} N/µm"
        click.echo(
            f"{torque:8.1f} N·m: mean {1e6 * row.mean():.3f} µm, peak to peak {1e6 * np.ptp(row):.3f} µm, "
            f"mesh stiffness (bores held) {1e-6 * mesh.mean():.1f} N/µm{with_bearings}"
        )


def te_columns(result: Any) -> dict[str, np.ndarray]:
    """Columns of te.csv, torques one below the other: torque_Nm, position, te_um, mesh_stiffness_N_per_um, share_1 …"""
    rows, positions = result.te.shape
    columns = {
        "torque_Nm": np.repeat(result.torque, positions),
        "position": np.tile(result.position, rows),
        "te_um": 1e6 * result.te.ravel(),
        "mesh_stiffness_N_per_um": 1e-6 * result.stiffness.ravel(),
    }
    columns |= {f"share_{k + 1}": result.shares[:, :, k].ravel() for k in range(result.shares.shape[2])}
    return columns
