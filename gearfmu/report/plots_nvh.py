"""Figures over frequency: spectra of the bearing and mesh forces, cuts along mesh orders, spectrogram."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gearfmu.report import metrics
from gearfmu.report.chart import Chart, Curve, Heat, Mark, Panel, Plot, level_limits, over_time
from gearfmu.report.kinds import ACCELERATIONS, FORCES, Kind, averaging, by_part, force_channels
from gearfmu.report.names import shown
from gearfmu.report.plots import of_mesh
from gearfmu.report.run import Run
from gearfmu.report.signals import GEAR_SPEED, PlanetSet, bearings, mesh_speed, meshes, on_mounts, recorded, steady
from gearfmu.stage.run.trace import Trace

RANGE_DB, SHOWN_DB = 90, 60  # of maps over time, over speed
ORDERS = 5
TRUSTED_FROM = 20e3  # Hz; sampling that ends below it gets a warning
LOOKS = ("dashed", "dotted")  # of the orders of one mesh and the next
MOST_ROWS, MOST_COLUMNS = 400, 700  # of a map in the page
MEANS = "Channels …_mean are means over the communication step, their averaging taken out. "
MARKED_ORDERS = 12  # of a set
SHOWN_TO = 12e3  # Hz; the data reach half the sampling rate


def spectrum_of(part: Trace, name: str, size: int | None = None) -> metrics.Spectrum:
    """Spectrum of a channel over the whole of `part`; of a mean over the step as it is without the averaging."""
    step = metrics.sample_step(part.time)
    return metrics.amplitude_spectrum(part[name], step, size, averaging(part, name))


def spectra_by_central(run: Run, own: PlanetSet) -> Plot:
    """Spectra of the mesh forces and of the ring's force on its mounts along fixed axes. Marked: mesh orders k f_m, and
    around each the sidebands of the planets' passing, k f_m ± N f_c (N planets, f_c: carrier)."""
    part, window = run.part, run.window
    groups = {f"meshes of the {c}: ": [f"{m}.force" for m in meshes.values()] for c, meshes in own.meshes.items()}
    groups |= {"ring on its mounts: ": fixed} if (fixed := list(on_mounts(part))) else {}
    used = {name: recorded(part, name) for group in groups.values() for name in group}
    found = {name: spectrum_of(part, best, segment(part.time.size, 1)) for name, best in used.items()}
    mesh_frequency = mesh_speed(part, own) / (2 * np.pi)
    speed = np.abs(part[f"{own.carrier}{GEAR_SPEED}"])
    carrier = float(np.median(speed)) / (2 * np.pi)
    marks = _side_marks(mesh_frequency, len(own.planets) * carrier, _top(part)) if steady(speed) else []
    first = next(iter(found.values()))
    caption = (
        f"Rms amplitude of each line, Hann, resolution {first.resolution:.3g} Hz, {window.start:.3g} s to "
        f"{window.end:.3g} s ({window.reason}). "
    )
    caption += (
        f"Dotted: mesh orders k·f_m, f_m = {mesh_frequency:.1f} Hz; light: k·f_m ± {len(own.planets)} f_c, "
        f"f_c = {carrier:.2f} Hz of the carrier."
        if steady(speed)
        else "Mesh orders are not marked: the speed is not steady."
    )
    data = {"frequency_[Hz]": first.frequency} | {f"{used[n]}_rms_[N]": s.amplitude for n, s in found.items()}
    parts = [(of, {name: found[name] for name in group}) for of, group in groups.items()]
    return Plot("spectrum", FORCES.spectra, caption, _over_frequency(parts, _top(part), marks, FORCES), data)


def _side_marks(mesh_frequency: float, passing: float, top: float) -> list[Mark]:
    """Marks of the mesh orders and their sidebands below `top`; all in Hz."""
    found = []
    for order in range(1, min(MARKED_ORDERS, int(top / mesh_frequency)) + 1):
        at = order * mesh_frequency
        found += [Mark(at / 1e3, str(order)), *(Mark((at + side * passing) / 1e3, "", "side") for side in (-1, 1))]
    return found


