"""Two or more runs in one page: results side by side, transmission error, spectra, octave bands and mesh orders over
one another, differences against the first run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from gearfmu.files import write_text
from gearfmu.report import metrics, page, sections
from gearfmu.report.chart import Chart, Curve, Panel, Plot, level_limits, over_time
from gearfmu.report.kinds import FORCES, averaging, force_channels
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


Runs: TypeAlias = Mapping[str, Run]  # by what each is called on the page


def write_comparison(runs: Runs, path: Path) -> Path:
    """Write the page and, in <name>_data beside it, the data of its figures; returns `path`. runs: by their names."""
    folder, names = path.with_name(f"{path.stem}_data"), list(runs)
    plots = _plots(runs)
    for plot in plots:
        size = max(len(values) for values in plot.columns.values())
        columns = {
            key: np.pad(own.astype(float), (0, size - len(own)), constant_values=np.nan)  # as long as the longest
            for key, own in plot.columns.items()
        }
        write_columns(folder / f"{plot.name}.csv", columns)
    described = " · ".join(
        f"{name}: {run.title}, {run.stage_name}, {run.summary.get('outcome', 'outcome not given')}"
        for name, run in runs.items()
    )
    body = [
        page.head(" and ".join((", ".join(names[:-1]), names[-1])), "", described),
        page.tiles(_tiles(runs)),
        page.section("Results", _results(runs), name="results"),
        *[page.figure(plot, folder.name) for plot in plots],
        *_octaves(runs),
        *_order_table(runs),
        page.section("How they were run", _facts(runs)),
    ]
    write_text(path, page.page(f"Comparison: {', '.join(names)}", body, plots))
    return path


def _first(runs: Runs) -> tuple[str, Run]:
    """Name of the run that the others are compared with, and it."""
    return next(iter(runs.items()))


def _others(runs: Runs) -> dict[str, Run]:
    return dict(list(runs.items())[1:])


def _difference(key: str, value: float, first: float) -> tuple[str, float]:
    """A difference in words and as a number: dB of alternating parts, else per cent, else the plain difference."""
    if key.endswith(LEVELS) and value > 0 and first > 0:
        change = 20 * math.log10(value / first)
        return minus(f"{change:+.1f} dB"), change
    if first and not key.endswith("percent"):
        change = 100 * (value - first) / abs(first)
        return minus(f"{change:+.1f} %"), change
    return minus(f"{value - first:+.3g}"), value - first


def _tiles(runs: Runs) -> list[tuple[str, str, str]]:
    """The largest news: what each other run changes against the first."""
    (base, run), found = _first(runs), []
    for name, own in _others(runs).items():
        for end, words in (
            ("te_rms_ac_um", "alternating transmission error"), ("mesh_force_rms_ac_N", "alternating mesh force"),
            ("dynamic_factor", "dynamic factor"),
        ):  # fmt: skip
            key = next((k for k in run.results if k.endswith(end) and k in own.results), None)
            if key is not None:
                value, _, unit = _difference(key, own.results[key], run.results[key])[0].partition(" ")
                found.append((value, unit, f"{words}: {name} against {base}"))
    return found


def _results(runs: Runs) -> str:
    """The table of key results, one column a run and one a difference."""
    (base, run), rows = _first(runs), []
    for key, first in run.results.items():
        words, _, unit = sections.result_words(key, meshes(run.trace))
        changes = [cell for own in _others(runs).values() for cell in _cells(key, own.results.get(key), first)]
        rows.append((words, unit, f"{first:.4g}", *changes))
    others = [cell for name in _others(runs) for cell in (name, "change")]
    where = "; ".join(f"{name} {own.window.start:.4g} s to {own.window.end:.4g} s" for name, own in runs.items())
    note = page.note(f"Changes against {base}. Windows: {where}. {sections.FACTOR_WORDS}")
    return page.table(("", "unit", base, *others), rows, (0, 1)) + note


def _cells(key: str, value: float | None, first: float) -> tuple[str, str]:
    if value is None:
        return "–", "–"
    words, change = _difference(key, value, first)
    if abs(change) < ALIKE or "mean" in key or "lock" in key:
        return f"{value:.4g}", words
    return f"{value:.4g}", page.Ready(f'<span class="{"better" if change < 0 else "worse"}">{words}</span>')


def _plots(runs: Runs) -> list[Plot]:
    _, first = _first(runs)
    names = [mesh for mesh in meshes(first.trace) if all(mesh in meshes(own.trace) for own in runs.values())]
    found = [plot for mesh in names for plot in (_mesh_cycle(runs, mesh), _orders(runs, mesh))]
    found += [_spectra(runs), *[_over_time(runs, mesh) for mesh in names]]
    return [plot for plot in found if not plot.empty]


def _over_time(runs: Runs, mesh: str) -> Plot:
    """Force and transmission error of a mesh over time, the runs over one another."""
    panels, columns, names = [], {}, (f"{mesh}.te", f"{mesh}.force")
    for name, scale, label in zip(names, (1e6, 1e-3), ("transmission error in µm", "mesh force in kN"), strict=True):
        unit, own = label.split()[-1], {key: run.trace for key, run in runs.items() if name in run.trace}
        curves = tuple(Curve(trace.time, scale * trace[name], key, unit) for key, trace in own.items())
        panels += [Panel(f"{shown(name)}: {label}", curves, height=210)] if curves else []
    for key, run in runs.items():
        columns[f"{key} time_[s]"] = run.trace.time
        columns |= {f"{key} {name}": run.trace[name] for name in names if name in run.trace}
    title = of_mesh(_first(runs)[1].trace, mesh, "Transmission error and mesh force")
    return Plot(f"{mesh}_time", title, "Each run in its own time.", over_time(panels), columns)


def _mesh_cycle(runs: Runs, mesh: str) -> Plot:
    """Mean transmission error over the mesh cycle and its harmonics; without panels for fewer than two runs."""
    found = {name: mean for name, run in runs.items() if (mean := mean_cycle(run, mesh)) is not None}
    x, label = (np.arange(BINS) + 0.5) / BINS, "transmission error in µm, without its mean"
    lines = {name: mesh_harmonics(mean[None], HARMONICS)[0] for name, mean in found.items()}
    curves = tuple(Curve(x, mean - mean.mean(), name, "µm") for name, mean in found.items())
    panel = Panel(label, curves, height=230, x_label="position in pitches")
    told = "; ".join(f"{name} {np.ptp(mean):.3g} µm" for name, mean in found.items())
    caption = f"Mean over all mesh cycles of each run's window. Peak to peak: {told}."
    columns = {"harmonic": np.arange(1.0, HARMONICS + 1)}
    columns |= {f"{name}_[um rms]": line for name, line in lines.items()}
    chart = with_harmonics(panel, lines) if len(found) > 1 else Chart(())
    return Plot(f"{mesh}_cycle", of_mesh(_first(runs)[1].trace, mesh, "Mesh cycle"), caption, chart, columns)


def _common(runs: Runs) -> list[str]:
    """Forces that all runs have."""
    return [name for name in force_channels(_first(runs)[1].trace) if all(name in own.trace for own in runs.values())]


def _spectra(runs: Runs) -> Plot:
    """Spectra of every force that all runs have, the runs over one another."""
    panels, columns = [], {}
    for name in _common(runs):
        curves = []
        for key, run in runs.items():
            try:
                found = spectrum_of(run.part, name, segment(run.part.time.size))
            except MetricsError:
                continue
            curves.append(spectrum_curve(key, found, SHOWN_TO))
            columns[f"{key} frequency_[Hz]"] = found.frequency
            columns[f"{key} {name}_[dB re 1 N]"] = metrics.level(found.amplitude)
        label = f"{shown(name)}: level in dB re 1 N"
        panels += [Panel(label, tuple(curves), limits=level_limits(curves))] if curves else []
    caption = "Rms amplitude of each line, Hann windows; each run over its window."
    return Plot("spectra", FORCES.spectra, caption, Chart(tuple(panels), "frequency in kHz", "frequency"), columns)


def order_levels(run: Run, mesh: str) -> dict[str, np.ndarray]:
    """Level (ORDERS,) dB re 1 N of the mesh orders in every force of a run, mean power over its window."""
    found: dict[str, np.ndarray] = {}
    trace = run.trace
    for name in force_channels(trace) if mesh in run.angles else ():
        try:
            cuts = metrics.order_cuts(
                trace.time, trace[name], run.angles[mesh], ORDERS, averaged=averaging(trace, name)
            )
        except MetricsError:
            continue
        inside = (cuts.time >= run.window.start) & (cuts.time <= run.window.end)
        if inside.any():
            found[name] = metrics.level(np.sqrt(np.mean(cuts.amplitude[:, inside] ** 2, axis=1)))
    return found


def _orders(runs: Runs, mesh: str) -> Plot:
    """Mesh orders of every force, the runs beside one another."""
    levels = {name: order_levels(run, mesh) for name, run in runs.items()}
    orders, panels, columns = np.arange(1.0, ORDERS + 1), [], {"order": np.arange(1.0, ORDERS + 1)}
    for name in _common(runs):
        known = {label: found[name] for label, found in levels.items() if name in found}
        if not known:
            continue
        base = min(float(np.nanmin(level)) for level in known.values())
        top = max(float(np.nanmax(level)) for level in known.values())
        curves = tuple(Curve(orders, level, label, "dB re 1 N", "bars") for label, level in known.items())
        limits = (max(math.floor(base / 10) * 10 - 10, top - 90), math.ceil(top / 10) * 10)
        panels.append(Panel(f"{shown(name)}: level in dB re 1 N", curves, limits=limits, height=150))
        columns |= {f"{label} {name}_[dB re 1 N]": level for label, level in known.items()}
    caption = "Level of every mesh order, mean power over the window of each run."
    title, chart = "Mesh orders", Chart(tuple(panels), "order of the mesh", across=2)
    return Plot(f"{mesh}_orders", of_mesh(_first(runs)[1].trace, mesh, title), caption, chart, columns)


def _octaves(runs: Runs) -> list[str]:
    """Octave bands of the first run, and what the others change in dB."""
    try:
        tables = {name: octave_table(run) for name, run in runs.items()}
    except MetricsError:
        return []
    rows = [row for table in tables.values() for row in table.values()]
    bands = [band for band in next(iter(next(iter(tables.values())).values()), {}) if all(band in row for row in rows)]
    levels = [{name: np.array([row[band] for band in bands]) for name, row in t.items()} for t in tables.values()]
    head = ("Hz", *(f"{band:g}" for band in bands))
    return _level_table(runs, "Octave bands", head, levels, "octaves") if bands else []


def _order_table(runs: Runs) -> list[str]:
    """Mesh orders of the first run in dB, and what the others change."""
    found, head, trace = [], ("order", *(str(k) for k in range(1, ORDERS + 1))), _first(runs)[1].trace
    for mesh in meshes(trace):
        title = of_mesh(trace, mesh, "Mesh orders in numbers")
        found += _level_table(runs, title, head, [order_levels(own, mesh) for own in runs.values()])
    return found


def _level_table(
    runs: Runs, title: str, head: Sequence[str], levels: Sequence[Mapping[str, np.ndarray]], mark: str = ""
) -> list[str]:
    """A section with levels (dB) of the first run by channel, and what the others change; none without common
    channels. levels: by channel of each run; mark: target of links."""
    rows, (base, *others) = [], runs
    for name in (n for n in _common(runs) if all(n in own for own in levels)):
        rows.append((f"{plain(name) or name}, {base}", *map(_db, levels[0][name])))
        for label, level in zip(others, levels[1:], strict=True):
            change = level[name] - levels[0][name]
            rows.append((f"    {label}, change", *(_db(value, "+") for value in change)))
    note = page.note(f"Level in dB re 1 N (rms) of {base}, and changes of the others in dB.")
    return [page.section(title, note, page.table(head, rows), name=mark)] if rows else []


def _db(value: float, sign: str = "") -> str:
    return "–" if math.isnan(value) else minus(f"{value:{sign}.1f}")


def _facts(runs: Runs) -> str:
    known = [sections.facts(run.summary) for run in runs.values()]
    rows = [(key, *(facts.get(key, "–") for facts in known)) for key in known[0]]
    return page.table(("", *runs), rows)
