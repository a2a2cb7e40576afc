"""Two or more runs in one page: results side by side, transmission error, spectra, octave bands and mesh orders over
one another, differences against the first run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gearfmu.files import write_text
from gearfmu.report import metrics, page, sections
from gearfmu.report.chart import TIME, Chart, Curve, Panel, Plot, level_limits
from gearfmu.report.kinds import averaging, force_channels
from gearfmu.report.mesh_cycle import BINS, HARMONICS, mean_cycle, with_harmonics
from gearfmu.report.metrics import MetricsError
from gearfmu.report.names import minus, plain, shown
from gearfmu.report.plots import of_mesh
from gearfmu.report.plots_nvh import SHOWN_TO, octave_table, segment, spectrum_curve, spectrum_of
from gearfmu.report.run import Run
from gearfmu.report.signals import meshes
from gearfmu.stage.run.te import mesh_harmonics
from gearfmu.stage.run.trace import write_columns

ORDERS = 6
ALIKE = 0.05  # dB, or %: smaller differences are not called better or worse
LEVELS = ("rms_ac_N", "rms_ac_um")  # results whose differences are told in dB


@dataclass(frozen=True)
class Compared:
    """A run and what it is called on the page."""

    label: str
    run: Run


def write_comparison(compared: Sequence[Compared], path: Path) -> Path:
    """Write the page and, in <name>_data beside it, the data of its figures; returns `path`."""
    folder = path.with_name(f"{path.stem}_data")
    plots = [plot for plot in _plots(compared) if plot is not None]
    for plot in plots:
        write_columns(folder / f"{plot.name}.csv", plot.columns)
    names = [own.label for own in compared]
    described = " · ".join(
        f"{own.label}: {own.run.title}, {own.run.stage_name}, {own.run.summary.get('outcome', 'outcome not given')}"
        for own in compared
    )
    body = [
        page.head(" and ".join((", ".join(names[:-1]), names[-1])), "", described),
        page.tiles(_tiles(compared)),
        page.section("Results", _results(compared), name="results"),
        *[page.figure(plot, folder.name) for plot in plots],
        *_octaves(compared),
        *_order_table(compared),
        page.section("How they were run", _facts(compared)),
    ]
    write_text(path, page.page(f"Comparison: {', '.join(names)}", body, plots))
    return path


def _difference(key: str, value: float, first: float) -> tuple[str, float]:
    """A difference in words and as a number: dB of alternating parts, else per cent, else the plain difference."""
    if key.endswith(LEVELS) and value > 0 and first > 0:
        change = 20 * math.log10(value / first)
        return minus(f"{change:+.1f} dB"), change
    if first and not key.endswith("percent"):
        change = 100 * (value - first) / abs(first)
        return minus(f"{change:+.1f} %"), change
    return minus(f"{value - first:+.3g}"), value - first


def _tiles(compared: Sequence[Compared]) -> list[tuple[str, str, str]]:
    """The largest news: what each other run changes against the first."""
    first, found = compared[0].run.results, []
    for own in compared[1:]:
        values = own.run.results
        for end, words in (
            ("te_rms_ac_um", "alternating transmission error"), ("mesh_force_rms_ac_N", "alternating mesh force"),
            ("dynamic_factor", "dynamic factor"),
        ):  # fmt: skip
            key = next((k for k in first if k.endswith(end) and k in values), None)
            if key is not None:
                value, _, unit = _difference(key, values[key], first[key])[0].partition(" ")
                found.append((value, unit, f"{words}: {own.label} against {compared[0].label}"))
    return found


def _results(compared: Sequence[Compared]) -> str:
    """The table of key results, one column a run and one a difference."""
    names, rows = meshes(compared[0].run.trace), []
    for key, first in compared[0].run.results.items():
        words, _, unit = sections.result_words(key, names)
        changes = [cell for own in compared[1:] for cell in _cells(key, own.run.results.get(key), first)]
        rows.append((words, unit, f"{first:.4g}", *changes))
    others = [cell for own in compared[1:] for cell in (own.label, "change")]
    where = "; ".join(f"{own.label} {own.run.window.start:.4g} s to {own.run.window.end:.4g} s" for own in compared)
    note = page.note(f"Changes against {compared[0].label}. Windows: {where}. {sections.FACTOR_WORDS}")
    return page.table(("", "unit", compared[0].label, *others), rows, (0, 1)) + note


def _cells(key: str, value: float | None, first: float) -> tuple[str, str]:
    if value is None:
        return "–", "–"
    words, change = _difference(key, value, first)
    if abs(change) < ALIKE or "mean" in key or "lock" in key:
        return f"{value:.4g}", words
    return f"{value:.4g}", page.Ready(f'<span class="{"better" if change < 0 else "worse"}">{words}</span>')


def _plots(compared: Sequence[Compared]) -> list[Plot | None]:
    names = [mesh for mesh in meshes(compared[0].run.trace) if all(mesh in meshes(own.run.trace) for own in compared)]
    found: list[Plot | None] = []
    for mesh in names:
        found += [_mesh_cycle(compared, mesh), _orders(compared, mesh)]
    return [*found, _spectra(compared), *[_over_time(compared, mesh) for mesh in names]]


def _over_time(compared: Sequence[Compared], mesh: str) -> Plot | None:
    """Force and transmission error of a mesh over time, the runs over one another."""
    panels, columns = [], {}
    for channel, scale, label in (("te", 1e6, "transmission error in µm"), ("force", 1e-3, "mesh force in kN")):
        own = [c for c in compared if f"{mesh}.{channel}" in c.run.trace]
        curves = [
            Curve(c.run.trace.time, scale * c.run.trace[f"{mesh}.{channel}"], c.label, label.split()[-1]) for c in own
        ]
        if curves:
            panels.append(Panel(f"{shown(f'{mesh}.{channel}')}: {label}", tuple(curves), height=210))
    if not panels:
        return None
    size = max(c.run.trace.time.size for c in compared)
    for c in compared:
        columns[f"{c.label} time_[s]"] = _padded(c.run.trace.time, size)
        for channel in ("te", "force"):
            if f"{mesh}.{channel}" in c.run.trace:
                columns[f"{c.label} {mesh}.{channel}"] = _padded(c.run.trace[f"{mesh}.{channel}"], size)
    chart = Chart(tuple(panels), TIME, "time")
    title = of_mesh(compared[0].run.trace, mesh, "Transmission error and mesh force")
    return Plot(f"{mesh}_time", title, "Each run in its own time.", chart, columns)


def _padded(values: np.ndarray, size: int) -> np.ndarray:
    """(size,): NaN behind the end."""
    return np.concatenate([np.asarray(values, dtype=float), np.full(size - len(values), np.nan)])


def _mesh_cycle(compared: Sequence[Compared], mesh: str) -> Plot | None:
    """Mean transmission error over the mesh cycle and its harmonics."""
    found = {own.label: mean for own in compared if (mean := mean_cycle(own.run, mesh)) is not None}
    if len(found) < 2:
        return None
    x, label = (np.arange(BINS) + 0.5) / BINS, "transmission error in µm, without its mean"
    lines = {label: mesh_harmonics(mean[None], HARMONICS)[0] for label, mean in found.items()}
    curves = tuple(Curve(x, mean - mean.mean(), label, "µm") for label, mean in found.items())
    panel = Panel(label, curves, height=230, x_label="position in pitches")
    told = "; ".join(f"{label} {np.ptp(mean):.3g} µm" for label, mean in found.items())
    caption = f"Mean over all mesh cycles of each run's window. Peak to peak: {told}."
    columns = {"harmonic": np.arange(1.0, HARMONICS + 1)}
    columns |= {f"{label}_[um rms]": line for label, line in lines.items()}
    title = of_mesh(compared[0].run.trace, mesh, "Mesh cycle")
    return Plot(f"{mesh}_cycle", title, caption, with_harmonics(panel, lines), columns)


def _common(compared: Sequence[Compared]) -> list[str]:
    names = force_channels(compared[0].run.trace)
    return [name for name in names if all(name in own.run.trace for own in compared)]


def _spectra(compared: Sequence[Compared]) -> Plot | None:
    """Spectra of every force that all runs have, the runs over one another."""
    panels, columns = [], {}
    for name in _common(compared):
        curves = []
        for own in compared:
            try:
                found = spectrum_of(own.run.part, name, segment(own.run.part.time.size))
            except MetricsError:
                continue
            curves.append(spectrum_curve(own.label, found, SHOWN_TO))
            columns[f"{own.label} frequency_[Hz]"] = found.frequency
            columns[f"{own.label} {name}_[dB re 1 N]"] = metrics.level(found.amplitude)
        if curves:
            panels.append(Panel(f"{shown(name)}: level in dB re 1 N", tuple(curves), limits=level_limits(curves)))
    if not panels:
        return None
    size = max(len(values) for values in columns.values())
    columns = {name: _padded(values, size) for name, values in columns.items()}
    caption = "Rms amplitude of each line, Hann windows; each run over its window."
    chart = Chart(tuple(panels), "frequency in kHz", "frequency")
    return Plot("spectra", "Spectra of the forces", caption, chart, columns)


def order_levels(own: Compared, mesh: str) -> dict[str, np.ndarray]:
    """Level (ORDERS,) dB re 1 N of the mesh orders in every force of a run, mean power over its window."""
    run = own.run
    found: dict[str, np.ndarray] = {}
    if mesh not in run.angles:
        return found
    for name in force_channels(run.trace):
        try:
            cuts = metrics.order_cuts(
                run.trace.time, run.trace[name], run.angles[mesh], ORDERS, averaged=averaging(run.trace, name)
            )
        except MetricsError:
            continue
        inside = (cuts.time >= run.window.start) & (cuts.time <= run.window.end)
        if inside.any():
            found[name] = metrics.level(np.sqrt(np.mean(cuts.amplitude[:, inside] ** 2, axis=1)))
    return found


def _orders(compared: Sequence[Compared], mesh: str) -> Plot | None:
    """Mesh orders of every force, the runs beside one another."""
    levels = {own.label: order_levels(own, mesh) for own in compared}
    orders, panels, columns = np.arange(1.0, ORDERS + 1), [], {"order": np.arange(1.0, ORDERS + 1)}
    for name in _common(compared):
        known = {label: found[name] for label, found in levels.items() if name in found}
        if not known:
            continue
        base = min(float(np.nanmin(level)) for level in known.values())
        top = max(float(np.nanmax(level)) for level in known.values())
        curves = tuple(Curve(orders, level, label, "dB re 1 N", "bars") for label, level in known.items())
        limits = (max(math.floor(base / 10) * 10 - 10, top - 90), math.ceil(top / 10) * 10)
        panels.append(Panel(f"{shown(name)}: level in dB re 1 N", curves, limits=limits, height=150))
        columns |= {f"{label} {name}_[dB re 1 N]": level for label, level in known.items()}
    if not panels:
        return None
    caption = "Level of every mesh order, mean power over the window of each run."
    chart = Chart(tuple(panels), "order of the mesh", across=2)
    title = of_mesh(compared[0].run.trace, mesh, "Mesh orders")
    return Plot(f"{mesh}_orders", title, caption, chart, columns)


def _octaves(compared: Sequence[Compared]) -> list[str]:
    """Octave bands of the first run, and what the others change in dB."""
    try:
        tables = [octave_table(own.run) for own in compared]
    except MetricsError:
        return []
    rows = [row for table in tables for row in table.values()]
    bands = [band for band in next(iter(tables[0].values()), {}) if all(band in row for row in rows)]
    levels = [{name: np.array([row[band] for band in bands]) for name, row in table.items()} for table in tables]
    head = ("Hz", *(f"{band:g}" for band in bands))
    return _level_table(compared, "Octave bands", head, levels, "octaves") if bands else []


def _order_table(compared: Sequence[Compared]) -> list[str]:
    """Mesh orders of the first run in dB, and what the others change."""
    found, head = [], ("order", *(str(k) for k in range(1, ORDERS + 1)))
    for mesh in meshes(compared[0].run.trace):
        title = of_mesh(compared[0].run.trace, mesh, "Mesh orders in numbers")
        found += _level_table(compared, title, head, [order_levels(own, mesh) for own in compared])
    return found


def _level_table(
    compared: Sequence[Compared],
    title: str,
    head: Sequence[str],
    levels: Sequence[Mapping[str, np.ndarray]],
    mark: str = "",
) -> list[str]:
    """A section with levels (dB) of the first run by channel, and what the others change; none without common
    channels. levels: by channel of each run; mark: target of links."""
    rows = []
    for name in (n for n in _common(compared) if all(n in own for own in levels)):
        rows.append((f"{plain(name) or name}, {compared[0].label}", *map(_db, levels[0][name])))
        for own, level in zip(compared[1:], levels[1:], strict=True):
            change = level[name] - levels[0][name]
            rows.append((f"    {own.label}, change", *(_db(value, "+") for value in change)))
    note = page.note(f"Level in dB re 1 N (rms) of {compared[0].label}, and changes of the others in dB.")
    return [page.section(title, note, page.table(head, rows), name=mark)] if rows else []


def _db(value: float, sign: str = "") -> str:
    return "–" if math.isnan(value) else minus(f"{value:{sign}.1f}")


def _facts(compared: Sequence[Compared]) -> str:
    known = [sections.facts(own.run.summary) for own in compared]
    rows = [(key, *(facts.get(key, "–") for facts in known)) for key in known[0]]
    return page.table(("", *(own.label for own in compared)), rows)
