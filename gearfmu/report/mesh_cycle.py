"""What an engagement does over one mesh cycle: transmission error with its harmonics, quasi-static and in the run, and
how the force lies on the flanks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from gearfmu.body import Body
from gearfmu.errors import ModelError, SimulationError
from gearfmu.geometry import involute
from gearfmu.report.chart import Chart, Curve, Heat, Panel, Plot
from gearfmu.report.plots import of_mesh
from gearfmu.report.signals import SETTLED, Window, drive_side, window_of_interest
from gearfmu.stage import assemble
from gearfmu.stage.assembly.meshes import EXTERNAL, kind_of
from gearfmu.stage.run.flank_loads import FlankLoads, flank_loads
from gearfmu.stage.run.place import place_of
from gearfmu.stage.run.te import mesh_harmonics, statics_of
from gearfmu.stage.run.touching import position_of
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape

HARMONICS, BINS, LEAST_PERIODS = 8, 48, 8
LEAST_LOAD = 0.01  # of torque_max: below it flanks part, and there is no cycle to speak of
ROLLS, WIDTHS = 60, 61  # rows and columns of a contact pattern
POSITIONS, POSITIONS_OF_SET = 24, 16  # over a pitch: a set solves all its meshes at each
STATIC, RUN = "quasi-static", "in the run"


def static_loads(
    trace: Trace, window: Window, meshes: Sequence[str], stage: Stage, bodies: Sequence[Body]
) -> tuple[dict[str, FlankLoads], list[str]]:
    """Statics of engagements under the mean mesh force that each has over the window, and in words why others are not
    there; those with hardly a load are left out."""
    model, part, found = assemble(stage, bodies), trace.window(window.start, window.end), {}
    missing, kernel = [], None
    slices = float(trace.meta.get("slices") or 5)
    positions = POSITIONS if model.stage.frame_of(model.stage.engagements[0]) is None else POSITIONS_OF_SET
    for mesh in meshes:
        try:
            place = place_of(model, mesh)
            torque = float(np.mean(part[f"{mesh}.force"])) * place.lever
            torque *= math.cos(mesh_shape(model.stage, model.stage.engagements[place.number]).gears[0].beta_b)
            if abs(torque) >= LEAST_LOAD * place.most:
                kernel = kernel or statics_of(model, slices=slices)
                found[mesh] = flank_loads(model, torque, mesh, positions, kernel)
        except (SimulationError, ModelError) as error:
            missing.append(f"Mesh cycle and contact pattern of {mesh}: {error}")
    return found, missing


def folded(position: np.ndarray, values: np.ndarray) -> np.ndarray | None:
    """Mean (BINS,) of values (n,) by the part of the mesh cycle, position (n,) in pitches; None for fewer than
    LEAST_PERIODS pitches and where samples leave a part empty."""
    if np.ptp(position) < LEAST_PERIODS:
        return None
    bins = (np.mod(position, 1.0) * BINS).astype(int) % BINS
    count = np.bincount(bins, minlength=BINS)
    return np.bincount(bins, values, BINS) / count if np.all(count) else None


def no_mean_cycle(window: Window, position: np.ndarray | None) -> str:
    """Why a run has no mean mesh cycle, as a sentence. position (n,): pitches within its window."""
    if window.reason != SETTLED:
        early = "settling time" in window.reason
        return "The run is too short: it ends before it has settled." if early else "The run is not steady."
    if position is None:
        return "The angle of gear B was not recorded."
    if np.ptp(position) < LEAST_PERIODS:
        return f"The run is too short: {np.ptp(position):.1f} mesh periods after settling, {LEAST_PERIODS} are needed."
    return "The samples are too few: they leave parts of the mesh cycle empty."


def transmission_error(trace: Trace, window: Window, stage: Stage, name: str, loads: FlankLoads | None) -> Plot | None:
    """Transmission error of an engagement over the mesh cycle with its harmonics: quasi-static by its `loads`, and of a
    steady run its mean over all cycles of the window; None without either."""
    part, curves = trace.window(window.start, window.end), {}
    mesh = next((e for e in stage.engagements if e.name == name), None)
    if mesh is None:
        return None
    if loads is not None:
        order = np.argsort(np.mod(loads.position, 1.0))
        curves[STATIC] = (np.mod(loads.position, 1.0)[order], 1e6 * loads.te[order])
    position, mean = position_of(part, stage, mesh), None
    if window.reason == SETTLED and position is not None and f"{name}.te" in part:
        mean = folded(position, 1e6 * part[f"{name}.te"])
    if mean is not None:
        curves[RUN] = ((np.arange(BINS) + 0.5) / BINS, mean)
    if not curves:
        return None
    looks = {STATIC: "dashed", RUN: ""}
    over = [Curve(x, y, words, "µm", looks[words], k) for k, (words, (x, y)) in enumerate(curves.items())]
    lines = {words: mesh_harmonics(y[None], HARMONICS)[0] for words, (_, y) in curves.items()}
    orders = np.arange(1.0, HARMONICS + 1)
    bars = [Curve(orders, line, words, "µm rms", "bars", k) for k, (words, line) in enumerate(lines.items())]
    panels = (
        Panel("transmission error in µm", tuple(over), height=220, x_label="position in pitches", x_limits=(0.0, 1.0)),
        Panel("harmonics in µm, rms", tuple(bars), height=220, x_label="harmonic of the mesh"),
    )
    told = "; ".join(f"{words} {np.ptp(y):.3g} µm peak to peak" for words, (_, y) in curves.items())
    caption = f"Dashed: {STATIC}, under the mean mesh force of the run. " if STATIC in curves else ""
    if RUN in curves:
        caption += f"In the run: mean over all mesh cycles, {window.start:.3g} s to {window.end:.3g} s. "
    else:
        caption += f"No mean cycle of the run. {no_mean_cycle(window, position)} "
    file = "mesh_cycle" if len(stage.engagements) == 1 else f"mesh_cycle_{name}"
    title = of_mesh(trace, name, "Transmission error over the mesh cycle")
    data = {"harmonic": orders} | {f"{words}_harmonic_[um rms]": line for words, line in lines.items()}
    return Plot(file, title, f"{caption}{told[:1].upper()}{told[1:]}.", Chart(panels, across=2), data)


def contact_pattern(trace: Trace, stage: Stage, mesh: str, loads: FlankLoads) -> Plot:
    """Force per width on the flanks of both gears of an engagement, and its load over the width in the run where forces
    of slices were recorded."""
    engagement = next(e for e in stage.engagements if e.name == mesh)
    pair = mesh_shape(stage, engagement)
    pressed = loads.roll[loads.force > 0]
    rolls = np.linspace(pressed.min(), pressed.max(), ROLLS)
    z = np.linspace(-500, 500, WIDTHS) * loads.face_width
    load = over_width(1e-3 * loads.line_load(rolls), 1e3 * loads.width, z)
    sense = 1 if kind_of(pair) == EXTERNAL else -1
    other = sense * (pair.length - rolls) if sense > 0 else rolls + pair.length
    top, half, panels = float(load.max()), 500 * loads.face_width, []
    for gear, geometry, own in zip(engagement.gears, pair.gears, (rolls, other), strict=True):
        diameter = 2e3 * involute.radius_at_roll(np.maximum(own, 0.0), geometry.r_b)
        order = np.argsort(diameter)
        heat = Heat(z, diameter[order], load[order], 0.0, top, "N/mm", "steel")
        panels.append(Panel(f"{gear}: diameter on the flank in mm", (), heat, height=230, x_limits=(-half, half)))
    window = window_of_interest(trace)
    part = trace.window(window.start, window.end)
    panels += _over_width(part, mesh, loads)
    flank = "drive" if loads.side == drive_side(trace, mesh) else "coast"
    caption = (
        f"Force per width on the {flank} flanks over a whole engagement, quasi-static under the mean mesh force of the "
        f"run, interpolated between {loads.width.size} slices; largest {top:.4g} N/mm. "
        "Left to right: from −b/2 to +b/2 of the common face width. "
    )
    factor = face_load_factor(part, mesh)
    if factor is not None:
        caption += f"In the run ({window.reason}) the most loaded slice carries {factor:.3f} times the mean "
        caption += "(K_Hβ of ISO 6336-1)."
    file = "contact" if len(stage.engagements) == 1 else f"contact_{mesh}"
    data = {
        "roll_A_[mm]": np.repeat(1e3 * rolls, z.size),
        "z_[mm]": np.tile(z, rolls.size),
        "load_[N/mm]": load.ravel(),
    }
    title = of_mesh(trace, mesh, "Contact pattern")
    return Plot(file, title, caption, Chart(tuple(panels), "place on the face width in mm", across=2), data)


def over_width(load: np.ndarray, middles: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Load (R, S) at the middles (S,) of slices at places (W,) of the width as a smooth curve: (R, W), without
    overshoot and none below 0."""
    if middles.size < 3:
        return np.stack([np.interp(places, middles, row) for row in load])
    ends = [1.5 * load[:, :1] - 0.5 * load[:, 1:2], 1.5 * load[:, -1:] - 0.5 * load[:, -2:-1]]
    half = 0.5 * (middles[1] - middles[0])
    at = np.concatenate([[middles[0] - half], middles, [middles[-1] + half]])
    known = np.maximum(np.concatenate([ends[0], load, ends[1]], axis=1), 0.0)
    return np.asarray(PchipInterpolator(at, known, axis=1)(np.clip(places, at[0], at[-1])))


