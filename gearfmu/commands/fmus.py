"""Verbs of the FMU: export, validate."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.shared import PATH, progress_bar, stage_names

if TYPE_CHECKING:
    from gearfmu.stage import StageModel

OF_INPUT = ("torque", "speed")  # starts that are no parameters


@click.command()
@click.argument("stage", required=False, shell_complete=stage_names)
@click.option("-o", "--out", type=PATH, help="File to write; <stage>.fmu when not given.")
@click.option(
    "--port", "ports", multiple=True, metavar="SHAFT=KIND", help="Another kind of port: pinion=torque; may repeat."
)
@click.option(
    "--scene",
    help="A SCENE that the FMU is to run in: it gets the shafts of the scene's drivetrain. Without STAGE the scene's.",
)
@click.option(
    "--runtime",
    type=click.Choice(["native", "python"]),
    default="native",
    show_default=True,
    help="native: compiled, needs nothing; python: pythonfmu, for hosts that are Python.",
)
@click.option(
    "--platform",
    "platforms",
    multiple=True,
    type=click.Choice(["host", "linux64", "win64", "darwin64", "aarch64-linux"]),
    help="A platform to put in, may repeat; all whose kernel is installed when not given. A checkout makes others than "
    "its own with the [cross] extra.",
)
@click.option(
    "--observe", multiple=True, metavar="GEAR", help="Its rigid motion and modal amplitudes become outputs; may repeat."
)
@click.option(
    "--start",
    "starts",
    multiple=True,
    metavar="NAME=VALUE",
    help="Start value of a parameter: level=fast, slices=10; for importers that set none, or no enumeration. "
    'torque="200 N*m" and speed="2000 rpm" of the input: <out>_windup.csv lists the inputs with which it starts under '
    "that torque. May repeat.",
)
@click.option(
    "--terminals/--no-terminals",
    default=False,
    show_default=True,
    help="The file terminalsAndIcons.xml, which some importers refuse: docs/howto-fmu.md.",
)
@click.option("--author", default="", help="Author of the model, for its description.")
@click.option("--copyright", default="", help='Copyright of the model: "(c) 2026 …".')
@click.option("--license", default="", help="Licence of the model; that of the binary lies in the FMU anyway.")
@click.option("--sources", is_flag=True, help="Also the C sources of the binary and how to build it.")
def export(stage: str | None, out: Path | None, ports: tuple[str, ...], starts: tuple[str, ...], **how: Any) -> None:
    """Export STAGE as an FMI 2.0 co-simulation FMU."""
    from gearfmu import fmu
    from gearfmu.api.results import windup_file, with_windup
    from gearfmu.commands.models import model_in_scene, model_of, parameters
    from gearfmu.stage.run.simulate import write_starts

    scene, observe = how.pop("scene"), how.pop("observe")
    if scene is not None:
        if ports:
            raise click.UsageError("--scene decides the ports: leave --port away")
        model = model_in_scene(scene, stage, observe)
    elif stage is None:
        raise click.UsageError("name a STAGE, or a scene with --scene")
    else:
        model = model_of(stage, port_kinds(ports), observe=observe)
    wound = {name: value for name, sign, value in (text.partition("=") for text in starts) if name in OF_INPUT and sign}
    model, inputs = with_windup(model, wound.get("torque"), wound.get("speed"))
    model = model.with_starts(parameters(model, tuple(s for s in starts if s.split("=")[0] not in OF_INPUT), "--start"))
    path, runtime = out or Path(f"{model.name}.fmu"), how["runtime"]
    how["platforms"] = how["platforms"] or None
    with progress_bar(f"export {model.name}") as progress:
        progress(None, "writing")
        fmu.export(model, path, **how)
    click.echo(f"{path}: {path.stat().st_size / 1e6:.1f} MB, {runtime}, model {model.hash[:12]}")
    if inputs:
        click.echo(f"{write_starts(windup_file(path), model, inputs)}: set these inputs before the initialisation ends")
    click.echo(how_to_load(path, model))


def how_to_load(path: Path, model: StageModel) -> str:
    """Inputs for an importer to connect, and how Python loads the FMU."""
    names = [variable.name for variable in model.kernel_variables() if variable.causality == "input"]
    connect = f"connect {', '.join(names[:6])}{' …' if len(names) > 6 else ''}" if names else "it has no inputs"
    return (
        f"Load it as an FMI 2.0 co-simulation FMU at a fixed step of 100 µs; {connect}. In Python:\n"
        f'  fmpy.simulate_fmu("{path}", stop_time=0.01, output_interval=1e-4)'
    )


@click.command()
@click.argument("path", type=PATH, metavar="FMU")
@click.option("--json", "as_json", is_flag=True, help="Problems as JSON.")
def validate(path: Path, as_json: bool) -> int:
    """Check an FMU of ours or of others. Exit code: the number of problems (at most 99), 0 for none."""
    from gearfmu import fmu

    problems = fmu.validate(path)
    if as_json:
        click.echo(json.dumps([str(problem) for problem in problems], indent=2, ensure_ascii=False))
    else:
        for problem in problems:
            click.echo(str(problem))
        click.echo(f"{path}: {len(problems)} problem{'s' if len(problems) != 1 else ''}")
    return min(len(problems), 99)


def port_kinds(texts: tuple[str, ...]) -> dict[str, str]:
    """{"pinion": "torque"} from ("pinion=torque",); a usage error for anything else."""
    from gearfmu.api.models import PORT_KINDS

    found: dict[str, Any] = {}
    for text in texts:
        shaft, sign, kind = text.partition("=")
        if not sign or not shaft or kind not in PORT_KINDS:
            raise click.BadParameter(
                f"'{text}' is not SHAFT=KIND with a kind of {', '.join(PORT_KINDS)}", param_hint="--port"
            )
        found[shaft] = kind
    return found
