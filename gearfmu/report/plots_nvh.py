"""Figures over frequency: spectra of the bearing and mesh forces, cuts along mesh orders, spectrogram."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gearfmu.report import metrics
from gearfmu.report.plots import Plot, of_mesh
from gearfmu.report.signals import Window, bearings, meshes
from gearfmu.report.style import INK, MUTED, panels, png, styled, svg
from gearfmu.stage.trace import Trace

RANGE_DB = 90
ORDERS = 5
TRUSTED_FROM = 20e3  # Hz; sampling that ends below it gets a warning
DASHES = ((0, (4, 4)), (0, (1, 3)))  # of the orders of one mesh and the next
MEANS = "Channels …_mean are means over the communication step, their averaging taken out. "
SHOWN_TO = 12e3  # Hz; the data go on to half the sampling rate


def force_channels(trace: Trace) -> list[str]:
    """The channels whose sound matters: bearing forces, then mesh forces. Where the mean over the communication step
    was recorded ("…_mean") it stands for the sample at its end: averaging weakens what would fold back."""
    names = [f"bearing.{name}.{direction}" for name in bearings(trace) for direction in ("fx", "fy")]
    names += [f"{mesh}.force" for mesh in meshes(trace)]
    best = [next((n for n in (f"{name}_mean", name) if n in trace), None) for name in names]
    return [name for name in best if name is not None]


def averaging(trace: Trace, name: str) -> float:
    """Time (s) over which a sample of the channel is a mean: the communication step of "…_mean", else 0."""
    return metrics.sample_step(trace.time) if name.endswith("_mean") else 0.0


def spectrum_of(part: Trace, name: str, size: int | None = None) -> metrics.Spectrum:
    """Spectrum of a channel over the whole of `part`; of a mean over the step as it is without the averaging."""
    step = metrics.sample_step(part.time)
    return metrics.amplitude_spectrum(part[name], step, size, averaging(part, name))


def force_spectrum(trace: Trace, window: Window, angles: Mapping[str, np.ndarray]) -> Plot | None:
    """Level of every bearing and mesh force over frequency, mesh orders marked; None without forces. angles: mesh angle
    (n,) rad by engagement."""
    names = force_channels(trace)
    if not names:
        return None
    part = trace.window(window.start, window.end)
    step = metrics.sample_step(part.time)
    spectra = {name: spectrum_of(part, name, segment(part.time.size)) for name in names}
    groups = _by_part(names)
    with styled():
        figure, axes = panels((1.7,) * len(groups) if len(groups) > 1 else (2.6,))
        for axis, group in zip(axes, groups, strict=True):
            for name in group:
                spectrum = spectra[name]
                axis.plot(spectrum.frequency[1:] / 1e3, metrics.level(spectrum.amplitude[1:]), label=name, lw=0.9)
            level_axis(axis, "dB re 1 N")
            axis.set_xlim(0, min(SHOWN_TO, 0.5 / step) / 1e3)
            marked = [mesh for mesh, angle in angles.items() if _mark_orders(axis, part.time, trace, (mesh, angle))]
        axes[-1].set_xlabel("frequency in kHz")
        picture = svg(figure, "spectrum")
    first = next(iter(spectra.values()))
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
    return Plot("spectrum", "Spectra of the forces", caption, picture, _spectrum_columns(spectra))


def order_cuts(trace: Trace, mesh: str, mesh_angle: np.ndarray) -> Plot | None:
    """Level of the first orders of an engagement in its force and every bearing force along the run; None without
    forces. mesh_angle (n,) rad: of this engagement."""
    others = tuple(f"{other}." for other in meshes(trace) if other != mesh)
    names = [name for name in force_channels(trace) if not name.startswith(others)]
    names = [name for name in names if ".fx" not in name or len(bearings(trace)) < 2]
    if not names:
        return None
    file = "orders" if not others else f"orders_{mesh}"
    cuts = {
        name: metrics.order_cuts(trace.time, trace[name], mesh_angle, ORDERS, averaged=averaging(trace, name))
        for name in names
    }
    _require_order(next(iter(cuts.values())), mesh, metrics.sample_step(trace.time))
    with styled():
        figure, axes = panels((1.6,) * len(cuts))
        for axis, (name, cut) in zip(axes, cuts.items(), strict=True):
            for row, order in enumerate(cut.orders):
                if np.any(np.isfinite(cut.amplitude[row])):
                    axis.plot(cut.time, metrics.level(cut.amplitude[row]), label=f"order {order}")
            level_axis(axis, "dB re 1 N", trace.time[-1])
            axis.set_title(name, loc="left", color=INK)
        axes[0].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=ORDERS, borderaxespad=0.1)
        axes[-1].set_xlabel("time in s")
        picture = svg(figure, file)
    first = next(iter(cuts.values()))
    low, high = first.mesh_frequency.min(), first.mesh_frequency.max()
    caption = (
        f"Mesh order k = k × mesh frequency, which runs from {low:.0f} to {high:.0f} Hz; Hann window of 8 mesh "
        "periods in "
        "angle, so an order keeps its level while the speed changes. Orders above 0.45 of the sampling rate are "
        "left out."
    )
    title = of_mesh(trace, mesh, "Mesh orders along the run")
    return Plot(file, title, caption, picture, _order_columns(cuts))


def force_spectrogram(trace: Trace, angles: Mapping[str, np.ndarray]) -> Plot | None:
    """Level of one force over time and frequency with the mesh orders on top: a bearing force, or in a coarsely sampled
    trace a mean over the step, which folds less; None without forces. angles: mesh angle (n,) rad by engagement."""
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
    values = metrics.level(picture_data.amplitude)
    top = float(np.ceil(values.max() / 5) * 5)
    with styled():
        figure, (axis,) = panels((3.3,))
        time = picture_data.time + trace.time[0]
        image = axis.pcolormesh(
            time, picture_data.frequency / 1e3, values.T, vmin=top - RANGE_DB, vmax=top, shading="nearest"
        )
        figure.colorbar(image, ax=axis, label="level in dB re 1 N", pad=0.01, aspect=30)
        axis.grid(False)
        axis.set(
            xlabel="time in s",
            ylabel="frequency in kHz",
            xlim=(time[0], time[-1]),
            ylim=(0, 1e-3 * min(SHOWN_TO, 0.5 / step)),
        )
        for style, angle in zip(cycle(DASHES), angles.values()):  # noqa: B905 – as many as there are meshes
            _overlay_orders(axis, trace, (angle, style), min(SHOWN_TO, 0.5 / step))
        picture = png(figure)
    caption = (
        f"{name}; Hann windows of {window_size * step * 1e3:.1f} ms, resolution {picture_data.frequency[1]:.0f} Hz. "
        f"Dashed: orders {' and, dotted, '.join(f'of {mesh}' for mesh in angles) or 'of the mesh'} from the speed."
    )
    data = {
        "time_[s]": np.repeat(time, picture_data.frequency.size),
        "frequency_[Hz]": np.tile(picture_data.frequency, time.size),
        "level_[dB re 1 N]": values.ravel(),
    }
    return Plot("spectrogram", "Spectrogram", caption, picture, data)


def octave_table(trace: Trace, window: Window) -> dict[str, dict[float, float]]:
    """Octave-band levels in dB re 1 N by channel over `window`, from one full-length Hann window."""
    part = trace.window(window.start, window.end)
    return {name: metrics.octave_levels(spectrum_of(part, name)) for name in force_channels(trace)}


def _by_part(names: list[str]) -> list[list[str]]:
    """The channels of one bearing, or of the mesh, share a panel."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(name.rsplit(".", 1)[0], []).append(name)
    return list(groups.values())


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


