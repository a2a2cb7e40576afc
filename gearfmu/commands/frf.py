"""The verb frf: reduction methods judged by the transfer matrix of a body."""

from __future__ import annotations

import fnmatch
import os
import tracemalloc
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from gearfmu.commands.models import by_text
from gearfmu.commands.shared import Quantity, progress_bar, stage_names

if TYPE_CHECKING:
    from gearfmu.reduction.comparison import Contest
    from gearfmu.reduction.full_order import FullOrder

HEADER = ("method", "n", "max error", "at Hz", "median", "+ residual", "loaded", "CPU s", "memory MB")


@click.command()
@click.argument("stage", shell_complete=stage_names)
@click.argument("body")
@click.option(
    "--methods",
    default="modal,craig_bampton,rubin,krylov",
    show_default=True,
    help="Methods, comma-separated: modal, craig_bampton, rubin, krylov, static, snapshots; 'krylov:240' has a size of "
    "its own.",
)
@click.option("--size", type=click.IntRange(1), default=120, show_default=True, help="Vectors n, rigid modes aside.")
@click.option("--tolerance", type=float, help="Instead of --size: the largest relative error allowed over the band.")
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
@click.option("--loaded", help="Rows that are really loaded, as patterns: 'bolt*.ux,bolt*.uy'; judged once more alone.")
@click.option("--scale", type=click.FloatRange(0.05, 4), help="Factor on the element counts of the stage.")
@click.option("--jobs", type=click.IntRange(1, 64), default=min(os.cpu_count() or 1, 3), show_default="cores, up to 3",
              help="Processes (one where the system cannot fork).")  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), required=True, help="Folder of results.")
def frf(stage: str, body: str, **options: Any) -> None:
    """Relative error of the transfer matrix (Frobenius norm) of BODY of STAGE, reduced by several methods.

    Prints a table, writes <body>_frf.csv (method, n, frequency_Hz, error), a chart, and the transfer matrices
    themselves: <body>_H.npz for numpy.load.
    """
    entries = _entries(options)
    full = full_order_of(stage, body, options["scale"])
    full = full if options["free"] else full.grounded()
    contest = _contest(full, entries, options)
    from gearfmu.reduction.comparison import compare

    tracemalloc.start()
    with progress_bar(body) as progress:
        found = compare(full, contest, by_text(progress), options["jobs"])
    tracemalloc.stop()
    how = f"rotations times {1e3 * full.length:.4g} mm, {100 * options['damping']:g} % damping"
    inputs = len(found.reference.labels)
    click.echo(f"{body}: {full.size} unknowns, {inputs} inputs, {_ground(full, options)}, {how}")
    for line in table(found.trials, contest):
        click.echo(line)
    for line in shortfalls(found.trials, entries):
        click.echo(line)
    click.echo(f"reference: {found.reference.size} vectors, last change {found.reference.change:.1e}, "
               f"{found.reference_seconds:.1f} s; all {found.seconds:.1f} s of processor time")  # fmt: skip
    path = write_matrices(full, found, contest.judging, options["out"] / f"{body}_H.npz")
    written = write(found, contest, options["out"] / f"{body}_frf", f"{body}, {_ground(full, options)}")
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


def table(trials: Sequence[Any], contest: Any) -> list[str]:
    """The trials as lines of text."""
    rows: list[tuple[str, ...]] = [HEADER]
    for t in trials:
        worst = contest.judging.frequency[t.error.argmax()]
        errors = (f"{np.median(t.error):.1e}", f"{t.mended.max():.1e}", f"{t.loaded.max():.1e}")
        cost = (f"{t.seconds:.1f}", f"{1e-6 * t.memory:.0f}")
        rows.append((t.method, str(t.model.size), f"{t.error.max():.1e}", f"{worst:.0f}", *errors, *cost))
    kept = [k for k, name in enumerate(HEADER) if name != "loaded" or contest.loaded is not None]
    widths = [max(len(row[k]) for row in rows) for k in kept]
    return ["  ".join(row[k].rjust(w) for k, w in zip(kept, widths, strict=True)) for row in rows]


