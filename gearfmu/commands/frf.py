"""The verb frf: a body of a stage, reduced, judged by its transfer matrix."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from gearfmu.commands.shared import Quantity, stage_names

if TYPE_CHECKING:
    from gearfmu.reduction.basis import Size
    from gearfmu.reduction.full_order import FullOrder
    from gearfmu.reduction.transfer import Judging, Reference

HEADER = ("method", "n", "max error", "at Hz", "median", "+ residual", "CPU s")


@dataclass(frozen=True)
class Trial:
    """A method on the body: matrix (F, m, m) of the oscillators alone, error (F,) of it, mended (F,) with the static
    residual, seconds of processor time beyond what methods before it had made."""

    method: str
    size: int
    matrix: np.ndarray
    error: np.ndarray
    mended: np.ndarray
    seconds: float


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
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), required=True, help="Folder of results.")
def frf(stage: str, body: str, **options: Any) -> None:
    """Relative error of the transfer matrix (Frobenius norm) of BODY of STAGE, reduced by several methods.

    Prints a table, writes <body>_frf.csv (method, n, frequency_Hz, error), a chart, and the transfer matrices
    themselves: <body>_H.npz for numpy.load.
    """
    from gearfmu.reduction.transfer import Judging, reference

    entries = _entries(options)
    full = full_order_of(stage, body, options["scale"])
    full = full if options["free"] else full.grounded()
    judging = Judging.over(tuple(options["band"]), options["lines"], options["damping"])
    exact = reference(full, judging)
    trials = [_tried(full, exact, judging, *entry) for entry in entries]
    how = f"rotations times {1e3 * full.length:.4g} mm, {100 * options['damping']:g} % damping"
    click.echo(f"{body}: {full.size} unknowns, {len(exact.labels)} inputs, {_ground(full, options)}, {how}")
    for line in [*_table(trials, judging), *_shortfalls(trials, entries)]:
        click.echo(line)
    click.echo(f"reference: {exact.size} vectors, last change {exact.change:.1e}")
    path = _write_matrices(full, exact, trials, options["out"] / f"{body}_H.npz")
    written = _write(exact, trials, options["out"] / f"{body}_frf", f"{body}, {_ground(full, options)}")
    click.echo(", ".join(map(str, [*written, path])))


def full_order_of(stage: str, body: str, scale: float | None = None) -> FullOrder:
    """The FullOrder of a body of STAGE: gear, ring or carrier; a usage error for a body it does not have."""
    from gearfmu.spec.forms.members import body_names, members
    from gearfmu.spec.stage import load_stage

    spec = load_stage(stage)
    factor: dict[str, Any] = {} if scale is None else {"scale": scale}
    toothed, names = members(spec), body_names(spec)
    if body not in names:
        raise click.BadParameter(f"no body '{body}'; the stage has {', '.join(names)}", param_hint="BODY")
    from gearfmu.body.imported import imported_full_order
    from gearfmu.reduction.carrier import carrier_full_order
    from gearfmu.reduction.toothed import gear_full_order, ring_full_order

    imported = toothed[body].gear.imported if body in toothed else spec.carrier.imported
    if imported is not None and scale is not None:
        remedy = f"the finite elements of '{body}' are yours: coarsen your mesh, or leave --scale away"
        raise click.BadParameter(remedy, param_hint="--scale")
    if body not in toothed:
        return carrier_full_order(spec, **factor)
    if imported is not None:
        return imported_full_order(toothed[body])
    if toothed[body].gear.kind == "ring":
        return ring_full_order(spec, name=body, **factor)
    return gear_full_order(spec, body, **factor)


def _tried(full: FullOrder, exact: Reference, judging: Judging, method: str, size: Size) -> Trial:
    from gearfmu.reduction.methods import METHODS
    from gearfmu.reduction.oscillators import oscillators
    from gearfmu.reduction.transfer import relative_error, transfer

    clock = time.process_time()
    model = oscillators(full, METHODS[method](full, size), judging.damping_ratio)
    seconds = time.process_time() - clock
    matrix = transfer(model, judging, full.ground)
    mended = transfer(model, judging, full.ground, residual=True)
    errors = relative_error(exact.matrix, matrix), relative_error(exact.matrix, mended)
    return Trial(method, model.size, matrix, *errors, seconds)


def _table(trials: Sequence[Trial], judging: Judging) -> list[str]:
    """The trials as lines of text."""
    rows: list[tuple[str, ...]] = [HEADER]
    for t in trials:
        errors = (f"{np.median(t.error):.1e}", f"{t.mended.max():.1e}", f"{t.seconds:.1f}")
        at = f"{judging.frequency[t.error.argmax()]:.0f}"
        rows.append((t.method, str(t.size), f"{t.error.max():.1e}", at, *errors))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(text.rjust(w) for text, w in zip(row, widths, strict=True)) for row in rows]


def _shortfalls(trials: Sequence[Trial], entries: Sequence[tuple[str, Size]]) -> list[str]:
    """Trials, in the order of their entries, that have fewer vectors than were asked for."""
    return [
        f"{t.method} has {t.size} vectors where {size.count} were asked for: it takes "
        + ("whole blocks of one vector per input" if t.method == "krylov" else "what there is")
        + f"; a method of the same size is rubin:{t.size}"
        for t, (_, size) in zip(trials, entries, strict=True)
        if t.size < size.count
    ]


def _write(exact: Reference, trials: Sequence[Trial], base: Path, title: str) -> list[Path]:
    """The CSV file (`method,n,frequency_Hz,error`) and the chart at `base` with their suffixes."""
    from gearfmu.files import write_text
    from gearfmu.report.frf import error_curves, write_error_chart

    path = base.with_suffix(".csv")
    table, curves = error_curves(exact, [(t.method, t.size, t.error) for t in trials])
    write_text(path, table)
    return [path, *write_error_chart(curves, base, title)]


def _write_matrices(full: FullOrder, exact: Reference, trials: Sequence[Trial], path: Path) -> Path:
    """The transfer matrices as <path>.npz: frequency_Hz (F,), rows (m,) "bolt0.ux", length_m by which rotations are
    multiplied and moments divided, H_reference (F, m, m) and H_<method>_<n>, all in m/N; complex."""
    from gearfmu.files import written_whole

    matrices: dict[str, Any] = {f"H_{t.method}_{t.size}": t.matrix for t in trials}
    rows = np.array([".".join(label) for label in exact.labels])
    with written_whole(path) as temporary:
        np.savez_compressed(temporary, frequency_Hz=exact.judging.frequency, rows=rows, length_m=full.length,
                            H_reference=exact.matrix, **matrices)  # fmt: skip
    return path


def _entries(options: dict[str, Any]) -> list[tuple[str, Size]]:
    from gearfmu.reduction.basis import Size
    from gearfmu.reduction.methods import METHODS

    entries = []
    for text in options["methods"].split(","):
        name, _, own = text.strip().partition(":")
        if name not in METHODS or (own and not own.isdigit()):
            raise click.BadParameter(
                f"'{text.strip()}' is no method; there are {', '.join(METHODS)}, each with ':n' behind it for a size",
                param_hint="--methods",
            )
        entries.append((name, Size(int(own or options["size"]), tuple(options["band"]))))
    return entries


def _ground(full: FullOrder, options: dict[str, Any]) -> str:
    if options["free"] and full.ground:
        return f"reduced free, judged with {', '.join(full.ground)} held"
    if full.constraints is not None:
        return "held at its ground"
    return "free" if full.rigid.size else "on its own mounts"