def _require_order(cuts: metrics.OrderCuts, mesh: str, step: float) -> None:
    """MetricsError where not even the first order lies below the sampling limit anywhere in the run."""
    if not np.any(np.isfinite(cuts.amplitude)):
        lowest = float(cuts.mesh_frequency.min())
        raise metrics.MetricsError(
            f"Mesh orders of {mesh}: its mesh frequency, {lowest:.0f} Hz and more, lies above 0.45 of the sampling "
            f"rate, {0.45 / step:.0f} Hz. Run again with a communication step of {0.45e6 / lowest / 5:.2g} µs for the "
            "first five orders."
        )


def level_axis(axis: Axes, label: str, end: float | None = None) -> None:
    """Limit the level axis to RANGE_DB below the highest line, so that a silent line does not squeeze the rest."""
    shown = [line.get_ydata() for line in axis.lines if np.any(np.isfinite(line.get_ydata()))]
    if shown:
        top = np.ceil((max(map(np.nanmax, shown)) + 3) / 10) * 10
        axis.set_ylim(max(np.floor((min(map(np.nanmin, shown)) - 3) / 10) * 10, top - RANGE_DB), top)
    axis.set_ylabel(label)
    axis.margins(x=0)
    if end is not None:
        axis.set_xlim(0, end)
    elif axis.lines:
        axis.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=5, borderaxespad=0.1)


