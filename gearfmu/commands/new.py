"""The verb new: a stage file from a shipped one, from gear data of a REXS file, or from a few numbers."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import click

from gearfmu.commands.shared import PATH, Quantity, echo_pairs, quantity

_WHOLE = re.compile(r"[+-]?\d+$")


class _WithTeeth(click.Command):
    """Takes `--teeth 31 73`: all whole numbers that follow are the option's value."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does, with those numbers as one word."""
        if "--teeth" in args:
            first = args.index("--teeth") + 1
            last = first
            while last < len(args) and _WHOLE.match(args[last]):
                last += 1
            args = [*args[:first], " ".join(args[first:last]), *args[last:]] if last > first else args
        return super().parse_args(ctx, args)


class _Teeth(click.ParamType):
    """Whole numbers as one word, "31 73" or "31/73"."""

    name = "Z Z [Z]"

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """As it is written."""
        return self.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, ...]:
        """The numbers; a usage error where they are none."""
        if isinstance(value, tuple):
            return value
        words = re.split(r"[\s/,]+", value.strip())
        if not all(_WHOLE.match(word) for word in words):
            self.fail(f'"{value}": whole numbers, such as --teeth 31 73', param, ctx)
        return tuple(int(word) for word in words)


@click.command(cls=_WithTeeth)
@click.argument("name")
@click.option("--like", metavar="STAGE", help="Shipped stage to start from.  [default: fzg_c]")
@click.option("--rexs", type=PATH, metavar="FILE", help="Gear data from a REXS file (.rexs, .rexsz).")
@click.option("--stage", default="", metavar="ID", help="With --rexs: identifier or name of one of several stages.")
@click.option("--teeth", type=_Teeth(), help="Of pinion and wheel; with --planets of sun, planet and ring.")
@click.option("--planets", type=int, metavar="N", help="A planetary set with so many planets.")
@click.option("--unequal", is_flag=True, help="Planets at the places nearest to even ones at which teeth fit.")
@quantity("--module", 'Normal module: "2.5 mm".')
@click.option("--diametral-pitch", type=float, metavar="P", help="In place of --module: teeth per inch, 25.4 mm/m_n.")
@quantity("--width", 'Common face width: "30 mm".', "face_width")
@quantity("--center", "Centre distance; without it one is proposed.", "center_distance")
@quantity("--helix", 'Helix angle of pinion or sun: "22 deg".', "helix_angle")
@quantity("--pressure-angle", "Normal pressure angle, 20 deg without it.", "pressure_angle")
@click.option("--shift", "shifts", multiple=True, type=float, metavar="X",
              help="Profile shift; twice, of pinion and wheel or of sun and planet.")  # fmt: skip
@click.option("--bore", "bores", multiple=True, type=Quantity("bore"), help='Bore diameter, "30 mm"; twice, likewise.')
@quantity("--relief", 'Tip relief of these gears: "20 um", parabolic.')
@quantity("--torque", "Largest torque of the pinion or the carrier.", "torque_max")
@quantity("--speed", "Largest speed of the pinion or the carrier.", "speed_max")
def new(name: str, like: str | None, rexs: Path | None, stage: str, **numbers: object) -> int:
    """Write NAME/stage.toml, every field commented: from numbers of teeth, module and face width with everything else
    proposed and marked so, from gear data of a REXS file, or as a copy of a shipped stage. Never overwrites."""
    from gearfmu.stagefile.proposals.new import new_stage

    given = {key: value for key, value in numbers.items() if value not in (None, False, ())}
    forms = [word for word, there in (("--like", like), ("--rexs", rexs), ("--teeth", given)) if there]
    if len(forms) > 1:
        raise click.UsageError(f"{' and '.join(forms)} are different ways to begin: choose one")
    if given:
        return _new_from_numbers(name, given)
    if rexs is not None:
        return _new_from_rexs(name, rexs, stage)
    path = new_stage(name, like or "fzg_c")
    click.echo(f"{path}\nNext: edit it, then 'gearfmu reduce {path}' and 'gearfmu export {path}'.")
    return 0


def _new_from_numbers(name: str, given: dict[str, Any]) -> int:
    """The stage file of teeth, module and width, and the shape that it proposes."""
    from gearfmu.stagefile.forms.shapes import centre_distance
    from gearfmu.stagefile.proposals.numbers import new_from_numbers, wish_of
    from gearfmu.stagefile.stage import load_stage

    path = new_from_numbers(name, wish_of(given))
    stage = load_stage(path)
    mesh, gears = stage.engagements[0], stage.gears
    (torque, _), (speed, _) = stage.limits
    assert torque is not None and speed is not None
    shape = {
        "centre distance": f"{1e3 * centre_distance(stage, mesh):.6g} mm",
        "profile shifts": ", ".join(f"{gear.profile_shift:.4f}" for gear in gears),
        "tip diameters": ", ".join(f"{1e3 * gear.tip_diameter:.6g}" for gear in gears) + " mm",
        "backlash": f"{1e3 * mesh.backlash:.4g} mm",
        "torque_max": f"{torque:.4g} N*m",
        "speed_max": f"{30 / math.pi * speed:.4g} rpm",
    }
    click.echo(f"{path}\nproposed, like everything that is marked so in the file, with the rule behind it:")
    echo_pairs(shape, "  ")
    home = path.parent
    click.echo(f"Next: 'gearfmu inspect {home}', then 'gearfmu reduce {home} --coarse' or 'gearfmu reduce {home}'.")
    return 0


def _new_from_rexs(name: str, rexs: Path, stage: str) -> int:
    """The stage file of a REXS file, and what of it was assumed or left unread (also as a table beside it)."""
    import numpy as np

    from gearfmu.errors import SpecError
    from gearfmu.rexs.stage import draft_from_rexs
    from gearfmu.stage.run.trace import write_columns
    from gearfmu.stagefile.proposals.new import write_drafted
    from gearfmu.stagefile.stage import load_stage

    draft = draft_from_rexs(rexs, stage)
    path = write_drafted(name, draft.tables, draft.marks, f"read from the REXS file {rexs.name}")
    table = path.with_name("rexs_unread.csv")
    names = ("component", "attribute", "value", "unit")
    write_columns(table, {n: np.array([getattr(entry, n) for entry in draft.unread], dtype=object) for n in names})
    click.echo(f"{path}\nassumed, because the file does not say it:")
    echo_pairs({place: mark.removeprefix("assumed: ") for place, mark in draft.assumptions().items()}, "  ")
    click.echo(f"  everything else that is marked so in the file: as in {draft.like}")
    for note in draft.notes:
        click.echo(f"note: {note}")
    click.echo(f"not used: {len(draft.unread)} attributes of {rexs.name}, listed in {table}")
    try:
        load_stage(path)
    except SpecError as error:
        click.echo(f"The file is written but is no valid stage yet:\n{error}", err=True)
        return 1
    click.echo(f"Next: edit it, then 'gearfmu reduce {path}'.")
    return 0
