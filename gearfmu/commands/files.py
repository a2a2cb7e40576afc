"""Verbs about files: inspect, schema."""
from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from gearfmu.commands.shared import echo_pairs


@click.command()
@click.argument("path", type=click.Path(path_type=Path), metavar="FILE")
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
def inspect(path: Path, as_json: bool) -> None:
    """Say what FILE holds: a body or trace (.h5), a stage or scene (.toml), an FMU, or the folder of a stage."""
    found = facts_of(path)
    if as_json:
        click.echo(json.dumps(found, indent=2, ensure_ascii=False, default=str))
    else:
        echo_pairs(found)


@click.command()
@click.argument("kind", type=click.Choice(["stage", "scene", "variables"]))
@click.option("--out", type=click.Path(path_type=Path), help="File to write; standard output when not given.")
def schema(kind: str, out: Path | None) -> None:
    """JSON schema of stage.toml or scene.toml; or the table of FMU variables (docs/variables.md)."""
    from gearfmu.files import write_text

    text = _schema_text(kind)
    if out is None:
        click.echo(text, nl=False)
    else:
        write_text(out, text)


def _schema_text(kind: str) -> str:
    if kind == "variables":
        from gearfmu.commands.variables import variables_page

        return variables_page()
    from gearfmu import spec

    made = spec.stage_schema() if kind == "stage" else spec.scene_schema()
    return json.dumps(made, indent=2, ensure_ascii=False) + "\n"


def facts_of(path: Path) -> dict[str, Any]:
    """What the file at `path` holds, by its kind; raises GearfmuError for a file that is none of ours."""
    from gearfmu.errors import GearfmuError

    if not path.exists():
        raise GearfmuError(f"{path}: no such file")
    readers = {".h5": _hdf5, ".toml": _toml, ".fmu": _fmu}
    reader = _toml if path.is_dir() else readers.get(path.suffix.lower())
    if reader is None:
        raise GearfmuError(f"{path}: 'inspect' reads {', '.join(readers)} and the folder of a stage")
    return reader(path)


def _hdf5(path: Path) -> dict[str, Any]:
    import h5py

    from gearfmu.body import inspect_file
    from gearfmu.stage.trace import FORMAT, Trace

    if h5py.is_hdf5(path):
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                return inspect_file(path)
    trace = Trace.load(path)
    channels = {name: {"unit": c.unit, "min": float(c.values.min()), "max": float(c.values.max())} for name, c in trace.channels.items()}
    span = [float(trace.time[0]), float(trace.time[-1])]
    return {"kind": "trace", "samples": trace.time.size, "time_s": span, "channels": channels, "meta": trace.meta}


def _toml(path: Path) -> dict[str, Any]:
    from gearfmu.spec import load_scene, load_stage
    from gearfmu.spec.base import read_toml

    is_scene = path.is_file() and "stage" in read_toml(path)
    spec = load_scene(path) if is_scene else load_stage(path)
    return {"kind": "scene" if is_scene else "stage", **spec.model_dump(mode="json")}


def _fmu(path: Path) -> dict[str, Any]:
    import fmpy

    from gearfmu.errors import FmuError

    try:
        description = fmpy.read_model_description(str(path))
    except Exception as error:  # fmpy lets errors of zipfile, lxml and its own through
        raise FmuError(f"{path}: not an FMU ({error}); 'gearfmu validate' says more") from error
    variables = {v.name: f"{v.causality}, {v.unit or '-'}: {v.description or ''}" for v in description.modelVariables}
    return {"kind": "fmu", "model": description.modelName, "fmi": description.fmiVersion, "guid": description.guid,
            "platforms": list(fmpy.supported_platforms(str(path))), "variables": variables}  # fmt: skip