def slice_forces(trace: Trace, mesh: str) -> np.ndarray | None:
    """(S, n) N: forces of the slices that were recorded; None where slices carry alike or were not recorded."""
    names = [name for k in range(1, 11) if (name := f"{mesh}.slice_{k}") in trace]
    found = np.array([trace[name] for name in names])
    used = np.any(found != 0, axis=1) if names else np.zeros(0, bool)
    return found[used] if used.sum() > 1 else None


def face_load_factor(trace: Trace, mesh: str) -> float | None:
    """Largest mean force of a slice over the mean of all: the face load factor K_Hβ of ISO 6336-1 for slices."""
    found = slice_forces(trace, mesh)
    if found is None:
        return None
    means = np.abs(found.mean(axis=1))
    return float(means.max() / means.mean()) if means.mean() > 0 else None


def static_face_load_factor(loads: FlankLoads) -> float:
    """Largest load of a slice over the mean of all, mean over the pitch: K_Hβ for quasi-static loads."""
    total = loads.force.sum(axis=0)
    return float(total.max() / total.mean())


def _over_width(trace: Trace, mesh: str, loads: FlankLoads) -> list[Panel]:
    found = slice_forces(trace, mesh)
    if found is None:
        return []
    place = ((np.arange(len(found)) + 0.5) / len(found) - 0.5) * loads.face_width * 1e3
    per = 1e-3 * len(found) / loads.face_width
    mean, most = per * found.mean(axis=1), per * np.abs(found).max(axis=1)
    curves = (Curve(place, mean, "mean", "N/mm"), Curve(place, most, "largest magnitude", "N/mm", "dashed"))
    return [Panel("in the run, all pairs together, N/mm", curves, height=160)]
