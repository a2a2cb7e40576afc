"""Figures over time: torque and slip, speeds, mesh force and transmission error, bearing forces."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gearfmu.report.signals import LOCKED, bearings, lock_time, meshes, spans
from gearfmu.report.style import COAST, INK, MUTED, OPEN, panels, styled, svg
from gearfmu.stage.trace import Trace, heading

CLUTCH_TORQUES = ("clutch.capacity", "clutch.tau", ".shaft.tau")
RPM = 30 / np.pi
LEAST_LABELLED = 0.08  # of the run: locked shorter than that gets no word


@dataclass(frozen=True)
class Plot:
    """A figure of the report: file name of its data, title, caption, picture (an element), columns of its CSV."""

    name: str
    title: str
    caption: str
    picture: str
    columns: dict[str, np.ndarray]


def torque_and_slip(trace: Trace) -> Plot | None:
    """Torques around the clutch, the other torques, and the slip of every clutch with its lock-up; None without
    torques."""
    clutch = [name for suffix in CLUTCH_TORQUES for name in trace.channels if name.endswith(suffix)]
    own = [name for name in trace.channels if name.endswith(".tau") and f"{name[:-4]}.slip" in trace]
    clutch += [name for name in own if name not in clutch]
    all_torques = clutch + [name for name in trace.channels if name.endswith(".tau") and name not in clutch]
    others = [name for name in distinct(trace, all_torques) if name not in clutch]
    slips = [name for name in trace.channels if name.endswith(".slip")]
    rows = [
        (names, label)
        for names, label in ((clutch, "torque in N·m"), (others, "torque in N·m"), (slips, "slip in rad/s"))
        if names
    ]
    if not clutch and not others:
        return None
    with styled():
        figure, axes = panels(tuple(1.3 if names is slips else 2.0 for names, _ in rows))
        for axis, (names, label) in zip(axes, rows, strict=True):
            for name in names:
                axis.plot(trace.time, trace[name], label=name, **(_DASHED if name.endswith(".capacity") else {}))
            finish(axis, label)
        _mark_lock(trace, axes)
        axes[-1].set_xlabel("time in s")
        picture = svg(figure, "torque")
    locked = lock_time(trace)
    caption = "" if locked is None else f"The clutch stays locked from {locked:.4f} s on."
    return Plot("torque", "Torque and slip", caption, picture, columns(trace, clutch + others + slips))


def speeds(trace: Trace) -> Plot | None:
    """Speed of everything that turns, in rpm, without sign, each once; None when nothing does."""
    names = distinct(
        trace, [name for name in trace.channels if name.endswith(".w") and trace.channels[name].unit == "rad/s"]
    )
    if not names:
        return None
    with styled():
        figure, (axis,) = panels((2.3,))
        for name in names:
            axis.plot(trace.time, np.abs(trace[name]) * RPM, label=name)
        finish(axis, "speed in rpm")
        axis.set_xlabel("time in s")
        picture = svg(figure, "speed")
    return Plot("speed", "Speeds", "Magnitudes; the data keep sign and rad/s.", picture, columns(trace, names))


def mesh_force_and_error(trace: Trace, mesh: str, window: tuple[float, float] | None = None) -> Plot | None:
    """Force and transmission error of an engagement over the run or a window (s); shaded where its teeth are apart or
    on the coast flanks; None without either channel."""
    scales = {f"{mesh}.force": (1e-3, "mesh force in kN"), f"{mesh}.te": (1e6, "transmission error in µm")}
    names = [name for name in scales if name in trace]
    if not names:
        return None
    part = trace if window is None else trace.window(*window)
    with styled():
        figure, axes = panels((1.9,) * len(names))
        for axis, name in zip(axes, names, strict=True):
            scale, label = scales[name]
            axis.plot(part.time, part[name] * scale, lw=0.8 if window is None else 1.2)
            axis.set_ylabel(label)
            axis.margins(x=0)
        _shade_contact(part, mesh, axes)
        axes[-1].set_xlabel("time in s")
        file = mesh if window is None else f"{mesh}_detail"
        picture = svg(figure, file)
    title = of_mesh(trace, mesh, "Mesh force and transmission error") + ("" if window is None else ", detail")
    extra = [n for n in (f"{mesh}.contact", f"{mesh}.pairs") if n in part]
    return Plot(file, title, _contact_words(part, mesh), picture, columns(part, names + extra))


def of_mesh(trace: Trace, mesh: str, title: str) -> str:
    """The title of a figure; with the name of the mesh where there are several."""
    return f"{title}, {mesh}" if len(meshes(trace)) > 1 else title


def bearing_forces(trace: Trace, carried: bool = False) -> Plot | None:
    """Bearing forces x and y of every bearing over time; None without them. carried: of a planetary set."""
    groups = [found for b in bearings(trace) if (found := [n for d in "xy" if (n := f"bearing.{b}.f{d}") in trace])]
    if not groups:
        return None
    with styled():
        figure, axes = panels((1.7,) * len(groups))
        for axis, found in zip(axes, groups, strict=True):
            for name in found:
                axis.plot(trace.time, trace[name] * 1e-3, label=name, lw=0.8)
            finish(axis, "force in kN")
        axes[-1].set_xlabel("time in s")
        picture = svg(figure, "bearing")
    names = [name for found in groups for name in found]
    caption = "Force of the shaft on its bearing, along the axes x and y of the stage."
    if carried:
        caption = "Force of the body on its bearing, along the fixed axes x and y."
    elif len(meshes(trace)) == 1:
        caption = "Force of the gear on its bearing; x points from pinion to wheel."
    return Plot("bearing", "Bearing forces", caption, picture, columns(trace, names))


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


_DASHED: dict[str, Any] = {"ls": "--", "color": MUTED, "lw": 1.2}


def finish(axis: Axes, label: str) -> None:
    """Label, no margin along time, legend above the panel."""
    axis.set_ylabel(label)
    axis.margins(x=0)
    axis.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=5, borderaxespad=0.1)


def _mark_lock(trace: Trace, axes: list[Axes]) -> None:
    for name in trace.channels:
        if name.endswith(LOCKED):
            for start, end in spans(trace.time, trace[name].astype(bool)):
                for axis in axes:
                    axis.axvspan(start, end, color=COAST, alpha=0.45, lw=0)
                if end - start < LEAST_LABELLED * (trace.time[-1] - trace.time[0]):
                    continue
                axes[-1].annotate(
                    "locked",
                    (start, 1),
                    (4, -4),
                    xycoords=("data", "axes fraction"),
                    color=INK,
                    textcoords="offset points",
                    va="top",
                    fontsize=8.5,
                )


def _shade_contact(trace: Trace, mesh: str, axes: list[Axes]) -> None:
    if f"{mesh}.contact" not in trace:
        return
    for state, colour in ((0, OPEN), (-1, COAST), (2, GREY_BOTH)):
        for start, end in spans(trace.time, trace[f"{mesh}.contact"] == state):
            for axis in axes:
                axis.axvspan(start, end, color=colour, lw=0)


GREY_BOTH = "#dcdfe3"


def _contact_words(trace: Trace, mesh: str) -> str:
    if f"{mesh}.contact" not in trace:
        return ""
    state = trace[f"{mesh}.contact"]
    shares = [
        (0, "the teeth are apart", "orange"),
        (-1, "coast flanks carry", "blue"),
        (2, "both flanks touch", "grey"),
    ]
    words = [
        f"{text} in {np.mean(state == code):.1%} of the samples ({shade})"
        for code, text, shade in shares
        if np.any(state == code)
    ]
    return "; ".join(words).capitalize() + "." if words else "The drive flanks carry at every sample."