def spectra(run: Run, names: Sequence[str], kind: Kind) -> Plot | None:
    """Level of channels over frequency, mesh orders marked; None without channels."""
    if not names:
        return None
    trace, part, window = run.trace, run.part, run.window
    own = {name: spectrum_of(part, name, segment(part.time.size)) for name in names}
    found = {mesh: _order_marks(run, mesh, _top(part)) for mesh in run.angles}
    marked, marks = [mesh for mesh in found if found[mesh]], [mark for own in found.values() for mark in own]
    groups = [("", {name: own[name] for name in group}) for group in by_part(names)]
    first = next(iter(own.values()))
    caption = (
        f"Rms amplitude of each line, Hann, {first.segments} windows, resolution {first.resolution:.3g} Hz, "
        f"from {window.start:.3f} s to {window.end:.3f} s ({window.reason}). "
        f"{MEANS if any(name.endswith('_mean') for name in names) else ''}"
        + (
            f"Dotted: {of_mesh(trace, ' and '.join(marked), 'mesh orders')}."
            if marked
            else "Mesh orders are not marked: the speed is not known or not steady, or they lie above the spectrum."
        )
    )
    data = {"frequency_[Hz]": first.frequency}
    for name, spectrum in own.items():
        data[f"{name}_rms_[{kind.unit}]"] = spectrum.amplitude
        data[f"{name}_[{kind.label}]"] = kind.level(spectrum.amplitude)
    return Plot(f"{kind.prefix}spectrum", kind.spectra, caption, _over_frequency(groups, _top(part), marks, kind), data)


def order_cuts(run: Run, mesh: str) -> Plot | None:
    """Level of the first orders of an engagement in its force and every bearing force along the run; None without
    forces."""
    others = tuple(f"{other}." for other in meshes(run.trace) if other != mesh)
    names = [name for name in force_channels(run.trace) if not name.startswith(others)]
    names = [name for name in names if ".fx" not in name or len(bearings(run.trace)) < 2]
    return cuts(run, mesh, names, FORCES)


def cuts(run: Run, mesh: str, names: Sequence[str], kind: Kind) -> Plot | None:
    """Level of the first orders of an engagement in channels along the run; None without channels. MetricsError where
    not even the first order lies below the sampling limit anywhere in the run."""
    if not names:
        return None
    trace, angle = run.trace, run.angles[mesh]
    file = f"{kind.prefix}orders" if len(meshes(trace)) < 2 else f"{kind.prefix}orders_{mesh}"
    found = {
        name: metrics.order_cuts(trace.time, trace[name], angle, ORDERS, averaged=averaging(trace, name))
        for name in names
    }
    first = next(iter(found.values()))
    low, high = first.mesh_frequency.min(), first.mesh_frequency.max()
    if not np.any(np.isfinite(first.amplitude)):
        raise metrics.MetricsError(
            f"Mesh orders of {mesh}: its mesh frequency, {low:.0f} Hz and more, lies above 0.45 of the sampling rate, "
            f"{0.45 / metrics.sample_step(trace.time):.0f} Hz. Run again with a communication step of "
            f"{0.45e6 / low / 5:.2g} µs for the first five orders."
        )
    panels = []
    for name, cut in found.items():
        rows = [(k, row) for k, row in zip(cut.orders, cut.amplitude, strict=True) if np.any(np.isfinite(row))]
        curves = tuple(Curve(cut.time, kind.level(row), f"order {k}", kind.label) for k, row in rows)
        panels.append(Panel(f"{shown(name)}, {kind.label}", curves, limits=level_limits(curves)))
    caption = (
        f"Mesh order k = k × mesh frequency, which runs from {low:.0f} to {high:.0f} Hz; Hann window of 8 mesh "
        "periods in angle, so an order keeps its level while the speed changes. Orders above 0.45 of the sampling rate "
        "are left out."
    )
    title = of_mesh(trace, mesh, f"Mesh orders {'of the housing ' if kind is ACCELERATIONS else ''}along the run")
    data = {"time_[s]": first.time, "mesh_frequency_[Hz]": first.mesh_frequency}
    for name, cut in found.items():
        data |= {f"{name}_order_{k}_rms_[{kind.unit}]": row for k, row in zip(cut.orders, cut.amplitude, strict=True)}
    return Plot(file, title, caption, over_time(panels), data)


