"""Figures of a planetary set: what its planets do side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearfmu.report import metrics
from gearfmu.report.plots import Plot, columns, finish
from gearfmu.report.plots_nvh import SHOWN_TO, level_axis, segment
from gearfmu.report.signals import GEAR_SPEED, Window
from gearfmu.report.style import COLOURS, MUTED, WIDTH, panels, styled, svg
from gearfmu.spec.turning import Meshing
from gearfmu.stage.trace import Trace

ENERGIES = ("energy.work", "energy.stored", "energy.dissipated", "energy.residual")
MARKED_ORDERS = 12
STEADY = 0.1  # nine tenths of the speeds lie as close together, over their median, where mesh orders are marked


@dataclass(frozen=True)
class PlanetSet:
    """The engagements of a trace that a carrier carries: by central gear ("sun") and planet ("planet1"), from names as
    sun_planet1; the Meshing of the first."""

    carrier: str
    meshes: Mapping[str, Mapping[str, str]]
    meshing: Meshing

    @property
    def planets(self) -> list[str]:
        """Names of the planets, in order."""
        return list(dict.fromkeys(planet for own in self.meshes.values() for planet in own))


def planet_set(trace: Trace, known: Mapping[str, Meshing]) -> PlanetSet | None:
    """The set of a trace; None where no carrier carries an engagement. known: Meshing by engagement."""
    found: dict[str, dict[str, str]] = {}
    carried = {mesh: own for mesh, own in known.items() if own.carrier is not None and f"{mesh}.force" in trace}
    for mesh in carried:
        central, _, planet = mesh.rpartition("_")
        found.setdefault(central or mesh, {})[planet] = mesh
    first = next(iter(carried.values()), None)
    return PlanetSet(first.carrier, found, first) if first is not None and first.carrier is not None else None


def speeds(trace: Trace, own: PlanetSet) -> Plot | None:
    """Speeds of carrier, planets and central gears in rad/s, with their signs."""
    groups = [[own.carrier], own.planets, [name for name in own.meshes if name]]
    shown = [[f"{name}{GEAR_SPEED}" for name in group if f"{name}{GEAR_SPEED}" in trace] for group in groups]
    shown = [[name for name in group if np.any(trace[name])] for group in shown]
    rows = [group for group in shown if group]
    if not rows:
        return None
    with styled():
        figure, axes = panels((1.5,) * len(rows))
        for axis, names in zip(axes, rows, strict=True):
            for name in names:
                axis.plot(trace.time, trace[name], label=name.removesuffix(GEAR_SPEED), lw=0.8)
            finish(axis, "speed in rad/s")
        axes[-1].set_xlabel("time in s")
        picture = svg(figure, "set_speed")
    means = ", ".join(f"{n.removesuffix(GEAR_SPEED)} {np.mean(trace[n]):.2f}" for group in rows for n in group)
    names = [name for group in rows for name in group]
    return Plot("set_speed", "Speeds", f"Mean in rad/s: {means}.", picture, columns(trace, names))


def forces(trace: Trace, own: PlanetSet, window: tuple[float, float] | None = None) -> Plot:
    """Magnitude of the mesh force of every planet, one panel for each central gear, over the run or a window (s)."""
    part = trace if window is None else trace.window(*window)
    file = "set_force" if window is None else "set_force_detail"
    with styled():
        figure, axes = panels((2.0,) * len(own.meshes))
        for axis, (central, meshes) in zip(axes, own.meshes.items(), strict=True):
            for planet, mesh in meshes.items():
                force = 1e-3 * np.abs(part[f"{mesh}.force"])
                axis.plot(part.time, force, label=planet, lw=0.7 if window is None else 1.1)
            finish(axis, f"at the {central}, kN")
        axes[-1].set_xlabel("time in s")
        picture = svg(figure, file)
    names = [f"{mesh}.force" for meshes in own.meshes.values() for mesh in meshes.values()]
    title = "Mesh forces of the planets" + ("" if window is None else ", detail")
    return Plot(file, title, _opened(part, own), picture, columns(part, names))


def _opened(part: Trace, own: PlanetSet) -> str:
    meshes = [mesh for group in own.meshes.values() for mesh in group.values() if f"{mesh}.contact" in part]
    apart = {mesh: float(np.mean(part[f"{mesh}.contact"] == 0)) for mesh in meshes}
    words = ", ".join(f"{mesh} {share:.1%}" for mesh, share in apart.items() if share)
    return f"Magnitudes. Teeth apart in this share of the samples: {words or 'none'}."


def shares(trace: Trace, own: PlanetSet, window: Window) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Share of every engagement in the force of its central gear, 1 where all planets carry alike: over time (n,), mean
    over one mesh period, NaN where that would reach beyond the run; and mean over `window`."""
    period = max(1, round(2 * np.pi / _mesh_speed(trace, own) / metrics.sample_step(trace.time)))
    inside = (trace.time >= window.start) & (trace.time <= window.end)
    over_time, means = {}, {}
    for meshes in own.meshes.values():
        smooth = {mesh: _running_mean(np.abs(_force(trace, mesh)), period) for mesh in meshes.values()}
        total = np.maximum(sum(smooth.values()), 1e-9)
        part = {mesh: float(np.mean(np.abs(_force(trace, mesh)[inside]))) for mesh in meshes.values()}
        for mesh, values in smooth.items():
            over_time[mesh] = len(meshes) * values / total
            means[mesh] = len(meshes) * part[mesh] / max(sum(part.values()), 1e-9)
    return over_time, means


