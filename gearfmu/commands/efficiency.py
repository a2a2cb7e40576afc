"""The verb efficiency: what the meshes of a stage lose to friction, by a run and by the closed form."""

from __future__ import annotations

import click

from gearfmu.commands.models import model_of
from gearfmu.commands.shared import Quantity, echo_pairs, level_option, stage_names


@click.command()
@click.argument("stage", shell_complete=stage_names)
@click.option("--torque", required=True, type=Quantity("torque"), help='Torque on the input, "302 N*m".')
@click.option("--speed", required=True, type=Quantity("speed"), help='Speed of the input, "2000 rpm".')
@click.option(
    "--pitches", type=click.IntRange(1, 10_000), default=8, show_default=True, help="Whole pitches of the slowest mesh."
)
@level_option
def efficiency(stage: str, torque: float, speed: float, pitches: int, level: str | None) -> None:
    """Efficiency of the meshes of STAGE at constant load: mean friction power of a run over whole pitches, and
    P mu H_V with the tooth loss factor of Ohlendorf (ISO/TR 14179-2) and the run's mean coefficient of friction. Power
    is that which rolls through a mesh: in a planetary set less than the input's.

    The coefficient follows what the stage says ([contact] friction), else it is 0.05. Losses of bearings, seals and
    churned oil are in neither number."""
    from gearfmu.commands.settings import level_of
    from gearfmu.stage.run.efficiency import mesh_efficiency

    model = model_of(stage)
    echo_pairs(mesh_efficiency(model, torque, speed, level_of(model, level), pitches=pitches).columns())
