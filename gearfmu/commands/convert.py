"""The verb convert: a trace in the format of another program."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("path", type=click.Path(path_type=Path), metavar="TRACE")
@click.argument("out", type=click.Path(path_type=Path), metavar="OUT")
@click.option("--channel", "channels", multiple=True, metavar="NAME", help="Only this channel; may repeat.")
def convert(path: Path, out: Path, channels: tuple[str, ...]) -> None:
    """Write TRACE (the file, or the folder that holds trace.h5) as OUT in the format of its suffix: .csv, .mat
    (MATLAB), .parquet, .uff or .unv (Universal File Format, data sets 58), .mf4 (ASAM MDF 4)."""
    from gearfmu.api.results import convert as write

    click.echo(write(path / "trace.h5" if path.is_dir() else path, out, channels or None))