def sharing(trace: Trace, own: PlanetSet, window: Window) -> Plot:
    """Share of every planet in the load of sun and ring."""
    over_time, means = shares(trace, own, window)
    with styled():
        figure, axes = panels((1.6,) * len(own.meshes))
        for axis, (central, meshes) in zip(axes, own.meshes.items(), strict=True):
            for planet, mesh in meshes.items():
                axis.plot(trace.time, over_time[mesh], label=f"{planet}: {means[mesh]:.3f}", lw=0.9)
            finish(axis, f"share at the {central}")
        axes[-1].set_xlabel("time in s")
        picture = svg(figure, "sharing")
    caption = (
        "Mesh force over the mean of all planets, running mean over one mesh period; in the legend the mean from "
        f"{window.start:.3g} s to {window.end:.3g} s ({window.reason})."
    )
    data = {"time_[s]": trace.time} | {f"{mesh}_share": values for mesh, values in over_time.items()}
    return Plot("sharing", "Load sharing", caption, picture, data)


def planets(trace: Trace, own: PlanetSet, window: Window) -> Plot:
    """One row a planet: its mesh forces over the last mesh periods, its shares and the force on its pin over the
    run."""
    over_time, means = shares(trace, own, window)
    start, end = detail_window(trace, own, window)
    late = (trace.time >= start) & (trace.time <= end)
    with styled():
        figure = Figure(figsize=(WIDTH, 1.35 * len(own.planets) + 0.6), layout="constrained")
        axes = figure.subplots(len(own.planets), 3, squeeze=False, sharex="col", sharey="col")
        for planet, (force, share, pin) in zip(own.planets, axes, strict=True):
            for order, (central, mesh) in enumerate(_meshes_of(own, planet).items()):
                look = {"zorder": 2.5 - 0.1 * order}  # the sun's, which vary less, in front
                force.plot(trace.time[late], 1e-3 * np.abs(trace[f"{mesh}.force"][late]), lw=0.9, label=central, **look)
                share.plot(trace.time, over_time[mesh], lw=0.6, label=f"{central} {means[mesh]:.3f}", **look)
            if (pressed := _pin_force(trace, planet)) is not None:
                pin.plot(trace.time, 1e-3 * pressed, lw=0.6, color=COLOURS[2], label=f"{np.mean(pressed):.4g} N")
                pin.legend(loc="upper right", frameon=True, framealpha=0.8, edgecolor="none")
            share.legend(loc="upper right", ncols=2, frameon=True, framealpha=0.8, edgecolor="none")
            share.ticklabel_format(useOffset=False)
            force.set_ylabel(planet)
        axes[0, 0].legend(loc="upper right", ncols=2, frameon=True, framealpha=0.8, edgecolor="none")
        for axis, title in zip(axes[0], ("mesh forces in kN", "share", "force on the pin in kN"), strict=True):
            axis.set_title(title, loc="left")
        for axis in axes[-1]:
            axis.set_xlabel("time in s")
        picture = svg(figure, "planets")
    caption = (
        "Magnitudes of the mesh forces over the last mesh periods; share in the load of sun and ring, running mean "
        f"over one mesh period, with its mean from {window.start:.3g} s to {window.end:.3g} s; magnitude of the force "
        "on the pin across its axis, with its mean. Each column has one scale."
    )
    data = {"time_[s]": trace.time}
    for planet in own.planets:
        for central, mesh in _meshes_of(own, planet).items():
            data |= {f"{planet}_{central}_[N]": trace[f"{mesh}.force"], f"{planet}_{central}_share": over_time[mesh]}
        if (pressed := _pin_force(trace, planet)) is not None:
            data[f"{planet}_pin_[N]"] = pressed
    return Plot("planets", "Planet by planet", caption, picture, data)


