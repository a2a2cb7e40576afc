"""Figures over time: torques, speeds, forces of meshes, bearings and pins, transmission error, energy."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from gearfmu.report.chart import SPANS, Curve, Panel, Plot, Span, over_time
from gearfmu.report.names import mesh_words
from gearfmu.report.results import port_work
from gearfmu.report.signals import GEAR_SPEED, LOCKED, bearings, drive_side, lock_time, meshes, noise_floor, spans
from gearfmu.stage.run.trace import Trace, heading

CLUTCH_TORQUES = ("clutch.capacity", "clutch.tau", ".shaft.tau")
RPM = 30 / np.pi
ENERGIES = ("energy.work", "energy.stored", "energy.dissipated", "energy.residual")
LEVER = 0.01  # m: moments below the noise of forces times this lever are noise
MOST_SPANS = 300  # shaded in a panel


def torque_and_slip(trace: Trace) -> Plot | None:
    """Torques around the clutch, the other torques, and the slip of every clutch with its lock-up; None without
    torques."""
    clutch = [name for suffix in CLUTCH_TORQUES for name in trace.channels if name.endswith(suffix)]
    own = [name for name in trace.channels if name.endswith(".tau") and f"{name[:-4]}.slip" in trace]
    clutch += [name for name in own if name not in clutch]
    all_torques = clutch + [name for name in trace.channels if name.endswith(".tau") and name not in clutch]
    others = [name for name in distinct(trace, all_torques) if name not in clutch]
    slips = [name for name in trace.channels if name.endswith(".slip")]
    if not clutch and not others:
        return None
    states = [trace[name].astype(bool) for name in trace.channels if name.endswith(LOCKED)]
    locked = tuple(Span(*ends, "locked") for state in states for ends in spans(trace.time, state))
    rows = ((clutch, "torque in N·m", 190), (others, "torque in N·m", 190), (slips, "slip in rad/s", 130))
    panels = [
        Panel(label, channels(trace, names), spans=locked, height=height) for names, label, height in rows if names
    ]
    at = lock_time(trace)
    caption = "" if at is None else f"The clutch stays locked from {at:.4f} s on."
    title = "Torques and slip" if slips else "Torques"
    return Plot("torque", title, caption, over_time(panels), columns(trace, clutch + others + slips))


def speeds(trace: Trace, groups: Sequence[Sequence[str]] = ()) -> Plot:
    """Speeds in rpm of what turns. groups: names of rotors that share a panel, with their signs; without
    groups everything that turns, each once, by magnitude."""
    turning = [n for n in trace.channels if n.endswith(".w") and trace.channels[n].unit == "rad/s"]
    of_groups = [[n for rotor in own if (n := f"{rotor}{GEAR_SPEED}") in trace and np.any(trace[n])] for own in groups]
    rows = [row for row in of_groups or [distinct(trace, turning)] if row]
    names = [name for row in rows for name in row]
    panels = []
    for row in rows:
        curves = (Curve(trace.time, (trace[n] if groups else np.abs(trace[n])) * RPM, n, "rpm") for n in row)
        panels.append(Panel("speed in rpm", tuple(curves), height=150 if groups else 200))
    means = ", ".join(f"{n.removesuffix(GEAR_SPEED)} {np.mean(trace[n]) * RPM:.1f}" for n in names)
    words = f"Mean in rpm: {means}; the data are in rad/s." if groups else "Magnitudes; the data keep sign and rad/s."
    return Plot("set_speed" if groups else "speed", "Speeds", words, over_time(panels), columns(trace, names))


def mesh_force_and_error(trace: Trace, mesh: str, window: tuple[float, float] | None = None) -> Plot:
    """Force and transmission error of an engagement over the run or a window (s); shaded where its teeth are apart or
    on the coast flanks."""
    scales = {f"{mesh}.force": (1e-3, "mesh force in kN"), f"{mesh}.te": (1e6, "transmission error in µm")}
    names = [name for name in scales if name in trace]
    part = trace if window is None else trace.window(*window)
    state = _by_flank(trace, part, mesh) if f"{mesh}.contact" in part else None
    shaded = () if state is None else tuple(_contact(part.time, state))
    panels = []
    for name in names:
        scale, label = scales[name]
        panels.append(Panel(label, channels(part, [name], scale, label.split()[-1]), spans=shaded))
    file = mesh if window is None else f"{mesh}_detail"
    title = of_mesh(trace, mesh, "Mesh force and transmission error") + ("" if window is None else ", detail")
    words = "" if state is None else _contact_words(state)
    extra = [n for n in (f"{mesh}.contact", f"{mesh}.pairs") if n in part]
    chart = over_time(panels, "time" if window is None else file)
    return Plot(file, title, words, chart, columns(part, names + extra))


def of_mesh(trace: Trace, mesh: str, title: str) -> str:
    """The title of a figure; with the name of the mesh where there are several."""
    return f"{title}, {mesh_words(mesh)}" if len(meshes(trace)) > 1 else title


def bearing_forces(trace: Trace, carried: bool = False) -> Plot:
    """Bearing forces x and y of every bearing over time. carried: of a planetary set."""
    groups = {b: found for b in bearings(trace) if (found := [n for d in "xy" if (n := f"bearing.{b}.f{d}") in trace])}
    floor = noise_floor(trace)
    quiet = [name for name, own in groups.items() if all(np.abs(trace[channel]).max() < floor for channel in own)]
    groups = {name: own for name, own in groups.items() if name not in quiet}
    panels = [Panel(f"{name}: force in kN", channels(trace, found, 1e-3, "kN")) for name, found in groups.items()]
    names = [name for found in groups.values() for name in found]
    caption = "Force of the shaft on its bearing, along the axes x and y of the stage."
    if carried:
        caption = "Force of the body on its bearing, along the fixed axes x and y."
    elif len(meshes(trace)) == 1:
        caption = "Force of the gear on its bearing; x points from pinion to wheel."
    caption += f" No net force on {', '.join(quiet)}: below {floor:.2g} N." if quiet else ""
    return Plot("bearing", "Bearing forces", caption, over_time(panels), columns(trace, names))


def axial_and_tilting(trace: Trace) -> Plot:
    """Axial forces and tilting moments of bearings and pins over time; no panels where there are hardly any, as of spur
    gears."""
    floor, panels, names = noise_floor(trace), [], []
    for kind, where in (("bearing", "on bearings"), ("pin", "on the planets' pins")):
        for ends, scale, label, least in (
            (("fz",), 1e-3, f"axial force {where} in kN", floor),
            (("mx", "my"), 1.0, f"tilting moment {where} in N·m", floor * LEVER),
        ):
            own = [n for n in trace.channels if n.startswith(f"{kind}.") and n.split(".")[-1] in ends]
            own = [name for name in own if np.abs(trace[name]).max() > least]
            if own:
                panels.append(Panel(label, channels(trace, own, scale, label.rsplit(maxsplit=1)[-1]), height=170))
                names += own
    caption = "Along and about the fixed axes x, y and z; those of pins turn with the carrier."
    title = "Axial forces and tilting moments"
    return Plot("axial", title, caption, over_time(panels), columns(trace, names))


def pin_forces(trace: Trace, planets: Sequence[str]) -> Plot | None:
    """Magnitude of the force of every planet on its pin in the plane of the wheels."""
    known = {planet: force for planet in planets if (force := pin_force(trace, planet)) is not None}
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


def pin_force(trace: Trace, planet: str) -> np.ndarray | None:
    """(n,) N: magnitude of the force of a planet on its pin across the axis; None where it was not recorded."""
    x, y = (f"pin.{planet}.{direction}" for direction in ("fx", "fy"))
    return np.hypot(trace[x], trace[y]) if x in trace and y in trace else None


def energy(trace: Trace) -> Plot | None:
    """Work of every shaft, stored and dissipated energy, and the residual of the balance."""
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


def channels(trace: Trace, names: Iterable[str], scale: float = 1.0, unit: str | None = None) -> tuple[Curve, ...]:
    """Curves of channels over time, times `scale`, in `unit` or their own."""
    return tuple(
        Curve(
            trace.time,
            trace[name] * scale,
            name,
            trace.channels[name].unit.replace("N.m", "N·m") if unit is None else unit,
            "dashed" if name.endswith(".capacity") else "",
        )
        for name in names
    )


def columns(trace: Trace, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Time and the named channels under headings that carry the unit, as CSV columns."""
    found = {"time_[s]": trace.time}
    for name in names:
        found[heading(name, trace.channels[name].unit)] = trace[name]
    return found


