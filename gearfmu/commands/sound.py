"""Verbs of housings and sound: house, paths, sound."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from gearfmu.commands.shared import FILE, quantity, stage_names

if TYPE_CHECKING:
    from gearfmu.sound import SoundPower


@click.command()
@click.argument("run", type=click.Path(exists=True, path_type=Path))
@click.argument("housing", shell_complete=stage_names)
@click.option("--out", type=FILE, help="Trace that is written; housed.h5 beside the run when not given.")
@quantity("--torque", "Torque on the input; that of the run when not given.")
def house(run: Path, housing: str, out: Path | None, torque: float | None) -> None:
    """Put a housing under a finished RUN on rigid ground (its trace.h5 or folder): HOUSING is a stage with the same
    bearings in a housing. Writes a trace of seat forces, mount forces, sensors and the housing's motion."""
    from gearfmu.api.sound import house as housed_trace

    trace = housed_trace(run, housing, torque)
    target = out or (run if run.is_dir() else run.parent) / "housed.h5"
    trace.save(target)
    half = trace.window(float(trace.time[0]) + 0.5 * float(trace.time[-1] - trace.time[0]))
    for name in trace.matching(["sensor.*"]) if any(own.startswith("sensor.") for own in trace.channels) else ():
        click.echo(f"{name:24} {np.std(half[name]):10.4g} m/s2 rms")
    click.echo(f"wrote {target}")


@click.command()
@click.argument("run", type=click.Path(exists=True, path_type=Path))
@click.option("--housing", help="STAGE of the housing; that of the run when not given.")
@click.option(
    "--matrix", type=FILE, help="File of the radiation matrix; that beside the housing's body when not given."
)
@click.option("--patches", type=click.IntRange(50, 6000), help="Boundary elements; those of the matrix when not given.")
@quantity("--start", "Time from which sound counts.", "time", default=0.0)
@click.option("--erp", is_flag=True, help="Print equivalent radiated power beside the sound power.")
@click.option("--speed", help="Channel of a waterfall, input.gear.w: one row a segment of time in the CSV file.")
@click.option("--csv", "table", type=FILE, help="Write third octaves as CSV file.")
def sound(run: Path, housing: str | None, patches: int | None, erp: bool, start: float, **how: Any) -> None:
    """Sound power that the housing of RUN radiates into free air: third octaves (IEC 61260), level in dB and dB(A) re
    1 pW. RUN is the trace or folder of a housed run, or a trace of `gearfmu house`."""
    from gearfmu.api.sound import sound_power

    found = sound_power(run, housing, how["matrix"], patches, how["speed"], start)
    for line in _lines(found, erp):
        click.echo(line)
    _write(how["table"], _columns(found))


@click.command()
@click.argument("run", type=click.Path(exists=True, path_type=Path))
@click.argument("sensor")
@click.option("--housing", help="STAGE of the housing; that of the run when not given.")
@quantity("--band", "Nominal frequency of a third octave; all of them when not given.", "frequency")
@quantity("--start", "Time from which the run counts.", "time", default=0.0)
@click.option("--csv", "table", type=FILE, help="Write every path in third octaves as CSV file.")
def paths(run: Path, sensor: str, housing: str | None, band: float | None, **how: Any) -> None:
    """Transfer paths: share of every bearing direction in the acceleration of SENSOR (top.ay). RUN is the trace or
    folder of a housed run, or a trace of `gearfmu house`. Shares sum to 100 %; one below 0 makes the sensor quieter."""
    from gearfmu.api.sound import transfer_paths
    from gearfmu.report.metrics import level

    found = transfer_paths(run, sensor, housing, how["start"])
    share, rms = found.share(band), found.rms(band)
    counted = "63 Hz to 8 kHz" if band is None else f"third octave {band:g} Hz"
    click.echo(f"{f'{found.sensor}, {counted}':32}    share    alone")
    for i in np.argsort(-np.abs(share)):
        click.echo(f"{found.names[i]:32} {100 * share[i]:8.1f} %  {rms[i]:.3g} m/s2 rms")
    alone, joint = found.octaves()
    columns = {"third_octave_[Hz]": found.bands, "together_[dB]": level(np.sqrt(joint.sum(axis=0)), 1e-6)}
    _write(how["table"], columns | {f"{n}_[dB]": level(np.sqrt(alone[i]), 1e-6) for i, n in enumerate(found.names)})


def _write(table: Path | None, columns: dict[str, np.ndarray]) -> None:
    """Columns as CSV file, where one is wanted."""
    if table is not None:
        from gearfmu.stage.run.trace import write_columns

        write_columns(table, columns)
        click.echo(f"wrote {table}")


def _lines(found: SoundPower, erp: bool) -> list[str]:
    """Third octaves of the mean over all segments, then the levels."""
    from gearfmu.sound import level

    kinds = (False, True) if erp else (False,)
    bands = [level(found.third_octaves(own).mean(axis=0)) for own in kinds]
    lines = ["third octave  " + "  ".join(("sound power", "       ERP")[: len(kinds)])]
    for i, middle in enumerate(found.bands):
        lines.append(f"{middle:9.0f} Hz  " + "  ".join(f"{own[i]:8.1f} dB" for own in bands))
    for own, name in zip(kinds, ("sound power", "ERP"), strict=False):
        total, weighted = (10 * np.log10(np.mean(10 ** (0.1 * x))) for x in (found.total(own), found.total_a(own)))
        lines.append(f"{name} level {total:.1f} dB, {weighted:.1f} dB(A) re 1 pW")
    return lines


def _columns(found: SoundPower) -> dict[str, np.ndarray]:
    """Columns of the CSV file: one row a band, or a segment where there is a speed."""
    from gearfmu.sound import level

    power, erp = found.third_octaves(), found.third_octaves(erp=True)
    if found.speed is None:
        own = {"sound_power_[dB]": level(power[0]), "erp_[dB]": level(erp[0])}
        return {"third_octave_[Hz]": found.bands} | own
    bands = {f"third_octave_{middle:.0f}_Hz_[dB]": level(power[:, i]) for i, middle in enumerate(found.bands)}
    return {"time_[s]": found.time, "speed_[rad/s]": found.speed, "level_[dB]": found.total(),
            "level_[dB(A)]": found.total_a()} | bands  # fmt: skip
