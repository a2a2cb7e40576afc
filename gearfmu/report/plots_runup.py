"""Figures of a run-up of a planetary set: what its orders do while the speed grows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from gearfmu.report import metrics
from gearfmu.report.plots import RPM, Plot
from gearfmu.report.plots_nvh import level_axis
from gearfmu.report.plots_set import PlanetSet, mean_or_sample, on_mounts
from gearfmu.report.signals import GEAR_PHI, GEAR_SPEED, Window
from gearfmu.report.style import COLOURS, MUTED, panels, png, styled, svg
from gearfmu.stage.trace import Trace

LEAST_RANGE = 0.3  # of the mean speed, that the carrier gathers in a run-up
BACKWARD = 0.02  # of it: what it may lose on the way, wobble of the drive
MESH_ORDERS = 3
SHOWN_DB = 60
BINS = 160  # windows of the frequency map over the run


@dataclass(frozen=True)
class RunUp:
    """Part of a trace in which the carrier gathers speed. each: mesh frequency over the carrier's; signals (n,) N by
    name."""

    part: Trace
    carrier: str
    each: float
    planets: int
    signals: Mapping[str, np.ndarray]

    @property
    def angle(self) -> np.ndarray:
        """(n,) rad, of the carrier, growing."""
        angle = self.part[f"{self.carrier}{GEAR_PHI}"]
        return angle if angle[-1] > angle[0] else -angle


def run_up(trace: Trace, own: PlanetSet, window: Window) -> RunUp | None:
    """The run-up of a set within `window`; None where its carrier does not gather speed (or lose it) steadily."""
    part, names = trace.window(window.start, window.end), (own.meshing.rotor, own.carrier)
    if any(f"{name}{GEAR_SPEED}" not in part for name in names) or f"{own.carrier}{GEAR_PHI}" not in part:
        return None
    speeds = {name: part[f"{name}{GEAR_SPEED}"] for name in names}
    speed = np.abs(speeds[own.carrier])
    gained, most = speed[-1] - speed[0], max(float(speed.mean()), 1e-9)
    against = speed - np.maximum.accumulate(speed) if gained > 0 else np.minimum.accumulate(speed) - speed
    if abs(gained) < LEAST_RANGE * most or against.min() < -BACKWARD * most or speed.min() < 0.02 * most:
        return None
    each = float(np.median(np.abs(own.meshing.relative(speeds)) / speed)) * own.meshing.teeth
    signals = {name: values for name, values in on_mounts(part).items() if name.endswith("x")}
    signals |= {f"{mesh}.force": _mesh_force(part, mesh) for mesh in _first_meshes(own) if f"{mesh}.force" in part}
    return RunUp(part, own.carrier, each, len(own.planets), signals) if signals else None


def _first_meshes(own: PlanetSet) -> list[str]:
    return [next(iter(meshes.values())) for meshes in own.meshes.values()]


def _mesh_force(part: Trace, mesh: str) -> np.ndarray:
    return mean_or_sample(part, f"{mesh}.force")


def order_maps(run: RunUp) -> Plot:
    """Level of every signal over order and speed of the carrier."""
    highest = (MESH_ORDERS + 0.3) * run.each
    maps = {n: metrics.order_map(run.part.time, v, run.angle, highest) for n, v in run.signals.items()}
    with styled():
        figure, axes = panels((2.7,) * len(maps))
        for axis, (name, found) in zip(axes, maps.items(), strict=True):
            _image(axis, (found.order, found.speed * RPM, found.amplitude), name)
            axis.set(xlim=(0, highest), ylabel="speed of the carrier in rpm")
            _mark_orders(axis, run)
        axes[-1].set_xlabel("order of the carrier")
        picture = png(figure)
    first = next(iter(maps.values()))
    caption = (
        f"Orders per revolution of the carrier, Hann windows of {1 / first.order[1]:.0f} revolutions. Marked at the "
        f"top: mesh orders k × {run.each:g} and, thin, their sidebands ± {run.planets} of the planets' passing. What "
        "stands upright goes with the speed; a resonance lies on a hyperbola, frequency over speed."
    )
    data = {"speed_[rpm]": np.repeat(first.speed * RPM, first.order.size)}
    data |= {"order": np.tile(first.order, first.speed.size)}
    data |= {f"{name}_rms_[N]": found.amplitude.ravel() for name, found in maps.items()}
    return Plot("orders_map", "Order map", caption, picture, data)


def frequency_maps(run: RunUp) -> Plot:
    """Level of every signal over frequency and speed of the carrier: the Campbell diagram of the run."""
    step, samples = metrics.sample_step(run.part.time), run.part.time.size
    size = min(samples, 2 ** max(6, round(np.log2(samples / 40))))
    maps = {n: metrics.spectrogram(v, step, size, max(1, (samples - size) // BINS)) for n, v in run.signals.items()}
    top = min((MESH_ORDERS + 0.3) * run.each * _fastest(run), 0.5 / step)
    with styled():
        figure, axes = panels((2.7,) * len(maps))
        for axis, (name, found) in zip(axes, maps.items(), strict=True):
            speed = _speed_at(run, found.time)
            kept = found.frequency <= top
            _image(axis, (speed * RPM, found.frequency[kept] / 1e3, found.amplitude[:, kept].T), name)
            axis.set(xlim=(speed.min() * RPM, speed.max() * RPM), ylim=(0, top / 1e3), ylabel="frequency in kHz")
            _rays(axis, run)
        axes[-1].set_xlabel("speed of the carrier in rpm")
        picture = png(figure)
    first = next(iter(maps.values()))
    caption = (
        f"Hann windows of {size * step * 1e3:.0f} ms, resolution {first.frequency[1]:.0f} Hz. Dashed: mesh orders "
        f"k·f_m, f_m = {run.each:g} f_c; thin: k·f_m ± {run.planets} f_c. What lies level is a resonance."
    )
    speed, kept = _speed_at(run, first.time) * RPM, first.frequency <= top
    data = {"speed_[rpm]": np.repeat(speed, kept.sum()), "frequency_[Hz]": np.tile(first.frequency[kept], speed.size)}
    data |= {f"{name}_rms_[N]": found.amplitude[:, kept].ravel() for name, found in maps.items()}
    return Plot("spectrogram_speed", "Campbell diagram of the run-up", caption, picture, data)


def order_levels(run: RunUp) -> Plot:
    """Level of the first mesh orders and of the sidebands of each over the speed."""
    found, data = {}, {}
    for name, values in run.signals.items():
        orders = metrics.order_map(run.part.time, values, run.angle, (MESH_ORDERS + 0.3) * run.each)
        data["speed_[rpm]"] = orders.speed * RPM
        for label, chosen in _bands(run).items():
            near = np.any([np.abs(orders.order - order) < 0.6 for order in chosen], axis=0)
            lines = np.sqrt(np.sum(orders.amplitude[:, near] ** 2, axis=1) / metrics.HANN_NOISE_BANDWIDTH)
            found.setdefault(name, {})[label] = lines
            data[f"{name} {label}_rms_[N]"] = lines
    with styled():
        figure, axes = panels((1.9,) * len(found))
        for axis, (name, lines) in zip(axes, found.items(), strict=True):
            for k, (label, amplitude) in enumerate(lines.items()):
                look = {"ls": ":", "lw": 1.0} if "±" in label else {}
                colour = COLOURS[k // 2 % len(COLOURS)]
                axis.plot(data["speed_[rpm]"], metrics.level(amplitude), label=label, color=colour, **look)
            level_axis(axis, "dB re 1 N")
            axis.set_title(name, loc="right", color=MUTED)
        axes[-1].set_xlabel("speed of the carrier in rpm")
        picture = svg(figure, "orders_speed")
    caption = (
        f"Level within ±½ order of k × {run.each:g} orders of the carrier, dotted of both its sidebands "
        f"± {run.planets} together. A peak is a resonance that the order meets."
    )
    return Plot("orders_speed", "Mesh orders over the speed", caption, picture, data)


def _bands(run: RunUp) -> dict[str, tuple[float, ...]]:
    """Orders of the carrier by label."""
    found: dict[str, tuple[float, ...]] = {}
    for k in range(1, MESH_ORDERS + 1):
        found[f"order {k}"] = (k * run.each,)
        found[f"{k} ± {run.planets}"] = (k * run.each - run.planets, k * run.each + run.planets)
    return found


def _image(axis: Axes, cells: tuple[np.ndarray, np.ndarray, np.ndarray], name: str) -> None:
    """cells: x (X,), y (Y,), amplitude (Y, X) rms."""
    x, y, amplitude = cells
    values = metrics.level(amplitude)
    best = np.nanpercentile(values, 99.9)
    top = float(np.ceil(best / 5) * 5)
    image = axis.pcolormesh(x, y, values, vmin=top - SHOWN_DB, vmax=top, shading="nearest")
    axis.figure.colorbar(image, ax=axis, label="dB re 1 N", pad=0.01, aspect=22)
    axis.set_title(name, loc="left")
    axis.grid(False)


def _mark_orders(axis: Axes, run: RunUp) -> None:
    for k in range(1, MESH_ORDERS + 1):
        for order, width in ((0, 1.6), (-run.planets, 0.8), (run.planets, 0.8)):
            at = k * run.each + order
            axis.plot([at, at], [1.0, 1.05], transform=axis.get_xaxis_transform(), color=MUTED, lw=width, clip_on=False)


def _rays(axis: Axes, run: RunUp) -> None:
    ends = np.array(axis.get_xlim())
    for k in range(1, MESH_ORDERS + 1):
        axis.plot(ends, k * run.each * ends / 60e3, color="white", lw=0.8, ls=(0, (4, 4)), alpha=0.7)
        for side in (-1, 1):
            axis.plot(ends, (k * run.each + side * run.planets) * ends / 60e3, color="white", lw=0.4, alpha=0.4)


def _speed_at(run: RunUp, centres: np.ndarray) -> np.ndarray:
    """Speed (rad/s) at times (s) after the beginning of the part."""
    speed = np.abs(run.part[f"{run.carrier}{GEAR_SPEED}"])
    return np.interp(centres + run.part.time[0], run.part.time, speed)


def _fastest(run: RunUp) -> float:
    """Hz."""
    return float(np.abs(run.part[f"{run.carrier}{GEAR_SPEED}"]).max()) / (2 * np.pi)


FIGURES = (frequency_maps, order_maps, order_levels)
