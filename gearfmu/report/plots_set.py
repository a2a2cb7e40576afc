"""Figures of a planetary set: what its planets do side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearfmu.report import metrics
from gearfmu.report.chart import Chart, Curve, Mark, Panel, Plot, level_limits, over_time
from gearfmu.report.names import mesh_words
from gearfmu.report.plots import RPM, channels, columns
from gearfmu.report.plots_nvh import SHOWN_TO, segment, spectrum_curve
from gearfmu.report.results import port_work
from gearfmu.report.signals import GEAR_SPEED, Window, noise_floor
from gearfmu.spec.forms.turning import Meshing
from gearfmu.stage.run.trace import Trace

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
    """Speeds of carrier, planets and central gears in rpm, with their signs."""
    groups = [[own.carrier], own.planets, [name for name in own.meshes if name]]
    shown = [[f"{name}{GEAR_SPEED}" for name in group if f"{name}{GEAR_SPEED}" in trace] for group in groups]
    shown = [[name for name in group if np.any(trace[name])] for group in shown]
    rows = [group for group in shown if group]
    if not rows:
        return None
    curves = [[Curve(trace.time, trace[name] * RPM, name, "rpm") for name in group] for group in rows]
    panels = [Panel("speed in rpm", tuple(group), height=150) for group in curves]
    names = [name for group in rows for name in group]
    means = ", ".join(f"{n.removesuffix(GEAR_SPEED)} {np.mean(trace[n]) * RPM:.1f}" for n in names)
    told = f"Mean in rpm: {means}; the data are in rad/s."
    return Plot("set_speed", "Speeds", told, over_time(panels), columns(trace, names))


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


def shares(trace: Trace, own: PlanetSet, window: Window) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Share of every engagement in the force of its central gear, 1 where all planets carry alike: over time (n,), mean
    over one mesh period, NaN where that would reach beyond the run; and mean over `window`."""
    period = max(1, round(2 * np.pi / mesh_speed(trace, own) / metrics.sample_step(trace.time)))
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
    over_time_, means = shares(trace, own, window)
    panels = []
    for central, meshes in own.meshes.items():
        curves = [Curve(trace.time, over_time_[m], f"{planet}: {means[m]:.3f}") for planet, m in meshes.items()]
        limits = _limits([curve.y for curve in curves], LEAST_SPAN)
        panels.append(Panel(f"share at the {central}", tuple(curves), limits=limits, height=160))
    caption = (
        "Mesh force over the mean of all planets, running mean over one mesh period; in the legend the mean from "
        f"{window.start:.3g} s to {window.end:.3g} s ({window.reason})."
    )
    data = {"time_[s]": trace.time} | {f"{mesh}_share": values for mesh, values in over_time_.items()}
    return Plot("sharing", "Load sharing", caption, over_time(panels), data)


def planets(trace: Trace, own: PlanetSet, window: Window) -> Plot:
    """One row a planet: its mesh forces over the last mesh periods, its shares and the force on its pin over the
    run."""
    shared, means = shares(trace, own, window)
    late = trace.window(*detail_window(trace, own, window))
    panels: list[Panel] = []
    for planet in own.planets:
        panels += _of_planet(
            trace, late, planet, {c: (m, shared[m], means[m]) for c, m in _meshes_of(own, planet).items()}
        )
    panels = _same_limits(panels)
    caption = (
        "Magnitudes of the mesh forces over the last mesh periods; share in the load of sun and ring, running mean "
        f"over one mesh period, with its mean from {window.start:.3g} s to {window.end:.3g} s; magnitude of the force "
        "on the pin across its axis, with its mean. Each column has one scale."
    )
    data = {"time_[s]": trace.time}
    for planet in own.planets:
        for central, mesh in _meshes_of(own, planet).items():
            data |= {f"{planet}_{central}_[N]": trace[f"{mesh}.force"], f"{planet}_{central}_share": shared[mesh]}
        if (pressed := _pin_force(trace, planet)) is not None:
            data[f"{planet}_pin_[N]"] = pressed
    return Plot("planets", "Planet by planet", caption, Chart(tuple(panels), across=len(COLUMNS_OF_PLANETS)), data)