def _meshes_of(own: PlanetSet, planet: str) -> dict[str, str]:
    """Engagements of a planet by central gear."""
    return {central: meshes[planet] for central, meshes in own.meshes.items() if planet in meshes}


def _pin_force(trace: Trace, planet: str) -> np.ndarray | None:
    """(n,) N: magnitude of the force of a planet on its pin across the axis; None where it was not recorded."""
    names = [f"pin.{planet}.{direction}" for direction in ("fx", "fy")]
    return np.hypot(trace[names[0]], trace[names[1]]) if all(name in trace for name in names) else None


def pin_forces(trace: Trace, own: PlanetSet) -> Plot | None:
    """Magnitude of the force of every planet on its pin in the plane of the wheels."""
    known = {planet: force for planet in own.planets if (force := _pin_force(trace, planet)) is not None}
    if not known:
        return None
    with styled():
        figure, (axis,) = panels((2.2,))
        for planet, force in known.items():
            axis.plot(trace.time, 1e-3 * force, label=planet, lw=0.8)
        finish(axis, "force in kN")
        axis.set_xlabel("time in s")
        picture = svg(figure, "pin")
    names = [f"pin.{planet}.{d}" for planet in known for d in ("fx", "fy")]
    caption = (
        "Force of every planet on its pin, magnitude across the axis; the data hold both components, in axes that "
        "turn with the carrier."
    )
    return Plot("pin", "Pin forces", caption, picture, columns(trace, names))


def energy(trace: Trace) -> Plot | None:
    """Work of every shaft, stored and dissipated energy, and what the balance leaves."""
    works = [name for name in trace.channels if name.startswith("drive.") and name.endswith(".work")]
    works = [name for name in works if name != "drive.energy.work"] or ["energy.work"]
    if any(name not in trace for name in (*works, *ENERGIES)):
        return None
    with styled():
        figure, axes = panels((2.0, 1.3))
        for name in (*works, "energy.stored", "energy.dissipated"):
            axes[0].plot(trace.time, trace[name], label=name)
        finish(axes[0], "energy in J")
        axes[1].plot(trace.time, trace["energy.residual"], lw=0.9, label="stored − work + dissipated since the start")
        finish(axes[1], "energy in J")
        axes[1].set_xlabel("time in s")
        picture = svg(figure, "energy")
    through = sum(float(np.ptp(trace[name])) for name in works)
    if works == ["energy.work"]:  # of all ports together: what came in and what went out is told by the run
        through = float(trace.meta.get("exchanged_work_J") or through)
    left = float(np.ptp(trace["energy.residual"])) / through if through else 0.0
    caption = f"The balance leaves {left:.1e} of the energy that passed through the shafts (sum of magnitudes)."
    return Plot("energy", "Energy", caption, picture, columns(trace, [*works, *ENERGIES]))


def spectrum(trace: Trace, own: PlanetSet, window: Window) -> Plot:
    """Spectra of the mesh forces and of the ring's force on its mounts along fixed axes. Marked: mesh orders k f_m, and
    around each the sidebands of the planets' passing, k f_m ± N f_c (N planets, f_c: carrier)."""
    part = trace.window(window.start, window.end)
    step = metrics.sample_step(part.time)
    names = {c: [f"{mesh}.force" for mesh in meshes.values()] for c, meshes in own.meshes.items()}
    signals = {name: _force(part, name.removesuffix(".force")) for group in names.values() for name in group}
    fixed = on_mounts(part)
    groups = {**{f"meshes of the {c}": own_names for c, own_names in names.items()}}
    groups |= {"ring on its mounts": list(fixed)} if fixed else {}
    size = segment(part.time.size, 1)
    spectra = {
        n: metrics.amplitude_spectrum(v, step, size, step if f"{n}_mean" in part else 0.0)
        for n, v in (signals | fixed).items()
    }
    mesh_frequency = _mesh_speed(part, own) / (2 * np.pi)
    speed = np.abs(part[f"{own.carrier}{GEAR_SPEED}"])
    carrier = float(np.median(speed)) / (2 * np.pi)
    steady = np.ptp(np.percentile(speed, [5, 95])) < STEADY * np.median(speed)
    with styled():
        figure, axes = panels((1.9,) * len(groups))
        for axis, group in zip(axes, groups.values(), strict=True):
            for name in group:
                lines = spectra[name]
                axis.plot(lines.frequency[1:] / 1e3, metrics.level(lines.amplitude[1:]), label=name, lw=0.8)
            level_axis(axis, "dB re 1 N")
            axis.set_xlim(0, min(SHOWN_TO, 0.5 / step) / 1e3)
            if steady:
                _mark(axis, mesh_frequency, len(own.planets) * carrier)
        axes[-1].set_xlabel("frequency in kHz")
        picture = svg(figure, "spectrum")
    first = next(iter(spectra.values()))
    caption = (
        f"Rms amplitude of each line, Hann, resolution {first.resolution:.3g} Hz, {window.start:.3g} s to "
        f"{window.end:.3g} s ({window.reason}). "
    )
    caption += (
        f"Dotted: mesh orders k·f_m, f_m = {mesh_frequency:.1f} Hz; light: k·f_m ± {len(own.planets)} f_c, "
        f"f_c = {carrier:.2f} Hz of the carrier."
        if steady
        else "Mesh orders are not marked: the speed is not steady."
    )
    data = {"frequency_[Hz]": first.frequency} | {f"{n}_rms_[N]": s.amplitude for n, s in spectra.items()}
    return Plot("spectrum", "Spectra of the forces", caption, picture, data)


