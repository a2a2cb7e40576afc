"""Figures of a run-up of a planetary set: what its orders do while the speed grows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gearfmu.report import metrics
from gearfmu.report.plots import RPM, Plot
from gearfmu.report.plots_nvh import level_axis
from gearfmu.report.plots_set import PlanetSet, mean_or_sample, on_mounts
from gearfmu.report.ring_pickup import rim_velocity
from gearfmu.report.signals import GEAR_PHI, GEAR_SPEED, Window
from gearfmu.report.style import COLOURS, MUTED, panels, png, styled, svg
from gearfmu.stage.trace import Trace

LEAST_RANGE = 0.3  # of the mean speed, that the carrier gathers in a run-up
BACKWARD = 0.02  # of it: what it may lose on the way, wobble of the drive
SLOWEST = 0.02  # of it: slower than that there are no orders
WHOLE = 0.01  # a mesh frequency over the carrier's that is so near a whole number is that
MESH_ORDERS = 3
SHOWN_DB = 60
BINS = 160  # windows of the frequency map over the run
PICKUP = "pickup on the ring"


@dataclass(frozen=True)
class Signal:
    """values (n,); unit, and what its level refers to; sides: for every mesh order the orders beside it, of the
    carrier, that the signal has by the passing of the planets."""

    values: np.ndarray
    unit: str
    reference: float
    sides: Mapping[int, tuple[float, ...]]
    averaged: float = 0.0  # s, over which every sample is a mean

    def level(self, amplitude: np.ndarray) -> np.ndarray:
        """Level in dB."""
        return metrics.level(amplitude, self.reference)

    @property
    def label(self) -> str:
        """Of a level."""
        return f"dB re {self.reference:g} {self.unit}"


@dataclass(frozen=True)
class RunUp:
    """Part of a trace in which the carrier gathers speed. each: mesh frequency over the carrier's; signals by name."""

    part: Trace
    carrier: str
    each: float
    signals: Mapping[str, Signal]

    @cached_property
    def orders(self) -> dict[str, metrics.OrderMap]:
        """The order map of every signal."""
        angle, time = self.part[f"{self.carrier}{GEAR_PHI}"], self.part.time
        angle = angle if angle[-1] > angle[0] else -angle
        highest = (MESH_ORDERS + 0.3) * self.each
        return {
            name: metrics.order_map(time, own.values, angle, highest, averaged=own.averaged)
            for name, own in self.signals.items()
        }


def run_up(
    trace: Trace, own: PlanetSet, window: Window, spec: Any = None, bodies: Sequence[Any] | None = None
) -> RunUp | None:
    """The run-up of a set within `window`; None where its carrier does not gather speed (or lose it) steadily. spec and
    bodies: for the pickup on the ring."""
    part, names = trace.window(window.start, window.end), (own.meshing.rotor, own.carrier)
    if any(f"{name}{GEAR_SPEED}" not in part for name in names) or f"{own.carrier}{GEAR_PHI}" not in part:
        return None
    speeds = {name: part[f"{name}{GEAR_SPEED}"] for name in names}
    speed = np.abs(speeds[own.carrier])
    gained, most = speed[-1] - speed[0], max(float(speed.mean()), 1e-9)
    against = speed - np.maximum.accumulate(speed) if gained > 0 else np.minimum.accumulate(speed) - speed
    if abs(gained) < LEAST_RANGE * most or against.min() < -BACKWARD * most or speed.min() < SLOWEST * most:
        return None
    each = float(np.mean(np.abs(own.meshing.relative(speeds)))) / most * own.meshing.teeth
    each = round(each) if abs(each - round(each)) < WHOLE else each
    signals = _signals(part, own, each)
    velocity = None if spec is None or not bodies else rim_velocity(part, own, spec, bodies)
    if velocity is not None:
        beside = {k: passing_orders(k * each, len(own.planets)) for k in range(1, MESH_ORDERS + 1)}
        signals = {PICKUP: Signal(velocity, "m/s", 1e-9, beside)} | signals
    return RunUp(part, own.carrier, each, signals) if signals else None


def _signals(part: Trace, own: PlanetSet, each: float) -> dict[str, Signal]:
    """Force of the ring on its mounts, whose direction goes round with the carrier, and a mesh of every central
    gear."""
    around = {k: (k * each - 1.0, k * each + 1.0) for k in range(1, MESH_ORDERS + 1)}
    step = {True: metrics.sample_step(part.time), False: 0.0}
    found = {
        name: Signal(values, "N", 1.0, around, step[f"{name}_mean" in part])
        for name, values in on_mounts(part).items()
        if name[-1] == "x"
    }
    meshes = [next(iter(meshes.values())) for meshes in own.meshes.values()]
    forces = {f"{mesh}.force": mean_or_sample(part, f"{mesh}.force") for mesh in meshes if f"{mesh}.force" in part}
    return found | {name: Signal(values, "N", 1.0, {}, step[f"{name}_mean" in part]) for name, values in forces.items()}


def passing_orders(order: float, planets: int) -> tuple[float, ...]:
    """Orders of the carrier beside a mesh order that equal planets make at a place on the ring: the nearest ones that
    the number of planets divides (the mesh order itself is not among them)."""
    below, above = np.ceil(order / planets) - 1, np.floor(order / planets) + 1
    return float(below * planets), float(above * planets)