def distinct(trace: Trace, names: Iterable[str]) -> list[str]:
    """The names without those whose values repeat an earlier one's (a shaft end seen from both sides)."""
    found: dict[bytes, str] = {}
    for name in names:
        found.setdefault(trace[name].tobytes(), name)
    return list(found.values())


def _contact(time: np.ndarray, state: np.ndarray) -> list[Span]:
    """Where the teeth of an engagement are apart, on the coast flanks or on both; state (n,): of `_by_flank`."""
    found = [Span(*ends, kind) for code, kind in SPANS.items() for ends in spans(time, state == code)]
    return joined(found, float(time[-1] - time[0]) / MOST_SPANS)


def joined(found: Sequence[Span], gap: float) -> list[Span]:
    """Spans of a kind that lie nearer than `gap` to each other as one: nobody sees them apart, and a page with
    thousands is slow."""
    if len(found) <= MOST_SPANS:
        return list(found)
    merged: list[Span] = []
    for span in found:
        last = merged[-1] if merged else None
        if last is not None and last.kind == span.kind and span.start - last.end < gap:
            merged[-1] = Span(last.start, span.end, span.kind)
        else:
            merged.append(span)
    return merged


def _by_flank(trace: Trace, part: Trace, mesh: str) -> np.ndarray:
    """The channel `contact` of a part with +1 for drive flanks, −1 for coast flanks, 0 and 2 as they are."""
    state = part[f"{mesh}.contact"]
    return np.where(np.abs(state) == 1, state * drive_side(trace, mesh), state)


def _contact_words(state: np.ndarray) -> str:
    """state (n,): of `_by_flank`."""
    shares = (
        (0, "the teeth are apart", "orange"),
        (-1, "coast flanks carry", "blue"),
        (2, "both flanks touch", "grey"),
    )
    words = [
        f"{text} in {np.mean(state == code):.1%} of the samples ({shade})"
        for code, text, shade in shares
        if np.any(state == code)
    ]
    return "; ".join(words).capitalize() + "." if words else "The drive flanks carry at every sample."
