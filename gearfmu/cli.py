"""The command line. Verbs are loaded when they are called, so that help and errors come without delay."""

from __future__ import annotations

import importlib
import os
import sys
import traceback
from collections.abc import Sequence
from difflib import get_close_matches

import click

from gearfmu.commands.console import write_plainly

USAGE_ERROR = 100
# Matrices here are many and small: BLAS threads slow a reduction down, on a busy machine from 15 s to minutes. What the
# caller sets wins.
for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")
VERBS = {
    "new": ("gearfmu.commands.new:new", "Write a commented stage.toml of your own, from a few numbers."),
    "mesh": ("gearfmu.commands.stages:mesh", "Mesh the gears of a stage, print the quality, write .vtu files."),
    "reduce": (
        "gearfmu.commands.stages:reduce",
        "Reduce the gears of a stage to .h5 bodies (skipped when up to date).",
    ),
    "import": (
        "gearfmu.commands.stages:import_",
        "Check finite elements made elsewhere, fit the involutes; writes nothing.",
    ),
    "te": (
        "gearfmu.commands.te:te",
        "Quasi-static loaded transmission error, load shares, stiffness of mesh and stage.",
    ),
    "efficiency": ("gearfmu.commands.te:efficiency", "Loss of every mesh to friction of its flanks."),
    "bearings": (
        "gearfmu.commands.te:bearings",
        "Rolling bearings under load: forces, contact pressure, stiffness, ball pass.",
    ),
    "modes": ("gearfmu.commands.modes:modes", "Modes of a body: frequencies, nodal diameters, pictures, .vtu files."),
    "frf": ("gearfmu.commands.frf:frf", "Reduction of a body judged by its transfer matrix."),
    "export": ("gearfmu.commands.fmus:export", "Export a stage as an FMU."),
    "validate": ("gearfmu.commands.fmus:validate", "Check an FMU; lists all problems, exit code = their number."),
    "run": ("gearfmu.commands.runs:run", "Run a scene: trace.h5, summary.json, report.html."),
    "simulate": ("gearfmu.commands.runs:simulate", "Run a stage alone, without FMU and drivetrain."),
    "house": ("gearfmu.commands.sound:house", "Put a housing under a finished run: sensors, mounts."),
    "sound": ("gearfmu.commands.sound:sound", "Sound power of a housing: third octaves, dB, dB(A)."),
    "paths": ("gearfmu.commands.sound:paths", "Share of every bearing direction at a sensor of a housing."),
    "report": ("gearfmu.commands.runs:report", "Write the report of a trace again."),
    "compare": ("gearfmu.commands.runs:compare", "Compare two or more traces in one page."),
    "sweep": ("gearfmu.commands.sweep:sweep", "Run a scene or a stage at many points: one table, pictures."),
    "plan": ("gearfmu.commands.sweep:plan", "Effects, level and step of a scene by an error budget: plan.toml."),
    "convert": ("gearfmu.commands.files:convert", "Write a trace as CSV, MATLAB, Parquet or UFF58 file."),
    "deformed": ("gearfmu.commands.runs:deformed", "Gears that a run recorded deformed, as .vtu for ParaView."),
    "demo": ("gearfmu.commands.runs:demo", "Clutch closure on a shipped stage, through its FMU."),
    "study": ("gearfmu.commands.sweep:study", "Error against processor time of the fidelity levels."),
    "effects": ("gearfmu.commands.effects:effects", "Effects: price of each, how to switch it."),
    "inspect": ("gearfmu.commands.files:inspect", "Show the contents of a stage, scene, body, trace or FMU."),
    "schema": ("gearfmu.commands.files:schema", "JSON schema of stage or scene files."),
}


class Verbs(click.Group):
    """A group that lists its commands by name and imports one only to run it."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in VERBS:
            return None
        module, function = VERBS[name][0].split(":")
        return getattr(importlib.import_module(module), function)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, with the nearest verbs for one that there is not."""
        if args and args[0] not in VERBS and not args[0].startswith("-"):
            near = get_close_matches(args[0], VERBS, n=2, cutoff=0.6)
            meant = f"; did you mean {' or '.join(near)}?" if near else ""
            raise click.UsageError(f"there is no verb '{args[0]}'{meant}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl([(name, text) for name, (_, text) in VERBS.items()])


@click.group(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="gearfmu")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def gearfmu(debug: bool) -> None:
    """Elastic gear stages as FMUs.

    STAGE is the path of a stage.toml or its folder, or the name of a shipped one (fzg_c, fzg_c/stage_relief); SCENE the
    path of a scene.toml or the name of a shipped one (clutch_closure, clutch_dump, pair_loaded, pair_light).
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point: runs the verb and ends the process with its exit code (docs/howto-command-line.md)."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    sys.exit(outcome(given))


def outcome(arguments: list[str]) -> int:
    """Run the command line `arguments` and return the exit code: 0 success, 100 wrong usage, 1 any other error,
    130 interrupted; counting verbs return their count, at most 99. Errors go to standard error, one clear message
    each."""
    write_plainly()
    try:
        code = gearfmu.main(args=arguments, prog_name="gearfmu", standalone_mode=False)
    except click.UsageError as error:
        error.show()
        return USAGE_ERROR
    except click.exceptions.Exit as error:
        return int(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        click.echo("gearfmu: interrupted; files that were being written are as they were before", err=True)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:  # the border to the user: everything becomes one message
        return _failed(error, debug="--debug" in arguments)
    return code if isinstance(code, int) else 0


def _failed(error: Exception, debug: bool) -> int:
    from gearfmu.errors import GearfmuError

    if debug:
        traceback.print_exception(error)
    if isinstance(error, (GearfmuError, click.ClickException)):
        text = error.message if isinstance(error, click.ClickException) else str(error)
    elif isinstance(error, OSError):
        text = f"{f'{error.filename}: ' if error.filename else ''}{error.strerror or error}"
    else:
        text = f"internal error, {type(error).__name__}: {error}; please report it with the output of --debug"
    click.echo(f"gearfmu: {text}", err=True)
    return 1


if __name__ == "__main__":
    main()
