"""Figures of a run-up: what the orders of a stage do while the speed grows."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from gearfmu.report import metrics
from gearfmu.report.plots import RPM, Plot
from gearfmu.report.plots_nvh import level_axis
from gearfmu.report.runup import PICKUP, RunUp, Signal
from gearfmu.report.signals import GEAR_PHI, GEAR_SPEED
from gearfmu.report.style import COLOURS, MUTED, panels, png, styled, svg

SHOWN_DB = 60
BINS = 160  # windows of the frequency map over the run
CROSSED = " Circles: where an order meets a natural frequency of the stage, linearised under its mean load, that a "
CROSSED += "transmission error drives."
MARKED = " Ticks at the top, in the colour of the order: where it meets a natural frequency of the linearised stage."
BESIDE = "; dotted the orders beside it that are marked in the order map, together"
PASSING = " and, thin, what the passing of the planets makes beside them"


def frequency_maps(run: RunUp) -> Plot:
    """Level of every signal over frequency and speed of the shaft: the Campbell diagram of the run."""
    step, samples = metrics.sample_step(run.part.time), run.part.time.size
    size = min(samples, 2 ** max(6, round(np.log2(samples / 40))))
    hop = max(1, (samples - size) // BINS)
    maps = {name: metrics.spectrogram(own.values, step, size, hop, own.averaged) for name, own in run.signals.items()}
    top = min((run.orders_shown + 0.3) * run.each * _fastest(run), 0.5 / step)
    first = next(iter(maps.values()))
    speed, kept = _speed_at(run, first.time, size * step) * RPM, first.frequency <= top
    with styled():
        figure, axes = panels((2.7,) * len(maps))
        for axis, (name, found) in zip(axes, maps.items(), strict=True):
            _image(axis, (speed, found.frequency[kept] / 1e3, found.amplitude[:, kept].T), (name, run.signals[name]))
            axis.set(xlim=(speed.min(), speed.max()), ylim=(0, top / 1e3), ylabel="frequency in kHz")
            _rays(axis, run)
            _circles(axis, run)
        axes[-1].set_xlabel(f"speed of the {run.shaft} in rpm")
        picture = png(figure)
    caption = (
        f"Hann windows of {size * step * 1e3:.0f} ms, resolution {first.frequency[1]:.0f} Hz. Dashed: mesh orders "
        f"k·f_m, f_m = {run.each:.6g} f of the {run.shaft}. What lies level is a resonance."
        f"{CROSSED if run.resonances else ''}{_about_pickup(run)}"
    )
    data = {"speed_[rpm]": np.repeat(speed, kept.sum()), "frequency_[Hz]": np.tile(first.frequency[kept], speed.size)}
    data |= {_column(run, name): found.amplitude[:, kept].ravel() for name, found in maps.items()}
    return Plot("spectrogram_speed", "Campbell diagram of the run-up", caption, picture, data)


def order_maps(run: RunUp) -> Plot:
    """Level of every signal over order and speed of the shaft."""
    with styled():
        figure, axes = panels((2.7,) * len(run.orders))
        for axis, (name, found) in zip(axes, run.orders.items(), strict=True):
            _image(axis, (found.order, found.speed * RPM, found.amplitude), (name, run.signals[name]))
            axis.set(xlim=(0, (run.orders_shown + 0.3) * run.each), ylabel=f"speed of the {run.shaft} in rpm")
            _mark_orders(axis, run, run.signals[name])
        axes[-1].set_xlabel(f"order of the {run.shaft}")
        picture = png(figure)
    first = next(iter(run.orders.values()))
    passing = PASSING if any(own.sides for own in run.signals.values()) else ""
    caption = (
        f"Orders per revolution of the {run.shaft}, Hann windows of {1 / first.order[1]:.0f} revolutions. Marked at "
        f"the top: mesh orders k × {run.each:.6g}{passing}. What stands upright goes with the speed; a resonance lies "
        "on a hyperbola, frequency over speed."
    )
    data = {"speed_[rpm]": np.repeat(first.speed * RPM, first.order.size)}
    data |= {"order": np.tile(first.order, first.speed.size)}
    data |= {_column(run, name): found.amplitude.ravel() for name, found in run.orders.items()}
    return Plot("orders_map", "Order map", caption, picture, data)


def order_levels(run: RunUp) -> Plot:
    """Level of the first mesh orders, and of what is beside each, over the speed."""
    speed = next(iter(run.orders.values())).speed * RPM
    found = {name: _bands(run, name) for name in run.signals}
    beside = any(own.sides for own in run.signals.values())
    with styled():
        figure, axes = panels((1.9,) * len(found))
        for axis, (name, bands) in zip(axes, found.items(), strict=True):
            for label, amplitude in bands.items():
                order = int(label.split()[-1])
                look = {"ls": ":", "lw": 1.3} if label.startswith("beside") else {"lw": 1.1}
                axis.plot(speed, run.signals[name].level(amplitude), label=label, color=COLOURS[order - 1], **look)
            level_axis(axis, run.signals[name].label)
            _ticks(axis, run, speed)
            axis.set_title(name, loc="right", color=MUTED)
        axes[-1].set_xlabel(f"speed of the {run.shaft} in rpm")
        picture = svg(figure, "orders_speed")
    caption = (
        f"Level within half an order of k × {run.each:.6g} orders of the {run.shaft}{BESIDE if beside else ''}. "
        f"A peak is a resonance that the order meets.{MARKED if run.resonances else ''}"
    )
    data = {"speed_[rpm]": speed}
    data |= {f"{label} of {_column(run, name)}": a for name, bands in found.items() for label, a in bands.items()}
    return Plot("orders_speed", "Mesh orders over the speed", caption, picture, data)


def _bands(run: RunUp, name: str) -> dict[str, np.ndarray]:
    """Rms amplitude (T,) of every mesh order and of the orders beside it, by label."""
    wanted: dict[str, tuple[float, ...]] = {f"order {k}": (k * run.each,) for k in range(1, run.orders_shown + 1)}
    wanted |= {f"beside {k}": orders for k, orders in run.signals[name].sides.items()}
    found, orders = {}, run.orders[name]
    for label, chosen in wanted.items():
        near = np.any([np.abs(orders.order - order) < 0.5 for order in chosen], axis=0)
        found[label] = np.sqrt(np.sum(orders.amplitude[:, near] ** 2, axis=1) / metrics.HANN_NOISE_BANDWIDTH)
    return found


def _column(run: RunUp, name: str) -> str:
    return f"{name}_rms_[{run.signals[name].unit}]"


def _about_pickup(run: RunUp) -> str:
    about = (
        " Pickup: radial velocity of the rim on +x, made of the forces of the ring's meshes by the ring's own modes."
    )
    return about if PICKUP in run.signals else ""


def _image(axis: Axes, cells: tuple[np.ndarray, np.ndarray, np.ndarray], named: tuple[str, Signal]) -> None:
    """cells: x (X,), y (Y,), amplitude (Y, X) rms."""
    (x, y, amplitude), (name, own) = cells, named
    values = own.level(amplitude)
    top = float(np.ceil(np.nanpercentile(values, 99.9) / 5) * 5)
    image = axis.pcolormesh(x, y, values, vmin=top - SHOWN_DB, vmax=top, shading="nearest")
    axis.figure.colorbar(image, ax=axis, label=own.label, pad=0.01, aspect=22)
    axis.set_title(name, loc="left")
    axis.grid(False)


def _mark_orders(axis: Axes, run: RunUp, own: Signal) -> None:
    marks = [(k * run.each, 1.6) for k in range(1, run.orders_shown + 1)]
    marks += [(order, 0.8) for orders in own.sides.values() for order in orders]
    for at, width in marks:
        axis.plot([at, at], [1.0, 1.05], transform=axis.get_xaxis_transform(), color=MUTED, lw=width, clip_on=False)


def _rays(axis: Axes, run: RunUp) -> None:
    ends = np.array(axis.get_xlim())
    for k in range(1, run.orders_shown + 1):
        axis.plot(ends, k * run.each * ends / 60e3, color="white", lw=0.8, ls=(0, (2, 6)), alpha=0.6)


def crossings(run: RunUp) -> list[tuple[int, float, float]]:
    """(mesh order, frequency in Hz, speed in rpm) where an order meets a natural frequency."""
    orders = range(1, run.orders_shown + 1)
    return [(k, f, 60 * f / (k * run.each)) for f in run.resonances for k in orders]


def _circles(axis: Axes, run: RunUp) -> None:
    (low, high), (_, top) = axis.get_xlim(), axis.get_ylim()
    for _, frequency, rpm in crossings(run):
        if low <= rpm <= high and frequency <= 1e3 * top:
            axis.plot(rpm, frequency / 1e3, "o", ms=5, mfc="none", mec="white", mew=0.9)


def _ticks(axis: Axes, run: RunUp, speed: np.ndarray) -> None:
    for order, _, rpm in crossings(run):
        if speed.min() <= rpm <= speed.max():
            axis.plot([rpm, rpm], [0.94, 1.0], transform=axis.get_xaxis_transform(), color=COLOURS[order - 1], lw=1.4)


def _speed_at(run: RunUp, centres: np.ndarray, width: float) -> np.ndarray:
    """Mean speed (rad/s) over windows of `width` s around times (s) after the beginning of the part: what the shaft
    turns in them, free of its vibration."""
    time, angle = run.part.time - run.part.time[0], run.part[f"{run.shaft}{GEAR_PHI}"]
    ends = [np.clip(centres + side * width, 0.0, time[-1]) for side in (-0.5, 0.5)]
    turned = np.interp(ends[1], time, angle) - np.interp(ends[0], time, angle)
    return np.asarray(np.abs(turned) / (ends[1] - ends[0]))


def _fastest(run: RunUp) -> float:
    """Hz."""
    return float(np.abs(run.part[f"{run.shaft}{GEAR_SPEED}"]).max()) / (2 * np.pi)


FIGURES = (frequency_maps, order_maps, order_levels)
