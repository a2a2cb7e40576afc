"""What an engagement does over one mesh cycle: transmission error with its harmonics, quasi-static and in the run, and
how the force lies on the flanks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import PchipInterpolator

from gearfmu.geometry import involute
from gearfmu.report.chart import Chart, Curve, Heat, Panel, Plot
from gearfmu.report.plots import of_mesh
from gearfmu.report.run import Run
from gearfmu.report.signals import SETTLED, Window, drive_side
from gearfmu.stage.run.flank_loads import FlankLoads
from gearfmu.stage.run.te import mesh_harmonics
from gearfmu.stage.run.touching import position_of
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.shapes import mesh_shape

HARMONICS, BINS, LEAST_PERIODS = 8, 48, 8
ALONG_WIDTH = "place on the face width in mm"
ROLLS, WIDTHS = 60, 61  # rows and columns of a contact pattern
STATIC, RUN = "quasi-static", "in the run"


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


def position(run: Run, mesh: str) -> np.ndarray | None:
    """(n,) pitches: position of an engagement within the window; None where stage or angle are not known."""
    stage = run.stage
    engagement = None if stage is None else next((e for e in stage.engagements if e.name == mesh), None)
    return None if stage is None or engagement is None else position_of(run.part, stage, engagement)


def mean_cycle(run: Run, mesh: str) -> np.ndarray | None:
    """(BINS,) µm: mean transmission error over all mesh cycles of the window; None where there is none."""
    at = position(run, mesh)
    return None if at is None or f"{mesh}.te" not in run.part else folded(at, 1e6 * run.part[f"{mesh}.te"])


def with_harmonics(over: Panel, lines: Mapping[str, np.ndarray]) -> Chart:
    """A panel over the mesh cycle, and beside it the harmonics (HARMONICS,) µm rms of its curves."""
    orders = np.arange(1.0, HARMONICS + 1)
    bars = tuple(Curve(orders, line, name, "µm rms", "bars") for name, line in lines.items())
    beside = Panel("harmonics in µm, rms", bars, height=over.height, x_label="harmonic of the mesh")
    return Chart((over, beside), across=2)


def transmission_error(run: Run, name: str) -> Plot | None:
    """Transmission error of an engagement over the mesh cycle with its harmonics: quasi-static by its loads, and of a
    steady run its mean over all cycles of the window; None without either."""
    window, loads, curves = run.window, run.loads.get(name), {}
    if loads is not None:
        order = np.argsort(np.mod(loads.position, 1.0))
        curves[STATIC] = (np.mod(loads.position, 1.0)[order], 1e6 * loads.te[order])
    if window.reason == SETTLED and (mean := mean_cycle(run, name)) is not None:
        curves[RUN] = ((np.arange(BINS) + 0.5) / BINS, mean)
    if not curves:
        return None
    looks = {STATIC: "dashed", RUN: ""}
    over = tuple(Curve(x, y, words, "µm", looks[words]) for words, (x, y) in curves.items())
    lines = {words: mesh_harmonics(y[None], HARMONICS)[0] for words, (_, y) in curves.items()}
    panel = Panel("transmission error in µm", over, height=220, x_label="position in pitches", x_limits=(0.0, 1.0))
    told = "; ".join(f"{words} {np.ptp(y):.3g} µm peak to peak" for words, (_, y) in curves.items())
    caption = f"Dashed: {STATIC}, under the mean mesh force of the run. " if STATIC in curves else ""
    if RUN in curves:
        caption += f"In the run: mean over all mesh cycles, {window.start:.3g} s to {window.end:.3g} s. "
    else:
        caption += f"No mean cycle of the run. {no_mean_cycle(window, position(run, name))} "
    title = of_mesh(run.trace, name, "Transmission error over the mesh cycle")
    data = {"harmonic": np.arange(1.0, HARMONICS + 1)}
    data |= {f"{words}_harmonic_[um rms]": line for words, line in lines.items()}
    caption += f"{told[:1].upper()}{told[1:]}."
    return Plot(_file("mesh_cycle", run, name), title, caption, with_harmonics(panel, lines), data)


def _file(kind: str, run: Run, mesh: str) -> str:
    return kind if run.stage is None or len(run.stage.engagements) == 1 else f"{kind}_{mesh}"


def contact_pattern(run: Run, mesh: str) -> Plot | None:
    """Force per width on the flanks of both gears of an engagement, and its load over the width in the run where forces
    of slices were recorded; None without statics."""
    if run.stage is None or mesh not in run.loads:
        return None
    loads, engagement = run.loads[mesh], next(e for e in run.stage.engagements if e.name == mesh)
    pair = mesh_shape(run.stage, engagement)
    pressed = loads.roll[loads.force > 0]
    rolls = np.linspace(pressed.min(), pressed.max(), ROLLS)
    z = np.linspace(-500, 500, WIDTHS) * loads.face_width
    load = over_width(1e-3 * loads.line_load(rolls), 1e3 * loads.width, z)
    top, half, panels = float(load.max()), 500 * loads.face_width, []
    for gear, geometry, own in zip(engagement.gears, pair.gears, (rolls, pair.opposite(rolls)), strict=True):
        diameter = 2e3 * involute.radius_at_roll(np.maximum(own, 0.0), geometry.r_b)
        order = np.argsort(diameter)
        heat = Heat(z, diameter[order], load[order], 0.0, top, "N/mm", "steel")
        panels.append(Panel(f"{gear}: diameter on the flank in mm", (), heat, height=230, x_limits=(-half, half)))
    panels += _over_width(run.part, mesh, loads)
    flank = "drive" if loads.side == drive_side(run.trace, mesh) else "coast"
    caption = (
        f"Force per width on the {flank} flanks over a whole engagement, quasi-static under the mean mesh force of the "
        f"run, interpolated between {loads.width.size} slices; largest {top:.4g} N/mm. "
        "Left to right: from −b/2 to +b/2 of the common face width. "
    )
    factor = face_load_factor(run.part, mesh)
    if factor is not None:
        caption += f"In the run ({run.window.reason}) the most loaded slice carries {factor:.3f} times the mean "
        caption += "(K_Hβ of ISO 6336-1)."
    data = {
        "roll_A_[mm]": np.repeat(1e3 * rolls, z.size),
        "z_[mm]": np.tile(z, rolls.size),
        "load_[N/mm]": load.ravel(),
    }
    title, chart = of_mesh(run.trace, mesh, "Contact pattern"), Chart(tuple(panels), ALONG_WIDTH, across=2)
    return Plot(_file("contact", run, mesh), title, caption, chart, data)


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
