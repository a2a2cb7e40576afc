"""The page of a sweep: results over the swept keys, transmission errors over one another, points that failed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gearfmu.files import write_text
from gearfmu.report import page
from gearfmu.report.chart import Chart, Curve, Heat, Panel, Plot
from gearfmu.report.metrics import level
from gearfmu.sweeps.charts import MOST_CURVES, at_most, fixed, label_of, numeric_axes, on_grid, ticks_of
from gearfmu.sweeps.table import NO_NUMBERS, SweepTable

GROUPS = (  # part of a column's name, what it is, its unit, whether it is a level
    ("te_pp_um", "Transmission error, peak to peak", "µm", False),
    ("te_rms_ac_um", "Transmission error, alternating", "µm rms", False),
    ("te_mean_um", "Transmission error, mean", "µm", False),
    ("stiffness_mean_N_per_um", "Stiffness", "N/µm", False),
    ("K_gamma", "Mesh load factor K_γ", "", False),
    ("dynamic_factor", "Dynamic factor", "", False),
    ("_rms_ac_N", "Alternating forces", "dB re 1 N", True),
    ("contact_loss_percent", "Teeth apart", "%", False),
    ("price", "Processor seconds per simulated second", "", False),
)
NAME, TE = "sweep.html", "te"
MOST_ROWS = 200  # of the table


def write_page(table: SweepTable, subject: str, out: Path) -> Path:
    """Write sweep.html into `out`: figures of all results that there are, failures, table; returns its path."""
    good = table["outcome"] == "ok"
    plots = [plot for plot in [_te(table), *_results(table)] if plot is not None] if good.any() else []
    failed = len(table) - int(good.sum())
    body = [
        page.head(f"{subject} over {', '.join(map(_words, table.axes))}", "", _summary(table, failed)),
        *[page.warning(text) for text in table.failures[:20]],
        *[page.figure(plot, file=table.files[1 if plot.name == TE else 0].name) for plot in plots],
        page.section("Points", _rows(table)),
    ]
    write_text(out / NAME, page.page(f"Sweep: {subject}", body, plots))
    return out / NAME


def _summary(table: SweepTable, failed: int) -> str:
    ends = []
    for name in table.axes:
        values = list(dict.fromkeys(_number(value) for value in ticks_of(table, name)))
        text = ", ".join(values) if len(values) <= 4 else f"{values[0]} … {values[-1]} ({len(values)} values)"
        ends.append(f"{label_of(name)}: {text}")
    return f"{len(table)} points" + (f", {failed} failed" if failed else "") + " · " + "; ".join(ends)


def _number(value: object) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _words(axis: str) -> str:
    return label_of(axis).split(" in ", maxsplit=1)[0]


def _plain(name: str) -> str:
    """ "bearing wheel, alternating" of bearing_wheel_rms_ac_N."""
    name = re.sub(r"_(N_per_um|um|N|percent)$", "", name)
    name = re.sub(r"(^|_)te(?=_)", r"\1transmission error", name).replace("_rms_ac", ", alternating")
    return name.replace("_pp", ", peak to peak").replace("_mean", ", mean").replace("_", " ")


def _te(table: SweepTable) -> Plot | None:
    """Transmission error about its mean over the mesh cycle, of at most MOST_CURVES points."""
    names = [name for name in table.curves if name.endswith("te_um")]
    if not names:
        return None
    points = np.unique(table.curves["point"])
    chosen = at_most(points, MOST_CURVES)
    curves = []
    for point in chosen.tolist():
        own = table.curves["point"] == point
        for name in names:
            te = table.curves[name][own]
            mesh = name.removesuffix("te_um").rstrip("_")
            words = f"{table.values(point)}{f', {mesh}' if mesh else ''}"
            curves.append(Curve(table.curves["position"][own], te - te.mean(), f"{words}: {np.ptp(te):.3g} µm", "µm"))
    chart = Chart((Panel("transmission error about its mean in µm", tuple(curves), height=280),), "position in pitches")
    some = "" if chosen.size == points.size else f" {chosen.size} of {points.size} points are drawn."
    caption = f"Behind the values of each curve its peak to peak.{some} Data:"
    return Plot(TE, "Transmission error over the mesh cycle", caption, chart, {})


def _results(table: SweepTable) -> list[Plot]:
    """A figure for each group of results, over the first swept key or as maps over two."""
    axes, found = numeric_axes(table), []
    for part, title, unit, in_db in GROUPS:
        names = [name for name in table.columns if part in name and name not in (*table.axes, *NO_NUMBERS)]
        names = [name for name in names if np.any(np.nan_to_num(table[name]))]
        if not names or not axes:
            continue
        wide = len(axes) > 1 and min(np.unique(table[name]).size for name in axes[:2]) > 3
        kind, across = (unit, in_db), 2 if len(names) > 1 else 1
        panels = [_map(table, axes, n, kind) if wide else _curves(table, axes[0], n, kind) for n in names]
        chart = Chart(tuple(panels), label_of(axes[0]), across=across)
        found.append(Plot(part.strip("_").lower(), title, "Data:", chart, {}))
    return found


def _values(table: SweepTable, name: str, in_db: bool) -> np.ndarray:
    return level(table[name]) if in_db else table[name]


def _curves(table: SweepTable, axis: str, name: str, kind: tuple[str, bool]) -> Panel:
    """A result over one key, a curve for each combination of the other keys."""
    good = (table["outcome"] == "ok") & np.isfinite(table[name])
    others = [other for other in table.axes if other != axis]
    keys = [", ".join(f"{_words(o)} {_number(ticks_of(table, o)[row])}" for o in others) for row in range(len(table))]
    curves = []
    for key in list(dict.fromkeys(keys))[:MOST_CURVES]:
        rows = np.flatnonzero(good & (np.array(keys) == key))
        rows = rows[np.argsort(table[axis][rows])]
        values = _values(table, name, kind[1])[rows]
        curves.append(Curve(ticks_of(table, axis)[rows].astype(float), values, key, kind[0]))
    return Panel(f"{_plain(name)}, {kind[0]}".rstrip(", "), tuple(curves), height=220)


def _map(table: SweepTable, axes: Sequence[str], name: str, kind: tuple[str, bool]) -> Panel:
    """A result over two keys; further keys are held at the first point's values."""
    rows, _ = fixed(table, axes[:2])
    right, up, grid = on_grid(table, axes, rows, _values(table, name, kind[1]))
    low, high = float(np.nanmin(grid)), float(np.nanmax(grid))
    high = high if high > low else low + (abs(low) or 1.0) * 1e-6
    heat = Heat(right.astype(float), up.astype(float), grid, low, high, kind[0])
    return Panel(f"{_plain(name)}: {label_of(axes[1])}", (), heat, height=260)


def _rows(table: SweepTable) -> str:
    """The table of the points: swept keys, outcome, results."""
    results = [name for name in table.columns if any(part in name for part, *_ in GROUPS) and name not in table.axes]
    header = (*map(label_of, table.axes), "outcome", *(name.replace("_", " ") for name in results))
    rows = []
    for row in range(min(len(table), MOST_ROWS)):
        cells = [_number(ticks_of(table, axis)[row]) for axis in table.axes]
        numbers = [float(table[name][row]) for name in results]
        rows.append((*cells, str(table["outcome"][row]), *("–" if math.isnan(v) else f"{v:.4g}" for v in numbers)))
    more = len(table) - len(rows)
    note = page.note(f"The first {len(rows)} of {len(table)} points; all are in {table.files[0].name}.") if more else ""
    return page.table(header, rows) + note
