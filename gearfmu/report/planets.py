"""Figures and tables of the planets of a set side by side, by central gear."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearfmu.report.chart import Chart, Curve, Panel, Plot, over_time
from gearfmu.report.plots import columns, pin_force
from gearfmu.report.run import Run
from gearfmu.report.signals import PlanetSet
from gearfmu.stage.run.trace import Trace


def forces(trace: Trace, own: PlanetSet, window: tuple[float, float] | None = None) -> Plot:
    """Magnitude of the mesh force of every planet, one panel for each central gear, over the run or a window (s)."""
    part = trace if window is None else trace.window(*window)
    file = "set_force" if window is None else "set_force_detail"
    panels = []
    for central, meshes in own.meshes.items():
        curves = [Curve(part.time, 1e-3 * np.abs(part[f"{m}.force"]), f"{m}.force", "kN") for m in meshes.values()]
        panels.append(Panel(f"mesh force at the {central} in kN", tuple(curves)))
    names = [f"{mesh}.force" for meshes in own.meshes.values() for mesh in meshes.values()]
    title = "Mesh forces of the planets" + ("" if window is None else ", detail")
    chart = over_time(panels, "time" if window is None else file)
    return Plot(file, title, _opened(part, own), chart, columns(part, names))


def _opened(part: Trace, own: PlanetSet) -> str:
    meshes = [mesh for group in own.meshes.values() for mesh in group.values() if f"{mesh}.contact" in part]
    apart = {mesh: float(np.mean(part[f"{mesh}.contact"] == 0)) for mesh in meshes}
    words = ", ".join(f"{mesh} {share:.1%}" for mesh, share in apart.items() if share)
    return f"Magnitudes. Teeth apart in this share of the samples: {words or 'none'}."


def sharing(run: Run, own: PlanetSet) -> Plot:
    """Share of every planet in the load of sun and ring."""
    (shares, means), time, window = run.shares, run.trace.time, run.window
    panels = []
    for central, meshes in own.meshes.items():
        curves = [Curve(time, shares[m], f"{planet}: {means[m]:.3f}") for planet, m in meshes.items()]
        limits = _limits([curve.y for curve in curves], LEAST_SPAN)
        panels.append(Panel(f"share at the {central}", tuple(curves), limits=limits, height=160))
    caption = (
        "Mesh force over the mean of all planets, running mean over one mesh period; in the legend the mean from "
        f"{window.start:.3g} s to {window.end:.3g} s ({window.reason})."
    )
    data = {"time_[s]": time} | {f"{mesh}_share": values for mesh, values in shares.items()}
    return Plot("sharing", "Load sharing", caption, over_time(panels), data)


def planets(run: Run, own: PlanetSet) -> Plot:
    """One row a planet: its mesh forces over the last mesh periods, its shares and the force on its pin over the
    run."""
    trace, window, (shares, means) = run.trace, run.window, run.shares
    late = trace.window(*run.detail(""))
    data, rows = {"time_[s]": trace.time}, []
    for planet in own.planets:
        meshes = {central: own_meshes[planet] for central, own_meshes in own.meshes.items() if planet in own_meshes}
        forces = [Curve(late.time, 1e-3 * np.abs(late[f"{m}.force"]), central, "kN") for central, m in meshes.items()]
        parts = [Curve(trace.time, shares[m], f"{central} {means[m]:.3f}") for central, m in meshes.items()]
        for central, mesh in meshes.items():
            data |= {f"{planet}_{central}_[N]": trace[f"{mesh}.force"], f"{planet}_{central}_share": shares[mesh]}
        pin = []
        if (pressed := pin_force(trace, planet)) is not None:
            pin = [Curve(trace.time, 1e-3 * pressed, f"mean {np.mean(pressed):.4g} N", "kN", colour=2)]
            data[f"{planet}_pin_[N]"] = pressed
        rows.append((forces, parts, pin))
    scales = [
        _limits([curve.y for row in rows for curve in row[k]], least) for k, least in enumerate((0.0, LEAST_SPAN, 0.0))
    ]
    panels = [
        Panel(f"{planet}: {label}", tuple(curves), limits=scale, height=130)
        for planet, row in zip(own.planets, rows, strict=True)
        for label, curves, scale in zip(COLUMNS_OF_PLANETS, row, scales, strict=True)
    ]
    caption = (
        "Magnitudes of the mesh forces over the last mesh periods; share in the load of sun and ring, running mean "
        f"over one mesh period, with its mean from {window.start:.3g} s to {window.end:.3g} s; magnitude of the force "
        "on the pin across its axis, with its mean. Each column has one scale."
    )
    return Plot("planets", "Planet by planet", caption, Chart(tuple(panels), across=len(COLUMNS_OF_PLANETS)), data)


LEAST_SPAN = 0.01  # of an axis of shares
COLUMNS_OF_PLANETS = ("mesh forces in kN", "share", "force on the pin in kN")


def _limits(curves: Sequence[np.ndarray], least: float) -> tuple[float, float] | None:
    """Limits round all values, at least so far apart: rounding noise is a line."""
    values = np.concatenate([np.zeros(0), *curves])
    values = values[np.isfinite(values)]
    if not values.size:
        return None
    low, high = float(values.min()), float(values.max())
    edge = max(0.05 * (high - low), 0.5 * (least - (high - low))) or 0.05 * abs(high) or 1.0
    return low - edge, high + edge