def shortfalls(trials: Sequence[Any], entries: Sequence[tuple[str, Any]]) -> list[str]:
    """Trials, in the order of their entries, that have fewer vectors than were asked for."""
    return [
        f"{t.method} has {t.model.size} vectors where {size.count} were asked for: it takes "
        + ("whole blocks of one vector per input" if t.method == "krylov" else "what there is")
        + f"; a method of the same size is rubin:{t.model.size}"
        for t, (_, size) in zip(trials, entries, strict=True)
        if size.count is not None and t.model.size < size.count
    ]


def write(found: Any, contest: Any, base: Path, title: str) -> list[Path]:
    """The CSV file (`method,n,frequency_Hz,error`) and the chart at `base` with their suffixes."""
    from gearfmu.files import write_text
    from gearfmu.report.frf import label_of, write_error_chart

    lines = ["method,n,frequency_Hz,error"]
    curves = {"norm": (contest.judging.frequency, np.linalg.norm(found.reference.matrix, axis=(1, 2)))}
    for t in found.trials:
        pairs = zip(contest.judging.frequency, t.error, strict=True)
        lines += [f"{t.method},{t.model.size},{f:.6g},{e:.4e}" for f, e in pairs]
        curves[f"{label_of(t.method)}, n = {t.model.size}"] = (contest.judging.frequency, t.error)
    path = base.with_suffix(".csv")
    write_text(path, "\n".join(lines) + "\n")
    return [path, *write_error_chart(curves, base, title)]


def write_matrices(full: FullOrder, found: Any, judging: Any, path: Path) -> Path:
    """The transfer matrices as <path>.npz: frequency_Hz (F,), rows (m,) "bolt0.ux", length_m by which rotations are
    multiplied and moments divided, H_reference (F, m, m) and H_<method>_<n>, all in m/N; complex."""
    from gearfmu.files import written_whole
    from gearfmu.reduction.transfer import transfer

    matrices: dict[str, Any] = {
        f"H_{t.method}_{t.model.size}": transfer(t.model, judging, full.ground) for t in found.trials
    }
    rows = np.array([".".join(label) for label in found.reference.labels])
    with written_whole(path) as temporary:
        np.savez_compressed(temporary, frequency_Hz=judging.frequency, rows=rows, length_m=full.length,
                            H_reference=found.reference.matrix, **matrices)  # fmt: skip
    return path


def loaded_rows(labels: Sequence[tuple[str, str]], patterns: str) -> np.ndarray:
    """Indices of the rows "interface.component" that match one of the patterns (comma-separated); a usage error for
    none."""
    wanted = [pattern.strip() for pattern in patterns.split(",")]
    names = [".".join(label) for label in labels]
    found = [k for k, name in enumerate(names) if any(fnmatch.fnmatch(name, pattern) for pattern in wanted)]
    if not found:
        raise click.BadParameter(f"'{patterns}' matches none of {', '.join(names[:8])} …", param_hint="--loaded")
    return np.array(found)


def _contest(full: Any, entries: list[tuple[str, Any]], options: dict[str, Any]) -> Contest:
    from gearfmu.reduction.comparison import Contest
    from gearfmu.reduction.transfer import Judging

    judging = Judging.over(tuple(options["band"]), options["lines"], options["damping"])
    labels = [(i.name, c) for i in full.interfaces if i.name not in full.ground for c in i.components]
    loaded = loaded_rows(labels, options["loaded"]) if options["loaded"] else None
    return Contest(tuple(entries), judging, loaded)


def _entries(options: dict[str, Any]) -> list[tuple[str, Any]]:
    from gearfmu.reduction.basis import Size
    from gearfmu.reduction.methods import METHODS

    band, tolerance = tuple(options["band"]), options["tolerance"]
    general = Size(None if tolerance else options["size"], tolerance, band)
    entries = []
    for text in options["methods"].split(","):
        name, _, own = text.strip().partition(":")
        if name not in METHODS or (own and not own.isdigit()):
            raise click.BadParameter(
                f"'{text.strip()}' is no method; there are {', '.join(METHODS)}, each with ':n' behind it for a size",
                param_hint="--methods",
            )
        entries.append((name, replace(general, count=int(own), tolerance=None) if own else general))
    return entries


def _ground(full: Any, options: dict[str, Any]) -> str:
    if options["free"] and full.ground:
        return f"reduced free, judged with {', '.join(full.ground)} held"
    if full.constraints is not None:
        return "held at its ground"
    return "free" if full.rigid.size else "on its own mounts"