LEAST_SPAN = 0.01  # of an axis of shares
COLUMNS_OF_PLANETS = ("mesh forces in kN", "share", "force on the pin in kN")


def _of_planet(
    trace: Trace, late: Trace, planet: str, meshes: Mapping[str, tuple[str, np.ndarray, float]]
) -> list[Panel]:
    """The row of a planet: mesh forces over the last mesh periods `late`; shares and pin force over the run. meshes: by
    central gear its engagement, share (n,) and mean share."""
    forces, parts = [], []
    for central, (mesh, share, mean) in meshes.items():
        forces.append(Curve(late.time, 1e-3 * np.abs(late[f"{mesh}.force"]), central, "kN"))
        parts.append(Curve(trace.time, share, f"{central} {mean:.3f}"))
    pressed = _pin_force(trace, planet)
    pin: tuple[Curve, ...] = ()
    if pressed is not None:
        pin = (Curve(trace.time, 1e-3 * pressed, f"mean {np.mean(pressed):.4g} N", "kN", colour=2),)
    return [
        Panel(f"{planet}: {label}", tuple(curves), height=130)
        for label, curves in zip(COLUMNS_OF_PLANETS, (forces, parts, pin), strict=True)
    ]


def _limits(curves: Sequence[np.ndarray], least: float) -> tuple[float, float] | None:
    """Limits round all values, at least so far apart: rounding noise is a line."""
    values = np.concatenate([np.zeros(0), *curves])
    values = values[np.isfinite(values)]
    if not values.size:
        return None
    low, high = float(values.min()), float(values.max())
    edge = max(0.05 * (high - low), 0.5 * (least - (high - low))) or 0.05 * abs(high) or 1.0
    return low - edge, high + edge


def _same_limits(panels: list[Panel]) -> list[Panel]:
    """The panels of a column with one scale."""
    found = []
    for number, panel in enumerate(panels):
        column = panels[number % len(COLUMNS_OF_PLANETS) :: len(COLUMNS_OF_PLANETS)]
        least = LEAST_SPAN if number % len(COLUMNS_OF_PLANETS) == COLUMNS_OF_PLANETS.index("share") else 0.0
        panel = replace(panel, limits=_limits([curve.y for other in column for curve in other.curves], least))
        found.append(panel)
    return found


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
    curves = tuple(Curve(trace.time, 1e-3 * force, planet, "kN") for planet, force in known.items())
    chart = over_time([Panel("force in kN", curves, height=200)])
    names = [f"pin.{planet}.{d}" for planet in known for d in ("fx", "fy")]
    caption = (
        "Force of every planet on its pin, magnitude across the axis; the data hold both components, in axes that "
        "turn with the carrier."
    )
    return Plot("pin", "Pin forces", caption, chart, columns(trace, names))


