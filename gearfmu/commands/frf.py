"""The verb frf: a body of a stage, reduced, judged by its transfer matrix."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from gearfmu.commands.shared import FOLDER, Quantity, stage_names

if TYPE_CHECKING:
    from gearfmu.reduction.full_order import FullOrder
    from gearfmu.reduction.transfer import Judgement, Reference, Trial

GIVEN = ("size", "band", "damping", "lines", "free", "scale")
HEADER = ("method", "n", "max error", "at Hz", "median", "+ residual", "CPU s")


@click.command()
@click.argument("stage", shell_complete=stage_names)
@click.argument("body")
@click.option(
    "--methods",
    default="modal,craig_bampton,rubin,krylov",
    show_default=True,
    help="Methods, comma-separated: those of a carrier's stage file; 'krylov:240' has a size of its own.",
)
@click.option("--size", type=click.IntRange(1), default=120, show_default=True, help="Vectors n, rigid modes aside.")
@click.option(
    "--band",
    nargs=2,
    type=Quantity("frequency"),
    default=(50.0, 10e3),
    show_default="50 Hz to 10 kHz",
    help="From, to.",
)
@click.option(
    "--damping", type=click.FloatRange(0), default=0.01, show_default=True, help="Damping ratio of both models."
)
@click.option("--lines", type=click.IntRange(2), default=400, show_default=True, help="Logarithmically spaced lines.")
@click.option("--free/--held", default=False, help="Reduce the free body (as the kernel takes it) or, as the paper, "
              "with its ground held; judged with the ground held either way.  [default: held]")  # fmt: skip
@click.option("--scale", type=click.FloatRange(0.05, 4), help="Factor on the element counts of the stage.")
@click.option("--out", type=FOLDER, required=True, help="Folder of results.")
def frf(stage: str, body: str, **options: Any) -> None:
    """Relative error of the transfer matrix (Frobenius norm) of BODY of STAGE, reduced by several methods.

    Prints a table, writes <body>_frf.csv (method, n, frequency_Hz, error), a chart, and the transfer matrices
    themselves: <body>_H.npz for numpy.load.
    """
    from gearfmu.api.bodies import frf as judge

    methods, sized = options["methods"].split(","), {key: options[key] for key in GIVEN}
    found = judge(stage, body, methods, **sized)
    full, exact, trials = found.full, found.exact, found.trials
    how = f"rotations times {1e3 * full.length:.4g} mm, {100 * options['damping']:g} % damping"
    click.echo(f"{body}: {full.size} unknowns, {len(exact.labels)} inputs, {_ground(full, options)}, {how}")
    for line in [*_table(found), *_shortfalls(trials, methods, options["size"])]:
        click.echo(line)
    click.echo(f"reference: {exact.size} vectors, last change {exact.change:.1e}")
    path = _write_matrices(found, options["out"] / f"{body}_H.npz")
    written = _write(exact, trials, options["out"] / f"{body}_frf", f"{body}, {_ground(full, options)}")
    click.echo(", ".join(map(str, [*written, path])))


def _table(found: Judgement) -> list[str]:
    """The trials as lines of text."""
    rows: list[tuple[str, ...]] = [HEADER]
    for t in found.trials:
        errors = (f"{np.median(t.error):.1e}", f"{t.mended.max():.1e}", f"{t.seconds:.1f}")
        at = f"{found.frequency[t.error.argmax()]:.0f}"
        rows.append((t.method, str(t.size), f"{t.error.max():.1e}", at, *errors))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(text.rjust(w) for text, w in zip(row, widths, strict=True)) for row in rows]


def _shortfalls(trials: Sequence[Trial], methods: Sequence[str], size: int) -> list[str]:
    """Trials, in the order of their methods, that have fewer vectors than were asked for."""
    return [
        f"{t.method} has {t.size} vectors where {count} were asked for: it takes "
        + ("whole blocks of one vector per input" if t.method == "krylov" else "what there is")
        + f"; a method of the same size is rubin:{t.size}"
        for t, method in zip(trials, methods, strict=True)
        if t.size < (count := int(method.partition(":")[2] or size))
    ]


def _write(exact: Reference, trials: Sequence[Trial], base: Path, title: str) -> list[Path]:
    """The CSV file (`method,n,frequency_Hz,error`) and the chart at `base` with their suffixes."""
    from gearfmu.files import write_text
    from gearfmu.report.frf import error_curves, write_error_chart

    path = base.with_suffix(".csv")
    table, curves = error_curves(exact, [(t.method, t.size, t.error) for t in trials])
    write_text(path, table)
    return [path, *write_error_chart(curves, base, title)]


def _write_matrices(found: Judgement, path: Path) -> Path:
    """The transfer matrices as <path>.npz: frequency_Hz (F,), rows (m,) "bolt0.ux", length_m by which rotations are
    multiplied and moments divided, H_reference (F, m, m) and H_<method>_<n>, all in m/N; complex."""
    from gearfmu.files import written_whole

    matrices: dict[str, Any] = {f"H_{t.method}_{t.size}": t.matrix for t in found.trials}
    with written_whole(path) as temporary:
        np.savez_compressed(temporary, frequency_Hz=found.frequency, rows=np.array(found.rows),
                            length_m=found.full.length, H_reference=found.exact.matrix, **matrices)  # fmt: skip
    return path


def _ground(full: FullOrder, options: dict[str, Any]) -> str:
    if options["free"] and full.ground:
        return f"reduced free, judged with {', '.join(full.ground)} held"
    if full.constraints is not None:
        return "held at its ground"
    return "free" if full.rigid.size else "on its own mounts"
