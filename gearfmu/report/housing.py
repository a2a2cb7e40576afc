"""The chapter of a housing: accelerations of its sensors, forces of its mounts, sound power of its skin."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from gearfmu.errors import GearfmuError
from gearfmu.report import plots, plots_nvh
from gearfmu.report.chart import Chart, Curve, Panel, Plot, level_limits, over_time
from gearfmu.report.metrics import MetricsError, level, sample_step, undo_mean
from gearfmu.report.plots_nvh import ACCELERATIONS, SENSOR
from gearfmu.report.run import Run
from gearfmu.report.signals import Window
from gearfmu.sound import SoundError, SoundPower, midbands, nominal, segments, third_octaves
from gearfmu.sound import level as power_level
from gearfmu.stage.run.sound import Sounding, radiated_power
from gearfmu.stage.run.trace import Trace

NAME = "housing"  # what the names of its figures begin with
MOUNT = "mount."
PATCHES = 300  # boundary elements of the sound power: seconds
BANDS = (63.0, 8000.0)  # Hz, nominal first and last third octave


def figures(run: Run) -> list[Callable[[], Plot | None]]:
    """What makes the chapter; nothing where no sensor of a housing moves."""
    trace, window, names = run.trace, run.window, sensors(run.trace)
    if not names:
        return []
    found: list[Callable[[], Plot | None]] = [partial(accelerations, trace, window)]
    if run.run_up is None:
        found.append(partial(plots_nvh.spectra, trace, window, run.angles, names, ACCELERATIONS))
        loud = plots_nvh.loudest_sensors(trace)
        found += [partial(plots_nvh.cuts, trace, own, loud, ACCELERATIONS) for own in run.angles.items()]
    return [*found, partial(mounts, trace), partial(sound, run)]


def sensors(trace: Trace) -> list[str]:
    """Channels of the sensors of a housing that moves, in the trace's order."""
    return [name for name in trace.channels if name.startswith(SENSOR) and np.any(trace[name])]


def accelerations(trace: Trace, window: Window) -> Plot:
    """Third octaves of every sensor's accelerations over a window, their averaging over the step taken out."""
    part, names = trace.window(window.start, window.end), sensors(trace)
    try:
        pieces = segments(part.time, np.stack([part[name] for name in names], axis=1), moved=False)
    except SoundError as error:
        raise MetricsError(f"Accelerations in third octaves: {error}") from error
    squares = 0.5 * (np.abs(pieces.velocity) ** 2).mean(axis=0)
    squares = undo_mean(np.sqrt(squares.T), pieces.frequency, sample_step(part.time)) ** 2
    bands = midbands(*BANDS)
    bands = bands[bands * 10**0.05 < pieces.frequency[-1]]
    levels = level(np.sqrt(third_octaves(pieces.frequency, squares, bands)), ACCELERATIONS.reference)
    panels = []
    for sensor in dict.fromkeys(name.rsplit(".", 1)[0] for name in names):
        own = {name: levels[i] for i, name in enumerate(names) if name.startswith(f"{sensor}.")}
        panels.append(_bars(own, bands, f"{sensor.removeprefix(SENSOR)}: {ACCELERATIONS.label}", ACCELERATIONS.label))
    caption = f"Accelerations in third octaves (IEC 61260-1), from {window.start:.3f} s to {window.end:.3f} s "
    caption += f"({window.reason}); 120 dB are 1 m/s² rms. Lines {pieces.frequency[1]:.3g} Hz apart."
    columns = {"third_octave_[Hz]": bands} | {f"{n}_[{ACCELERATIONS.label}]": levels[i] for i, n in enumerate(names)}
    chart = Chart(tuple(panels), "third octave in Hz", f"{NAME}_octaves")
    return Plot(f"{NAME}_octaves", "Accelerations of the housing", caption, chart, columns)


def mounts(trace: Trace) -> Plot | None:
    """Forces of the housing on the ground over time; None without mounts."""
    names = [n for n in trace.channels if n.startswith(MOUNT) and n.split(".")[-1] in ("fx", "fy", "fz")]
    feet = dict.fromkeys(name.split(".")[1] for name in names)
    if not feet:
        return None
    groups = {foot: [name for name in names if name.startswith(f"{MOUNT}{foot}.")] for foot in feet}
    panels = [Panel(f"{foot}: force in N", plots.channels(trace, own)) for foot, own in groups.items()]
    caption = "Force of the housing on the ground, along the axes of the stage."
    return Plot(f"{NAME}_mounts", "Forces of the mounts", caption, over_time(panels), plots.columns(trace, names))


def sound(run: Run) -> Plot:
    """Sound power and equivalent radiated power in third octaves; MetricsError says why there is none."""
    if run.stage is None or run.bodies is None:
        raise MetricsError("Sound power of the housing: the stage's bodies are not at hand.")
    try:
        found = radiated_power(run.trace, run.stage, run.bodies, Sounding(patches=PATCHES, start=run.window.start))
    except GearfmuError as error:
        raise MetricsError(f"Sound power of the housing: {error}") from error
    levels = {"sound power": power_level(found.third_octaves()[0])}
    levels["ERP"] = power_level(found.third_octaves(erp=True)[0])
    panel = _bars(levels, found.bands, "dB re 1 pW", "dB re 1 pW")
    columns = {"third_octave_[Hz]": found.bands}
    columns |= {f"{name.replace(' ', '_').lower()}_[dB re 1 pW]": own for name, own in levels.items()}
    chart = Chart((panel,), "third octave in Hz", f"{NAME}_sound")
    return Plot(f"{NAME}_sound", "Sound power of the housing", _totals(found, run.window), chart, columns)


def _totals(found: SoundPower, window: Window) -> str:
    """Levels in words."""
    (power, power_a), (erp, erp_a) = ((float(found.total(o)[0]), float(found.total_a(o)[0])) for o in (False, True))
    return (
        f"Sound power level {power:.1f} dB, {power_a:.1f} dB(A) re 1 pW; equivalent radiated power (ERP) {erp:.1f} dB, "
        f"{erp_a:.1f} dB(A). Into free air, from {window.start:.3f} s on, by {PATCHES} boundary elements at most; "
        "gearfmu sound takes more."
    )


def _bars(levels: dict[str, np.ndarray], bands: np.ndarray, label: str, unit: str) -> Panel:
    """Levels by third octave, side by side."""
    at = np.arange(bands.size, dtype=float)
    curves = tuple(Curve(at, own, name, unit, "bars") for name, own in levels.items())
    ticks = tuple(f"{band:g}" for band in nominal(bands))
    return Panel(label, curves, limits=level_limits(curves), ticks=ticks)