def frequency_maps(run: RunUp) -> Plot:
    """Level of every signal over frequency and speed of the carrier: the Campbell diagram of the run."""
    step, samples = metrics.sample_step(run.part.time), run.part.time.size
    size = min(samples, 2 ** max(6, round(np.log2(samples / 40))))
    hop = max(1, (samples - size) // BINS)
    maps = {name: metrics.spectrogram(own.values, step, size, hop, own.averaged) for name, own in run.signals.items()}
    top = min((MESH_ORDERS + 0.3) * run.each * _fastest(run), 0.5 / step)
    first = next(iter(maps.values()))
    speed, kept = _speed_at(run, first.time) * RPM, first.frequency <= top
    with styled():
        figure, axes = panels((2.7,) * len(maps))
        for axis, (name, found) in zip(axes, maps.items(), strict=True):
            _image(axis, (speed, found.frequency[kept] / 1e3, found.amplitude[:, kept].T), (name, run.signals[name]))
            axis.set(xlim=(speed.min(), speed.max()), ylim=(0, top / 1e3), ylabel="frequency in kHz")
            _rays(axis, run)
        axes[-1].set_xlabel("speed of the carrier in rpm")
        picture = png(figure)
    caption = (
        f"Hann windows of {size * step * 1e3:.0f} ms, resolution {first.frequency[1]:.0f} Hz. Dashed: mesh orders "
        f"k·f_m, f_m = {run.each:.6g} f_c. What lies level is a resonance.{_about_pickup(run)}"
    )
    data = {"speed_[rpm]": np.repeat(speed, kept.sum()), "frequency_[Hz]": np.tile(first.frequency[kept], speed.size)}
    data |= {_column(run, name): found.amplitude[:, kept].ravel() for name, found in maps.items()}
    return Plot("spectrogram_speed", "Campbell diagram of the run-up", caption, picture, data)


def order_maps(run: RunUp) -> Plot:
    """Level of every signal over order and speed of the carrier."""
    with styled():
        figure, axes = panels((2.7,) * len(run.orders))
        for axis, (name, found) in zip(axes, run.orders.items(), strict=True):
            _image(axis, (found.order, found.speed * RPM, found.amplitude), (name, run.signals[name]))
            axis.set(xlim=(0, (MESH_ORDERS + 0.3) * run.each), ylabel="speed of the carrier in rpm")
            _mark_orders(axis, run, run.signals[name])
        axes[-1].set_xlabel("order of the carrier")
        picture = png(figure)
    first = next(iter(run.orders.values()))
    caption = (
        f"Orders per revolution of the carrier, Hann windows of {1 / first.order[1]:.0f} revolutions. Marked at the "
        f"top: mesh orders k × {run.each:.6g} and, thin, what the passing of the planets makes beside them. What "
        "stands upright goes with the speed; a resonance lies on a hyperbola, frequency over speed."
    )
    data = {"speed_[rpm]": np.repeat(first.speed * RPM, first.order.size)}
    data |= {"order": np.tile(first.order, first.speed.size)}
    data |= {_column(run, name): found.amplitude.ravel() for name, found in run.orders.items()}
    return Plot("orders_map", "Order map", caption, picture, data)


def order_levels(run: RunUp) -> Plot:
    """Level of the first mesh orders, and of what is beside each, over the speed."""
    speed = next(iter(run.orders.values())).speed * RPM
    found = {name: _bands(run, name) for name in run.signals}
    with styled():
        figure, axes = panels((1.9,) * len(found))
        for axis, (name, bands) in zip(axes, found.items(), strict=True):
            for label, amplitude in bands.items():
                order = int(label.split()[-1])
                look = {"ls": ":", "lw": 1.3} if label.startswith("beside") else {"lw": 1.1}
                axis.plot(speed, run.signals[name].level(amplitude), label=label, color=COLOURS[order - 1], **look)
            level_axis(axis, run.signals[name].label)
            axis.set_title(name, loc="right", color=MUTED)
        axes[-1].set_xlabel("speed of the carrier in rpm")
        picture = svg(figure, "orders_speed")
    caption = (
        f"Level within half an order of k × {run.each:.6g} orders of the carrier; dotted the orders beside it that are "
        "marked in the order map, together. A peak is a resonance that the order meets."
    )
    data = {"speed_[rpm]": speed}
    data |= {f"{label} of {_column(run, name)}": a for name, bands in found.items() for label, a in bands.items()}
    return Plot("orders_speed", "Mesh orders over the speed", caption, picture, data)


def _bands(run: RunUp, name: str) -> dict[str, np.ndarray]:
    """Rms amplitude (T,) of every mesh order and of the orders beside it, by label."""
    wanted: dict[str, tuple[float, ...]] = {f"order {k}": (k * run.each,) for k in range(1, MESH_ORDERS + 1)}
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
    marks = [(k * run.each, 1.6) for k in range(1, MESH_ORDERS + 1)]
    marks += [(order, 0.8) for orders in own.sides.values() for order in orders]
    for at, width in marks:
        axis.plot([at, at], [1.0, 1.05], transform=axis.get_xaxis_transform(), color=MUTED, lw=width, clip_on=False)


def _rays(axis: Axes, run: RunUp) -> None:
    ends = np.array(axis.get_xlim())
    for k in range(1, MESH_ORDERS + 1):
        axis.plot(ends, k * run.each * ends / 60e3, color="white", lw=0.8, ls=(0, (2, 6)), alpha=0.6)


def _speed_at(run: RunUp, centres: np.ndarray) -> np.ndarray:
    """Speed (rad/s) at times (s) after the beginning of the part."""
    speed = np.abs(run.part[f"{run.carrier}{GEAR_SPEED}"])
    return np.interp(centres + run.part.time[0], run.part.time, speed)


def _fastest(run: RunUp) -> float:
    """Hz."""
    return float(np.abs(run.part[f"{run.carrier}{GEAR_SPEED}"]).max()) / (2 * np.pi)


FIGURES = (frequency_maps, order_maps, order_levels)
