"""Verbs that simulate and report: run, simulate, report, compare, demo."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.shared import FILE, FOLDER, PATH, level_option, progress_bar, quantity, scene_names, stage_names

if TYPE_CHECKING:
    from gearfmu.body import Body
    from gearfmu.scenefile.scene import SceneSpec
    from gearfmu.stage import Trace
    from gearfmu.stage.run.deformation import Deformation
    from gearfmu.stagefile.forms.general import Stage

DEMO_STEP = 20e-6  # s


def _list(context: click.Context, option: object, wanted: bool) -> None:
    """Print the shipped scenes with their descriptions, and end."""
    if not wanted or context.resilient_parsing:
        return
    from gearfmu.scenefile.scene import load_scene, shipped_scenes

    names = shipped_scenes()
    for name in names:
        click.echo(f"{name:{max(map(len, names))}}  {load_scene(name).description}")
    context.exit()


@click.command()
@click.argument("scene", required=False, shell_complete=scene_names)
@click.option(
    "--out", type=FOLDER, help="Folder of trace.h5, summary.json and report.html; out/<scene> when not given."
)
@click.option(
    "--plan", "plan_path", type=PATH, help="A plan.toml of `gearfmu plan`, which names the scene: it is run as planned."
)
@click.option(
    "--unit",
    type=click.Choice(["fmu", "kernel"]),
    default="fmu",
    show_default=True,
    help="Through the exported FMU or the same kernel without it.",
)
@click.option(
    "--fmu",
    "fmu_path",
    type=PATH,
    help="An FMU exported earlier, which brings its stage; the scene's stage is exported anew when not given.",
)
@click.option("--verify", is_flag=True, help="Run again at half the communication step and report the coupling error.")
@click.option("--stage", help="Another STAGE than the scene's; with --fmu the one that the FMU must be of.")
@quantity("--step", "Another communication step than the scene's: 20 us for spectra.")
@quantity("--torque", 'Another torque on the input than the scene\'s, "302 N*m".')
@quantity("--speed", 'Another speed of the input at the start, "2000 rpm".')
@level_option
@click.option(
    "--list", is_flag=True, is_eager=True, expose_value=False, callback=_list, help="List the shipped scenes."
)
def run(scene: str | None, out: Path | None, stage: str | None, **how: Any) -> int:
    """Run SCENE and write trace.h5, summary.json and report.html."""
    changed = {key: how.pop(key) for key in ("torque", "speed", "level", "step")}
    if how["fmu_path"] is not None and how["unit"] == "kernel":
        raise click.UsageError("--fmu is run as an FMU: leave --unit kernel away")
    unit = how["fmu_path"] or how["unit"]
    if how["plan_path"] is not None:
        if scene is not None or stage is not None or how["verify"] or set(changed.values()) != {None}:
            remedy = "--plan names scene, stage, load, level and step itself, and verifies by spot checks: give none"
            raise click.UsageError(remedy)
        return run_plan(how["plan_path"], out, unit)
    if scene is None:
        raise click.UsageError("name a SCENE, or a plan with --plan")
    spec = changed_scene(scene, **changed)
    return run_scene(spec, out or Path("out") / spec.name, stage=stage, unit=unit, verify=how["verify"])


@click.command()
@click.argument("stage", shell_complete=stage_names)
@quantity("--torque", 'Torque on the input, "302 N*m".')
@quantity("--speed", 'Speed of the input, "2000 rpm".')
@quantity(
    "--end-speed",
    'A run-up (or run-down) to this speed, "6000 rpm", at a constant rate: order maps and levels over the speed.',
    "speed",
)
@click.option(
    "--profile",
    type=FILE,
    help="A CSV file of torque, speed or both over time, in place of the options: time_[s],torque_[N*m],speed_[rpm].",
)
@quantity("--duration", "Simulated time; 0.1 s or that of the profile when not given.")
@quantity("--step", "Time between samples.", default="20 us", show_default=True)
@quantity("--settle", "From here on results and spectra are taken.", "time", default="0.02 s", show_default=True)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="A parameter of docs/variables.md: level=fast, slices=10; may repeat.",
)
@level_option
@click.option(
    "--out", type=FOLDER, help="Folder of trace.h5, summary.json and report.html; out/<stage> when not given."
)
def simulate(stage: str, out: Path | None, settings: tuple[str, ...], profile: Path | None, **drive: Any) -> int:
    """Run STAGE alone: the outer ends of input and output turn at constant speed, from one to another or along a
    profile, wound up by the torque."""
    from gearfmu.commands.models import model_of, parameters
    from gearfmu.stage.run.steady import LoadCase, steady_run
    from gearfmu.stagefile.tables.profile import read_profile

    level = drive.pop("level")
    settings = (*settings, f"level={level}") if level else settings
    if profile is None and (missing := [f"--{name}" for name in ("torque", "speed") if drive[name] is None]):
        raise click.UsageError(f"give {' and '.join(missing)}, or a --profile")
    driven = LoadCase(**drive, profile=None if profile is None else read_profile(profile))
    model = model_of(stage)
    with progress_bar(model.name) as progress:
        trace = steady_run(model, driven, parameters(model, settings), progress)
    trace.meta["stage"] = stage
    return finish(trace, out or Path("out") / model.name, stage)


@click.command()
@click.option("--out", type=FOLDER, default=Path("out/demo"), show_default=True, help="Folder of the results.")
def demo(out: Path) -> int:
    """Clutch closure on the shipped stage fzg_c through its exported FMU; ends with a report.

    It is `gearfmu run clutch_closure --step "20 us"`: so finely sampled its spectra are right up to 16 kHz.
    """
    from gearfmu.scenefile.scene import load_scene

    return run_scene(load_scene("clutch_closure").with_coupling(step=DEMO_STEP), out, unit="fmu")


@click.command()
@click.argument("path", type=PATH, metavar="FOLDER")
@click.option("--stage", help="STAGE of the run; the one it names when not given.")
@click.option("--out", type=FOLDER, help="Folder of the files; FOLDER/deformation when not given.")
def deformed(path: Path, stage: str | None, out: Path | None) -> None:
    """Write the gears that a run recorded deformed, FOLDER/deformation.h5, as .vtu with a .pvd for ParaView."""
    from gearfmu.api.results import stage_and_bodies
    from gearfmu.stage.run.deformation import FILE_NAME, Deformation

    found = Deformation.load(path / FILE_NAME if path.is_dir() else path)
    home = path if path.is_dir() else path.parent
    own = stage_and_bodies(found.meta, stage)
    for written in write_deformed(found, out or home / "deformation", *own):
        click.echo(written)


@click.command()
@click.argument("path", type=PATH, metavar="TRACE")
@click.option("--stage", help="STAGE of the run, for the deformed gears.")
@click.option("--out", type=FOLDER, help="Folder of the report; that of the trace when not given.")
def report(path: Path, stage: str | None, out: Path | None) -> None:
    """Write the report of a trace (the file, or the folder that holds trace.h5) again."""
    from gearfmu.api.results import trace_file, write_report

    source = trace_file(path)
    click.echo(write_report(source, out or source.parent, stage, source.parent, _tell))


@click.command()
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path, exists=True), metavar="TRACE…")
@click.option("--out", type=FILE, help="The page; comparison.html by default.")
@click.option("--name", "names", multiple=True, help="Name of a trace on the page; once for each.")
def compare(paths: tuple[Path, ...], out: Path | None, names: tuple[str, ...]) -> None:
    """Compare two or more traces (files, or folders that hold trace.h5) with the first of them, in one page."""
    from gearfmu.api.results import compare as write

    if names and len(set(names)) != len(paths):
        raise click.BadParameter(f"{len(paths)} traces need as many different names", param_hint="--name")
    click.echo(write(dict(zip(names, paths, strict=True)) if names else paths, out or Path("comparison.html")))


def changed_scene(scene: str, step: float | None = None, **others: object) -> SceneSpec:
    """The SceneSpec of SCENE with another communication step (s), torque, speed, level or stage where one is given."""
    from gearfmu.scenefile.scene import load_scene

    keys = {"level": "stage.level", "stage": "stage.name"}
    changes = {keys.get(key, key): value for key, value in others.items() if value is not None}
    spec = load_scene(scene, changes)
    return spec if step is None else spec.with_coupling(step=step)


def run_scene(scene: SceneSpec, out: Path, **options: Any) -> int:
    """Run the SceneSpec, write everything into `out`, print the outcome; 0 when the run reached its end, else 1."""
    from gearfmu.api.results import recorded_deformation, stage_and_bodies
    from gearfmu.api.runs import run as run_it
    from gearfmu.errors import GearfmuError

    begin = process_time()
    with progress_bar(scene.name) as progress:
        trace = run_it(scene, out, progress=progress, **options)
    prepared = process_time() - begin - trace.meta["cpu_s"]
    if scene.deformation is not None and scene.deformation.vtu:
        found = recorded_deformation(trace, out)
        assert found is not None
        try:
            for path in write_deformed(found, out / "deformation", *stage_and_bodies(trace.meta)):
                click.echo(path)
        except GearfmuError as error:
            _tell(f"no .vtu of the deformed gears: {error}")
    return finish(trace, out, None, prepared)


def run_plan(path: Path, out: Path | None, unit: str | Path) -> int:
    """Run a plan.toml, print its outcome; 0 when the run reached its end, else 1."""
    from gearfmu.api.plans import run_plan as run_it
    from gearfmu.planning.book import Plan
    from gearfmu.planning.table import run_text

    plan = Plan.load(path)
    folder = out or Path("out") / Path(plan.scene).stem
    with progress_bar(plan.scene) as progress:
        trace = run_it(plan, folder, progress, unit)
    click.echo(run_text(trace.meta["plan"]))
    return finish(trace, folder, None)


def finish(trace: Trace, out: Path, stage: str | None, prepared: float | None = None) -> int:
    """Write trace.h5 and the report into `out` and print the outcome and the price; 0 when the run reached its end,
    else 1. stage : as of `api.write_report`. prepared : processor time (s) of the work around the simulation, to be
    shown."""
    from gearfmu.api.results import write_report
    from gearfmu.report.results import REACHED_THE_END

    begin = process_time()
    trace.save(out / "trace.h5")
    page = write_report(trace, out, stage, tell=_tell)
    meta, reported = trace.meta, process_time() - begin
    click.echo(
        f"{meta['outcome']}: {meta['simulated_s']:.4g} s simulated in {meta['cpu_s']:.3g} s CPU time "
        f"({meta['realtime_factor']:.3g} per simulated second)"
    )
    if prepared is not None:
        parts = {"model, FMU and start": prepared, "simulation": meta["cpu_s"], "report": reported}
        click.echo(f"CPU time: {', '.join(f'{name} {value:.3g} s' for name, value in parts.items())}")
    for text in meta.get("warnings") or ():
        click.echo(f"warning: {text}", err=True)
    click.echo(page)
    return 0 if meta["outcome"] in REACHED_THE_END else 1


def write_deformed(deformation: Deformation, folder: Path, spec: Stage, reduced: Sequence[Body]) -> list[Path]:
    """.vtu files of every gear of a Deformation in `folder`; the paths of their .pvd. spec, reduced : the stage and its
    bodies."""
    from gearfmu.modes.deformed import deformed_gear
    from gearfmu.modes.vtu import write_series
    from gearfmu.stage.assembly.meshes import tooth_phases
    from gearfmu.stage.assembly.observed import gear_bodies

    bodies = gear_bodies(spec, reduced)
    phases = tooth_phases(spec)
    gears = [deformed_gear(name, bodies[name], motion, phases[name]) for name, motion in deformation.gears.items()]
    return [write_series(gear, deformation.time, folder) for gear in gears]


def _tell(text: str) -> None:
    click.echo(f"gearfmu: {text}", err=True)
