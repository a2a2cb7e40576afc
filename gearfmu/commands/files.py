"""Verbs about files: inspect, schema, convert."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.shared import PATH, echo_pairs

if TYPE_CHECKING:
    from gearfmu.stagefile.forms.general import Stage

UNITS = {
    "r_b": "m", "r_f": "m", "r_a": "m", "base_pitch": "m", "ring_least_tip_radius": "m", "gap_between_planets": "m",
    "sun_torque_in_one_mesh": "N*m", "largest_hertz_half_width_planet_ring": "m", "carrier_mass": "kg",
    "youngs_modulus": "Pa", "density": "kg/m3", "volume": "m^3", "flank_element_length": "m",
}  # fmt: skip


@click.command()
@click.argument("path", type=PATH, metavar="FILE")
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
def inspect(path: Path, as_json: bool) -> None:
    """Show the contents of FILE: a body or trace (.h5), a stage or scene (.toml), an FMU, or the folder of a stage.
    Lengths in mm or µm, angles in degrees, speeds in rpm; with --json all in SI."""
    if as_json:
        click.echo(json.dumps(facts_of(path), indent=2, ensure_ascii=False, default=str))
    else:
        echo_pairs(in_units(facts_of(path, plain=False)))


@click.command()
@click.argument("kind", type=click.Choice(["stage", "general", "planetary", "scene"]))
@click.option("--out", type=PATH, help="File to write; standard output when not given.")
def schema(kind: str, out: Path | None) -> None:
    """JSON schema of the stage.toml of a pair (stage), a general stage or a planetary set, or of scene.toml."""
    from gearfmu.files import write_text
    from gearfmu.scenefile.scene import SceneSpec
    from gearfmu.stagefile.schema import file_schema, general_schema, set_schema, stage_schema

    stages = {"stage": stage_schema, "general": general_schema, "planetary": set_schema}
    made = file_schema(SceneSpec) if kind == "scene" else stages[kind]()
    text = json.dumps(made, indent=2, ensure_ascii=False) + "\n"
    if out is None:
        click.echo(text, nl=False)
    else:
        write_text(out, text)


def facts_of(path: Path, plain: bool = True) -> dict[str, Any]:
    """Contents of the file at `path`, by its kind; plain: numbers in SI, else specs with quantities as text. Raises
    GearfmuError for a file that is none of ours."""
    from gearfmu.errors import GearfmuError

    if not path.exists():
        path = _shipped(path)
    toml = _toml if plain else _toml_with_units
    readers = {".h5": _hdf5, ".toml": toml, ".fmu": _fmu}
    reader = toml if path.is_dir() else readers.get(path.suffix.lower())
    if reader is None:
        raise GearfmuError(f"{path}: 'inspect' reads {', '.join(readers)} and the folder of a stage")
    return reader(path)


def _shipped(name: Path) -> Path:
    """File of a shipped scene, or of a stage as `find_stage` finds it; an error that names all when there is none."""
    from gearfmu.errors import GearfmuError, SpecError
    from gearfmu.scenefile.scene import SHIPPED, shipped_scenes
    from gearfmu.stagefile.reading.files import find_stage, shipped_stages

    scenes = shipped_scenes()
    if str(name) in scenes:
        return SHIPPED / f"{name}.toml"
    try:
        return find_stage(name)
    except SpecError:
        known = ", ".join([*shipped_stages(), *scenes])
        raise GearfmuError(f"{name}: no such file; shipped are {known}") from None


def _hdf5(path: Path) -> dict[str, Any]:
    from gearfmu.body import inspect_file
    from gearfmu.body.store import FILE as BODY
    from gearfmu.files import format_of
    from gearfmu.stage.run.deformation import FILE as DEFORMATION
    from gearfmu.stage.run.trace import Trace

    name, _ = format_of(path)
    if name in BODY.names:
        return inspect_file(path)
    if name == DEFORMATION.name:
        return _deformation(path)
    trace = Trace.load(path)
    channels = {
        name: {"unit": c.unit, "min": float(c.values.min()), "max": float(c.values.max())}
        for name, c in trace.channels.items()
    }
    span = [float(trace.time[0]), float(trace.time[-1])]
    return {
        "file": str(path),
        "kind": "trace",
        "samples": trace.time.size,
        "time_s": span,
        "channels": channels,
        "meta": trace.meta,
    }


def _deformation(path: Path) -> dict[str, Any]:
    from gearfmu.stage.run.deformation import Deformation

    found = Deformation.load(path)
    return {
        "file": str(path),
        "kind": "deformation",
        "frames": found.time.size,
        "pictures_at_s": found.time[found.pictures].tolist(),
        "film_frames": found.film.size,
        "gears": {name: {"modes": gear.modes.size, "body": gear.body_hash} for name, gear in found.gears.items()},
        "meta": dict(found.meta),
    }


def _toml(path: Path) -> dict[str, Any]:
    from gearfmu.scenefile.scene import load_scene
    from gearfmu.stagefile.forms.derived import derived
    from gearfmu.stagefile.reading.base import read_toml
    from gearfmu.stagefile.stage import load_stage

    if path.is_file() and "coupling" in read_toml(path):
        return {"file": str(path), "kind": "scene", **load_scene(path).model_dump(mode="json")}
    stage = load_stage(path)
    return {
        "file": str(path),
        "kind": "stage",
        **stage.written.model_dump(mode="json", exclude={"kind"}),
        "derived": derived(stage),
        "reduction": _needs(stage),
    }


def _needs(stage: Stage) -> str | dict[str, dict[str, float]]:
    """Unknowns and memory for the reduction of every body, estimated from its mesh; or why it cannot be meshed."""
    from gearfmu.body import body_needs
    from gearfmu.errors import MeshError

    try:
        needs = body_needs(stage)
    except MeshError as error:
        return str(error)
    return {
        name: {f"unknowns{'' if need.whole else '_a_sector'}": need.unknowns, "memory_GB": round(1e-9 * need.memory, 2)}
        for name, need in needs.items()
    }


def _toml_with_units(path: Path) -> dict[str, Any]:
    from gearfmu.scenefile.scene import load_scene
    from gearfmu.stagefile.reading.base import shown
    from gearfmu.stagefile.stage import load_stage

    found = _toml(path)
    spec = load_scene(path) if found["kind"] == "scene" else load_stage(path).written
    own = {key: value for key, value in shown(spec).items() if key != "kind"}
    after: dict[str, Any] = {key: found[key] for key in ("derived", "reduction") if key in found}
    return {"file": found["file"], "kind": found["kind"], **own, **after}


def in_units(found: object, key: str = "") -> Any:
    """Numbers without a unit in their name as text with it, here in what follows from a stage and in bodies."""
    from gearfmu.quantities import quantity_text

    if isinstance(found, dict):
        return {name: in_units(value, key if name in ("sun_planet", "planet_ring") else name)
                for name, value in found.items()}  # fmt: skip
    return quantity_text(found, UNITS[key]) if isinstance(found, float) and key in UNITS else found


def _fmu(path: Path) -> dict[str, Any]:
    import fmpy

    from gearfmu.errors import FmuError

    try:
        description = fmpy.read_model_description(str(path))
    except Exception as error:  # fmpy lets errors of zipfile, lxml and its own through
        raise FmuError(f"{path}: not an FMU ({error}); 'gearfmu validate' says more") from error
    variables = {v.name: f"{v.causality}, {v.unit or '-'}: {v.description or ''}" for v in description.modelVariables}
    return {
        "file": str(path),
        "kind": "fmu",
        "model": description.modelName,
        "fmi": description.fmiVersion,
        "guid": description.guid,
        "platforms": list(fmpy.supported_platforms(str(path))),
        "variables": variables,
    }


@click.command()
@click.argument("path", type=PATH, metavar="TRACE")
@click.argument("out", type=PATH, metavar="OUT")
@click.option("--channel", "channels", multiple=True, metavar="NAME", help="Only this channel; may repeat.")
def convert(path: Path, out: Path, channels: tuple[str, ...]) -> None:
    """Write TRACE (the file, or the folder that holds trace.h5) as OUT in the format of its suffix: .csv, .mat
    (MATLAB), .parquet, .uff or .unv (Universal File Format, data sets 58), .mf4 (ASAM MDF 4)."""
    from gearfmu.api.results import convert as write

    click.echo(write(path / "trace.h5" if path.is_dir() else path, out, channels or None))
