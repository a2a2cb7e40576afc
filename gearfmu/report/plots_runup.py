"""Figures of a run-up: what the orders of a stage do while the speed grows."""

from __future__ import annotations

import numpy as np

from gearfmu.report import metrics
from gearfmu.report.chart import Chart, Curve, Heat, Mark, Panel, Plot, level_limits
from gearfmu.report.kinds import Kind
from gearfmu.report.names import shown
from gearfmu.report.plots import RPM
from gearfmu.report.plots_nvh import heat_of
from gearfmu.report.runup import RunUp, Signal

BINS = 160  # windows of the frequency map over the run
CROSSED = " Circles: where an order meets a natural frequency of the stage, linearised under its mean load, that a "
CROSSED += "transmission error drives."
MARKED = " Ticks at the top, in the colour of the order: where it meets a natural frequency of the linearised stage."
BESIDE = "; dotted the orders beside it that are marked in the order map, together"
PASSING = " and, light, the side bands of passing planets"


def frequency_maps(run: RunUp) -> Plot:
    """Level of every signal over frequency and speed of the shaft: the Campbell diagram of the run."""
    step, samples = metrics.sample_step(run.part.time), run.part.time.size
    size = min(samples, 2 ** max(6, round(np.log2(samples / 40))))
    hop = max(1, (samples - size) // BINS)
    maps = {name: metrics.spectrogram(own.values, step, size, hop, own.averaged) for name, own in run.signals.items()}
    fastest = float(run.turning.speed.max()) / (2 * np.pi)  # Hz
    top = min(run.highest * fastest, 0.5 / step)
    first = next(iter(maps.values()))
    speed, kept = _speed_at(run, first.time, size * step) * RPM, first.frequency <= top
    ends = np.array([speed.min(), speed.max()])
    rays = tuple(
        Curve(
            ends, order * ends / 60e3, f"{mesh} order {k}".strip(), "kHz", "dotted" if _prime(run, mesh) else "dashed"
        )
        for mesh, k, order in run.mesh_orders
    )
    panels = []
    for name, found in maps.items():
        heat = _heat(speed, found.frequency[kept] / 1e3, found.amplitude[:, kept].T, run.signals[name])
        label, limits = f"{shown(name)}: frequency in kHz", (0.0, top / 1e3)
        panels.append(Panel(label, rays, heat, dots=_circles(run, ends, top), height=250, limits=limits))
    along = f"speed of the {run.shaft} in rpm"
    chart = Chart(tuple(panels), along, "speed", x_limits=(float(ends[0]), float(ends[1])))
    caption = (
        f"Hann windows of {size * step * 1e3:.0f} ms, resolution {first.frequency[1]:.0f} Hz. {_rays(run)} "
        f"Horizontal lines are resonances."
        f"{CROSSED if run.resonances else ''}"
    )
    data = {"speed_[rpm]": np.repeat(speed, kept.sum()), "frequency_[Hz]": np.tile(first.frequency[kept], speed.size)}
    data |= {_column(run, name): found.amplitude[:, kept].ravel() for name, found in maps.items()}
    return Plot("spectrogram_speed", "Campbell diagram of the run-up", caption, chart, data)


def order_maps(run: RunUp) -> Plot:
    """Level of every signal over order and speed of the shaft."""
    panels = []
    for name, found in run.orders.items():
        heat = _heat(found.order, found.speed * RPM, found.amplitude, run.signals[name])
        marks = [Mark(order, f"{k}{_prime(run, mesh)}") for mesh, k, order in run.mesh_orders]
        marks += [Mark(order, "", "side") for orders in run.signals[name].sides.values() for order in orders]
        panels.append(Panel(f"{shown(name)}: speed of the {run.shaft} in rpm", (), heat, tuple(marks), height=250))
    chart = Chart(tuple(panels), f"order of the {run.shaft}", "order", x_limits=(0.0, run.highest))
    first = next(iter(run.orders.values()))
    passing = PASSING if any(own.sides for own in run.signals.values()) else ""
    caption = (
        f"Orders per revolution of the {run.shaft}, Hann windows of {1 / first.order[1]:.0f} revolutions. Marked "
        f"by dotted lines: {_families(run)}{passing}.{_shafts(run)} Vertical lines are orders; a "
        "resonance lies on a hyperbola, frequency over speed."
    )
    data = {"speed_[rpm]": np.repeat(first.speed * RPM, first.order.size)}
    data |= {"order": np.tile(first.order, first.speed.size)}
    data |= {_column(run, name): found.amplitude.ravel() for name, found in run.orders.items()}
    return Plot("orders_map", "Order map", caption, chart, data)


def order_levels(run: RunUp) -> Plot:
    """Level of the first mesh orders, and of what is beside each, over the speed."""
    speed = next(iter(run.orders.values())).speed * RPM
    found = {name: _bands(run, name) for name in run.signals}
    beside = any(own.sides for own in run.signals.values())
    low, high = speed.min(), speed.max()
    ticks = tuple(Mark(rpm, "", "tick", order - 1) for order, _, rpm in crossings(run) if low <= rpm <= high)
    panels = []
    for name, bands in found.items():
        kind = run.signals[name].kind
        curves = tuple(
            _band_curve(speed, label, kind.level(amplitude), kind, k)
            for k, (label, amplitude) in enumerate(bands.items())
        )
        panels.append(Panel(f"{shown(name)}, {kind.label}", curves, marks=ticks, limits=level_limits(curves)))
    chart = Chart(tuple(panels), f"speed of the {run.shaft} in rpm", "speed")
    caption = (
        f"Level within half an order of {_families(run)}, orders of the {run.shaft}{BESIDE if beside else ''}. "
        f"A peak is a resonance that the order meets.{MARKED if run.resonances else ''}"
    )
    data = {"speed_[rpm]": speed}
    data |= {f"{label} of {_column(run, name)}": a for name, bands in found.items() for label, a in bands.items()}
    return Plot("orders_speed", "Mesh orders over the speed", caption, chart, data)


def _bands(run: RunUp, name: str) -> dict[str, np.ndarray]:
    """Rms amplitude (T,) of every mesh order and of the orders beside it, by label."""
    wanted: dict[str, tuple[float, ...]] = {f"{mesh} order {k}".strip(): (at,) for mesh, k, at in run.mesh_orders}
    wanted |= {f"beside {k}": orders for k, orders in run.signals[name].sides.items()}
    found, orders = {}, run.orders[name]
    for label, chosen in wanted.items():
        near = np.any([np.abs(orders.order - order) < 0.5 for order in chosen], axis=0)
        found[label] = np.sqrt(np.sum(orders.amplitude[:, near] ** 2, axis=1) / metrics.HANN_NOISE_BANDWIDTH)
    return found


def _column(run: RunUp, name: str) -> str:
    own = run.signals[name]
    return f"{name}{'_mean' if own.averaged else ''}_rms_[{own.kind.unit}]"


def _heat(x: np.ndarray, y: np.ndarray, amplitude: np.ndarray, own: Signal) -> Heat:
    """A map of amplitude (Y, X) rms, from the highest level SHOWN_DB down."""
    values = own.kind.level(amplitude)
    return heat_of(x, y, values, float(np.nanpercentile(values, 99.9)), own.kind.label)


def _band_curve(speed: np.ndarray, label: str, level: np.ndarray, kind: Kind, number: int) -> Curve:
    beside = label.startswith("beside")
    colour = int(label.split()[-1]) - 1 if beside else number
    return Curve(speed, level, label, kind.label, "dotted" if beside else "", colour)


def crossings(run: RunUp) -> list[tuple[int, float, float]]:
    """(number of the mesh order among those shown, from 1, frequency in Hz, speed in rpm) where an order meets a
    natural frequency."""
    orders = [order for _, _, order in run.mesh_orders]
    return [(k + 1, f, 60 * f / order) for f in run.resonances for k, order in enumerate(orders)]


def _prime(run: RunUp, mesh: str) -> str:
    """What tells the orders of a mesh from those of the first."""
    return "′" * list(run.families).index(mesh)


def _families(run: RunUp) -> str:
    """Mesh orders, in words."""
    if len(run.families) == 1:
        return f"mesh orders k × {run.each:.6g}"
    told = (f"k{_prime(run, mesh)} × {each:.6g} of {mesh}" for mesh, each in run.families.items())
    return f"mesh orders {', '.join(told)}"


def _rays(run: RunUp) -> str:
    """The lines of a Campbell diagram, in words."""
    if len(run.families) == 1:
        return f"Dashed: mesh orders k·f_m, f_m = {run.each:.6g} f of the {run.shaft}."
    first, *others = (f"{each:.6g} f of the {run.shaft} for {mesh}" for mesh, each in run.families.items())
    return f"Mesh orders k·f_m, f_m = {first} (dashed), {', '.join(others)} (dotted)."


def _shafts(run: RunUp) -> str:
    """Orders of the other shafts, in words."""
    told = (f"{order:.4g} ({name})" for name, order in run.others.items())
    return f" Shafts turn at the orders 1 ({run.shaft}), {', '.join(told)}." if run.others else ""


def _circles(run: RunUp, ends: np.ndarray, top: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Speed (rpm) and frequency (kHz) of the crossings within the diagram; None without any."""
    found = [(rpm, f / 1e3) for _, f, rpm in crossings(run) if ends[0] <= rpm <= ends[1] and f <= top]
    return (np.array([rpm for rpm, _ in found]), np.array([f for _, f in found])) if found else None


def _speed_at(run: RunUp, centres: np.ndarray, width: float) -> np.ndarray:
    """Mean speed (rad/s) over windows of `width` s around times (s) after the beginning of the part: what the shaft
    turns in them, free of its vibration."""
    time, angle = run.part.time - run.part.time[0], run.turning.angle
    ends = [np.clip(centres + side * width, 0.0, time[-1]) for side in (-0.5, 0.5)]
    turned = np.interp(ends[1], time, angle) - np.interp(ends[0], time, angle)
    return np.asarray(np.abs(turned) / (ends[1] - ends[0]))


FIGURES = (frequency_maps, order_maps, order_levels)