def energy(trace: Trace) -> Plot | None:
    """Work of every shaft, stored and dissipated energy, and what the balance leaves."""
    works = [name for name in trace.channels if name.startswith("drive.") and name.endswith(".work")]
    works = [name for name in works if name != "drive.energy.work"] or ["energy.work"]
    if any(name not in trace for name in (*works, *ENERGIES)):
        return None
    left_over = Curve(trace.time, trace["energy.residual"], "stored − work + dissipated since the start", "J")
    panels = (
        Panel("energy in J", channels(trace, (*works, "energy.stored", "energy.dissipated")), height=190),
        Panel("error of the balance in J", (left_over,), height=120),
    )
    of_shafts = sum(float(np.ptp(trace[name])) for name in works)
    through = port_work(trace) if works == ["energy.work"] else of_shafts  # energy.work: of all ports, with sign
    left = float(np.ptp(trace["energy.residual"])) / through if through else 0.0
    caption = f"The balance leaves {left:.1e} of the energy that passed through the shafts (sum of magnitudes)."
    return Plot("energy", "Energy", caption, over_time(panels), columns(trace, [*works, *ENERGIES]))


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
    mesh_frequency = mesh_speed(part, own) / (2 * np.pi)
    speed = np.abs(part[f"{own.carrier}{GEAR_SPEED}"])
    carrier = float(np.median(speed)) / (2 * np.pi)
    steady = np.ptp(np.percentile(speed, [5, 95])) < STEADY * np.median(speed)
    top = min(SHOWN_TO, 0.5 / step)
    marks = tuple(_marks(mesh_frequency, len(own.planets) * carrier, top)) if steady else ()
    panels = []
    for title, group in groups.items():
        curves = tuple(spectrum_curve(name, spectra[name], top) for name in group)
        panels.append(Panel(f"{title}: level in dB re 1 N", curves, marks=marks, limits=level_limits(curves)))
    chart = Chart(tuple(panels), "frequency in kHz", "frequency", x_limits=(0.0, top / 1e3))
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
    used = {n: f"{n}_mean" if f"{n}_mean" in part else n for n in spectra}
    data = {"frequency_[Hz]": first.frequency} | {f"{used[n]}_rms_[N]": s.amplitude for n, s in spectra.items()}
    return Plot("spectrum", "Spectra of the forces", caption, chart, data)


def _marks(mesh_frequency: float, passing: float, top: float) -> list[Mark]:
    """Marks of the mesh orders and their sidebands below `top`; all in Hz."""
    found = []
    for order in range(1, min(MARKED_ORDERS, int(top / mesh_frequency)) + 1):
        at = order * mesh_frequency
        found += [Mark(at / 1e3, str(order)), *(Mark((at + side * passing) / 1e3, "", "side") for side in (-1, 1))]
    return found


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
            rows.append((mesh_words(mesh), *("–" if np.isnan(number) else f"{number:.4g}" for number in numbers)))
    head = ("mesh", "force, N", "alternating, N rms", "share", "TE, µm", "TE alternating, µm rms", "pin force, N")
    return head, rows


def detail_window(trace: Trace, own: PlanetSet, window: Window, periods: float = 8) -> tuple[float, float]:
    """The last mesh periods (s) of the run, within `window`."""
    width = periods * 2 * np.pi / mesh_speed(trace, own)
    return max(window.start, window.end - width), window.end


def on_mounts(part: Trace) -> dict[str, np.ndarray]:
    """Force of the ring on its mounts, N, along the fixed axes x and y, by name; none where it cancels."""
    known = {name: mean_or_sample(part, name) for name in ("bearing.ring.fx", "bearing.ring.fy") if name in part}
    floor = noise_floor(part)
    return known if any(np.abs(values).max() >= floor for values in known.values()) else {}


def _force(trace: Trace, mesh: str) -> np.ndarray:
    return mean_or_sample(trace, f"{mesh}.force")


def mean_or_sample(trace: Trace, name: str) -> np.ndarray:
    """The mean over the communication step where it was recorded: it folds less."""
    return trace[f"{name}_mean"] if f"{name}_mean" in trace else trace[name]


def mesh_speed(trace: Trace, own: PlanetSet) -> float:
    """Median of the mesh frequency, rad/s."""
    turning: dict[str, Any] = {n: trace[f"{n}{GEAR_SPEED}"] for n in (own.meshing.rotor, own.carrier)}
    return max(float(np.median(np.abs(own.meshing.relative(turning)))) * own.meshing.teeth, 1e-9)


def _running_mean(values: np.ndarray, width: int) -> np.ndarray:
    """(n,): mean over `width` samples around each; NaN at the ends, where there are fewer."""
    found, width = np.full(values.size, np.nan), min(width, values.size)
    before = (width - 1) // 2
    found[before : before + values.size - width + 1] = np.convolve(values, np.full(width, 1.0 / width), "valid")
    return found