def force_spectrogram(run: Run) -> Plot | None:
    """Level of one force over time and frequency with the mesh orders on top: a bearing force, or in a coarsely sampled
    trace a mean over the step, which folds less; None without forces."""
    trace = run.trace
    names = force_channels(trace)
    if not names:
        return None
    preferred = "_mean" if sampling_warning(trace) else ".fy"
    name = next((n for n in names if preferred in n), names[0])
    step = metrics.sample_step(trace.time)
    window_size = segment(trace.time.size, windows=14)
    hop = max(window_size // 16, 1)
    picture_data = metrics.spectrogram(trace[name], step, window_size, hop, averaging(trace, name))
    if picture_data.time.size < 4:
        raise metrics.MetricsError(f"{trace.time.size} samples are too few for a spectrogram; record a longer run")
    values, limit = metrics.level(picture_data.amplitude), _top(trace)
    time, shown_to = picture_data.time + trace.time[0], picture_data.frequency <= limit
    kept = picture_data.frequency[shown_to] / 1e3, values[:, shown_to].T
    heat = heat_of(time, *kept, values.max(), span=RANGE_DB)
    looks = {mesh: LOOKS[k % len(LOOKS)] for k, mesh in enumerate(run.angles)}
    rays = [curve for mesh, look in looks.items() for curve in _order_curves(run, mesh, look, limit)]
    limits = (float(time[0]), float(time[-1]))
    panel = Panel(f"{shown(name)}: frequency in kHz", tuple(rays), heat, height=300, limits=(0.0, limit / 1e3))
    chart = Chart((panel,), group="time", x_limits=limits)
    caption = (
        f"{name}; Hann windows of {window_size * step * 1e3:.1f} ms, resolution {picture_data.frequency[1]:.0f} Hz. "
        f"Dashed: orders {' and, dotted, '.join(f'of {mesh}' for mesh in run.angles) or 'of the mesh'} from the speed."
    )
    data = {
        "time_[s]": np.repeat(time, picture_data.frequency.size),
        "frequency_[Hz]": np.tile(picture_data.frequency, time.size),
        "level_[dB re 1 N]": values.ravel(),
    }
    return Plot("spectrogram", "Spectrogram", caption, chart, data)


def octave_table(run: Run) -> dict[str, dict[float, float]]:
    """Octave-band levels in dB re 1 N by channel over the run's window, from one full-length Hann window."""
    return {name: metrics.octave_levels(spectrum_of(run.part, name)) for name in force_channels(run.trace)}


def segment(samples: int, windows: int = 3) -> int:
    """Samples a Hann window for about `windows` windows in the record: a power of two, at least 64 where there are
    as many."""
    wanted = max(64, 2 ** int(np.round(np.log2(max(samples / windows, 1)))))
    return min(wanted, samples)


def sampling_warning(trace: Trace) -> str | None:
    """What the sampling does to spectra, in words, where it ends below TRUSTED_FROM; None where it does not or there
    are none."""
    if not force_channels(trace) or trace.time.size < 16:
        return None
    limit = 0.5 / metrics.sample_step(trace.time)
    if limit >= TRUSTED_FROM:
        return None
    means = [name for name in force_channels(trace) if name.endswith("_mean")]
    weaker = f" ({', '.join(means)}: weakened, being means over the step)" if means else ""
    return (
        f"Sampled every {0.5e6 / limit:.3g} µs without a filter: vibration above {limit / 1e3:.3g} kHz, where the "
        "mesh resonance of most pairs lies, folds back "
        f"into the spectra, orders and bands below{weaker}. For levels to rely on, run with a communication step "
        "of 20 µs."
    )


def heat_of(
    x: np.ndarray, y: np.ndarray, levels: np.ndarray, top: float, unit: str = "dB re 1 N", span: float = SHOWN_DB
) -> Heat:
    """A map of levels (Y, X) dB over ascending or descending x (X,) and y (Y,), shown from `top`, rounded up to 5 dB,
    `span` down: of neighbours beyond MOST_COLUMNS and MOST_ROWS the largest, so that no line is lost."""
    top = float(np.ceil(top / 5) * 5)
    levels, x = _largest_of(levels.T, x, MOST_COLUMNS)
    levels, y = _largest_of(levels.T, y, MOST_ROWS)
    return Heat(x, y, levels, top - span, top, unit)


def _largest_of(levels: np.ndarray, at: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of levels (n, m) at (n,), in groups where there are more than `most`: the largest of each, its middle."""
    if at.size <= most:
        return levels, at
    starts = np.arange(0, at.size, -(-at.size // most))
    counts = np.diff(np.append(starts, at.size))
    return np.fmax.reduceat(levels, starts, axis=0), np.add.reduceat(at, starts) / counts


def _top(part: Trace) -> float:
    """The highest frequency that is shown, Hz."""
    return min(SHOWN_TO, 0.5 / metrics.sample_step(part.time))


def _over_frequency(
    groups: Sequence[tuple[str, Mapping[str, metrics.Spectrum]]], top: float, marks: Sequence[Mark], kind: Kind
) -> Chart:
    """Levels over frequency (kHz) up to `top` (Hz), one panel for each group: what it is of, spectra by channel."""
    panels = []
    for of, found in groups:
        curves = tuple(spectrum_curve(name, own, top, kind) for name, own in found.items())
        panels.append(Panel(f"{of}level in {kind.label}", curves, marks=tuple(marks), limits=level_limits(curves)))
    return Chart(tuple(panels), "frequency in kHz", "frequency", x_limits=(0.0, top / 1e3))


def spectrum_curve(name: str, spectrum: metrics.Spectrum, top: float, kind: Kind = FORCES) -> Curve:
    """Level of a spectrum over frequency (kHz) up to `top` (Hz), without its mean."""
    inside = (spectrum.frequency > 0) & (spectrum.frequency <= top)
    level = kind.level(spectrum.amplitude[inside])
    return Curve(spectrum.frequency[inside] / 1e3, level, name, kind.label)


def _order_marks(run: Run, mesh: str, top: float) -> list[Mark]:
    """Marks of the orders of an engagement at the median speed below `top` (Hz), where the speed within the window is
    steady; else none."""
    time, angle = run.trace.time, run.angles[mesh]
    frequency = np.interp(run.part.time, time, np.gradient(angle, time)) / (2 * np.pi)
    if not steady(frequency):
        return []
    several, middle = len(meshes(run.trace)) > 1, np.percentile(frequency, 50)
    highest = min(int(top / middle), 3 if several else 24)
    return [Mark(k * middle / 1e3, f"{mesh} {k}" if several else str(k)) for k in range(1, highest + 1)]


def _order_curves(run: Run, mesh: str, look: str, limit: float) -> list[Curve]:
    """Frequency (kHz) of the first orders of an engagement below `limit` (Hz)."""
    time = run.trace.time
    frequency = np.gradient(run.angles[mesh], time) / (2 * np.pi)
    thin = slice(None, None, max(1, time.size // MOST_COLUMNS))
    found = []
    for order in range(1, ORDERS + 1):
        curve = np.where(order * frequency < limit, order * frequency, np.nan)
        if np.any(np.isfinite(curve)):
            words = f"order {order}" if len(meshes(run.trace)) < 2 else f"{mesh} order {order}"
            found.append(Curve(time[thin], curve[thin] / 1e3, words, "kHz", look))
    return found