def _mark(axis: Axes, mesh_frequency: float, passing: float) -> None:
    for order in range(1, MARKED_ORDERS + 1):
        at = order * mesh_frequency / 1e3
        if at > axis.get_xlim()[1]:
            return
        axis.axvline(at, color=MUTED, lw=0.7, ls=":", zorder=0)
        for side in (-1, 1):
            axis.axvline(at + side * passing / 1e3, color=MUTED, lw=0.5, alpha=0.3, zorder=0)
        axis.annotate(
            str(order), (at, 1), (3, -9), xycoords=("data", "axes fraction"), textcoords="offset points",
            fontsize=8, color=MUTED,
        )  # fmt: skip


def results(trace: Trace, own: PlanetSet, window: Window) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Heading and rows of the table of planets: mean, alternating part and share of every mesh force, transmission
    error, pin force; over `window`."""
    part, means = trace.window(window.start, window.end), shares(trace, own, window)[1]
    rows = []
    for meshes in own.meshes.values():
        for planet, mesh in meshes.items():
            force = _force(part, mesh)
            te = part[f"{mesh}.te"] * 1e6 if f"{mesh}.te" in part else np.array([np.nan])
            pin = [part[name] for d in "xy" if (name := f"pin.{planet}.f{d}") in part]
            held = float(np.mean(np.hypot(*pin))) if len(pin) == 2 else np.nan
            numbers = (np.mean(force), np.std(force), means[mesh], np.mean(te), np.std(te), held)
            rows.append((mesh, *("–" if np.isnan(number) else f"{number:.4g}" for number in numbers)))
    head = ("mesh", "force, N", "alternating, N rms", "share", "TE, µm", "TE alternating, µm rms", "pin force, N")
    return head, rows


def detail_window(trace: Trace, own: PlanetSet, window: Window, periods: float = 8) -> tuple[float, float]:
    """The last mesh periods (s) of the run, within `window`."""
    width = periods * 2 * np.pi / _mesh_speed(trace, own)
    return max(window.start, window.end - width), window.end


def on_mounts(part: Trace) -> dict[str, np.ndarray]:
    """Force of the ring on its mounts, N, along the fixed axes x and y, by name."""
    return {name: mean_or_sample(part, name) for name in ("bearing.ring.fx", "bearing.ring.fy") if name in part}


def _force(trace: Trace, mesh: str) -> np.ndarray:
    return mean_or_sample(trace, f"{mesh}.force")


def mean_or_sample(trace: Trace, name: str) -> np.ndarray:
    """The mean over the communication step where it was recorded: it folds less."""
    return trace[f"{name}_mean"] if f"{name}_mean" in trace else trace[name]


def _mesh_speed(trace: Trace, own: PlanetSet) -> float:
    """Median of the mesh frequency, rad/s."""
    turning: dict[str, Any] = {n: trace[f"{n}{GEAR_SPEED}"] for n in (own.meshing.rotor, own.carrier)}
    return max(float(np.median(np.abs(own.meshing.relative(turning)))) * own.meshing.teeth, 1e-9)


def _running_mean(values: np.ndarray, width: int) -> np.ndarray:
    """(n,): mean over `width` samples around each; NaN at the ends, where there are fewer."""
    found, width = np.full(values.size, np.nan), min(width, values.size)
    before = (width - 1) // 2
    found[before : before + values.size - width + 1] = np.convolve(values, np.full(width, 1.0 / width), "valid")
    return found