def _mark_orders(axis: Axes, time: np.ndarray, trace: Trace, mesh: tuple[str, np.ndarray]) -> bool:
    """Mark the orders of an engagement (name, mesh angle) at the median speed, if nine tenths of the window stay within
    10 %; whether there was one to mark."""
    name, angle = mesh
    frequency = np.interp(time, trace.time, np.gradient(angle, trace.time)) / (2 * np.pi)
    low, middle, high = np.percentile(frequency, [5, 50, 95])
    if middle <= 0 or high - low > 0.1 * middle:
        return False
    several = len(meshes(trace)) > 1
    highest = min(int(axis.get_xlim()[1] * 1e3 / middle), 3 if several else 24)
    for order in range(1, highest + 1):
        axis.axvline(order * middle / 1e3, color=MUTED, lw=0.7, ls=":", zorder=0)
        axis.annotate(
            f"{name} {order}" if several else str(order),
            (order * middle / 1e3, 1),
            (3, -9),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            fontsize=8,
            color=MUTED,
        )
    return highest > 0


def _overlay_orders(axis: Axes, trace: Trace, mesh: tuple[np.ndarray, Any], limit: float) -> None:
    """Curves of the first orders below `limit` (Hz). mesh: mesh angle (n,) rad, line style."""
    angle, style = mesh
    frequency = np.gradient(angle, trace.time) / (2 * np.pi)
    for order in range(1, ORDERS + 1):
        curve = np.where(order * frequency < limit, order * frequency, np.nan)
        if np.any(np.isfinite(curve)):
            axis.plot(trace.time, curve / 1e3, color="white", lw=0.8, ls=style, alpha=0.75)
            last = np.flatnonzero(np.isfinite(curve))[-1]
            x = min(trace.time[last], axis.get_xlim()[1])
            axis.annotate(
                f"{order}", (x, curve[last] / 1e3), (-9, 3), textcoords="offset points", color="white", fontsize=8.5
            )


def _spectrum_columns(spectra: Mapping[str, metrics.Spectrum]) -> dict[str, np.ndarray]:
    found = {"frequency_[Hz]": next(iter(spectra.values())).frequency}
    for name, spectrum in spectra.items():
        found[f"{name}_rms_[N]"] = spectrum.amplitude
        found[f"{name}_[dB re 1 N]"] = metrics.level(spectrum.amplitude)
    return found


def _order_columns(cuts: Mapping[str, metrics.OrderCuts]) -> dict[str, np.ndarray]:
    first = next(iter(cuts.values()))
    found = {"time_[s]": first.time, "mesh_frequency_[Hz]": first.mesh_frequency}
    for name, cut in cuts.items():
        for row, order in enumerate(cut.orders):
            found[f"{name}_order_{order}_rms_[N]"] = cut.amplitude[row]
    return found
