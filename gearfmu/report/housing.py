"""The chapter of a housing: accelerations of its sensors and paths to them, forces of its mounts, its sound power."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from gearfmu.body import Body, body_path
from gearfmu.body.sound import body_skin, kept_radiation, sound_path
from gearfmu.errors import GearfmuError
from gearfmu.modes.paths import paths_of
from gearfmu.report import plots, plots_nvh
from gearfmu.report.chart import Chart, Curve, Panel, Plot, level_limits, over_time
from gearfmu.report.kinds import ACCELERATIONS, SENSOR, by_part, loudest_sensors, sensors
from gearfmu.report.metrics import MetricsError, sample_step, undo_mean
from gearfmu.report.plots_nvh import heat_of
from gearfmu.report.run import Run
from gearfmu.report.runup import RunUp
from gearfmu.report.signals import GEAR_SPEED
from gearfmu.sound import BANDS, SoundError, SoundPower, bands_of, nominal, radiation, segments, third_octaves
from gearfmu.sound import level as power_level
from gearfmu.stage.run.housing import Heard, housing_body, radiated_power
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage

NAME = "housing"  # what the names of its figures begin with
MOUNT = "mount."
PATCHES = 300  # boundary elements where none are stored: seconds
POWER = "dB re 1 pW"


def figures(run: Run) -> list[Callable[[], Plot | None]]:
    """What makes the chapter; nothing where no sensor of a housing moves."""
    names = sensors(run.trace)
    if not names:
        return []
    found: list[Callable[[], Plot | None]] = [partial(accelerations, run)]
    if run.run_up is None:
        found.append(partial(plots_nvh.spectra, run, names, ACCELERATIONS))
        loud = loudest_sensors(run.trace)
        found += [partial(plots_nvh.cuts, run, mesh, loud, ACCELERATIONS) for mesh in run.angles]
    sounding = partial(sound, run) if run.run_up is None else partial(sound_over_speed, run.run_up, run)
    return [*found, partial(transfer_paths, run), partial(mounts, run.trace), sounding]


def accelerations(run: Run) -> Plot:
    """Third octaves of every sensor's accelerations over the window, their averaging over the step taken out."""
    part, window, names = run.part, run.window, sensors(run.trace)
    try:
        pieces = segments(part.time, np.stack([part[name] for name in names], axis=1), moved=False)
    except SoundError as error:
        raise MetricsError(f"Accelerations in third octaves: {error}") from error
    squares = 0.5 * (np.abs(pieces.velocity) ** 2).mean(axis=0)
    squares = undo_mean(np.sqrt(squares.T), pieces.frequency, sample_step(part.time)) ** 2
    bands = bands_of(pieces.frequency)
    rows, unit = ACCELERATIONS.level(np.sqrt(third_octaves(pieces.frequency, squares, bands))), ACCELERATIONS.label
    levels = dict(zip(names, rows, strict=True))
    panels = [
        _bars({name: levels[name] for name in own}, bands, f"{own[0].split('.')[1]}: {unit}", unit)
        for own in by_part(names)
    ]
    caption = f"Accelerations in third octaves (IEC 61260-1), from {window.start:.3f} s to {window.end:.3f} s "
    caption += f"({window.reason}); 120 dB are 1 m/s² rms. Lines {pieces.frequency[1]:.3g} Hz apart."
    columns = {"third_octave_[Hz]": bands} | {f"{name}_[{unit}]": own for name, own in levels.items()}
    chart = Chart(tuple(panels), "third octave in Hz", f"{NAME}_octaves")
    return Plot(f"{NAME}_octaves", "Accelerations of the housing", caption, chart, columns)


def mounts(trace: Trace) -> Plot:
    """Forces of the housing on the ground over time."""
    names = [n for n in trace.channels if n.startswith(MOUNT) and n.split(".")[-1] in ("fx", "fy", "fz")]
    panels = [Panel(f"{own[0].split('.')[1]}: force in N", plots.channels(trace, own)) for own in by_part(names)]
    caption = "Force of the housing on the ground, along the axes of the stage."
    return Plot(f"{NAME}_mounts", "Forces of the mounts", caption, over_time(panels), plots.columns(trace, names))


def sound(run: Run) -> Plot:
    """Sound power and equivalent radiated power in third octaves; MetricsError says why there is none."""
    found, patches = _radiated(run, Heard(start=run.window.start))
    levels = {"sound power": power_level(found.third_octaves()[0])}
    levels["ERP"] = power_level(found.third_octaves(erp=True)[0])
    panel = _bars(levels, found.bands, POWER, POWER)
    columns = {"third_octave_[Hz]": found.bands}
    columns |= {f"{name.replace(' ', '_').lower()}_[{POWER}]": own for name, own in levels.items()}
    chart = Chart((panel,), "third octave in Hz", f"{NAME}_sound")
    (power, power_a), (erp, erp_a) = ((float(found.total(o)[0]), float(found.total_a(o)[0])) for o in (False, True))
    caption = f"Sound power level {power:.1f} dB, {power_a:.1f} dB(A) re 1 pW; equivalent radiated power (ERP) "
    caption += f"{erp:.1f} dB, {erp_a:.1f} dB(A). Into free air, from {run.window.start:.3f} s on, by {patches} "
    caption += "boundary elements."
    return Plot(f"{NAME}_sound", "Sound power of the housing", caption, chart, columns)


def sound_over_speed(up: RunUp, run: Run) -> Plot:
    """Waterfall of a run-up: level over speed, and lines over frequency and speed; MetricsError says why not."""
    found, patches = _radiated(run, Heard(f"{up.shaft}{GEAR_SPEED}", run.window.start))
    assert found.speed is not None, "of a waterfall"
    speed = np.abs(found.speed) * plots.RPM
    levels = {"sound power": found.total(), "sound power, A-weighted": found.total_a(), "ERP": found.total(erp=True)}
    curves = tuple(Curve(speed, own, name, POWER) for name, own in levels.items())
    kept = (found.frequency > 0) & (found.frequency <= BANDS[1])
    lines = power_level(found.power[:, kept]).T
    heat = heat_of(speed, found.frequency[kept] / 1e3, lines, lines.max(), f"{POWER} a line")
    panels = (
        Panel(POWER, curves, limits=level_limits(curves)),
        Panel("frequency in kHz", heat=heat, height=300, limits=(0.0, BANDS[1] / 1e3)),
    )
    caption = f"Sound power into free air by {patches} boundary elements, {speed.size} spectra of lines "
    caption += f"{found.frequency[1]:.3g} Hz apart. Loudest at {speed[levels['sound power'].argmax()]:.0f} rpm: "
    caption += f"{levels['sound power'].max():.1f} dB, {found.total_a().max():.1f} dB(A) at most."
    columns = {f"speed_of_the_{up.shaft}_[rpm]": speed}
    columns |= {f"{name.replace(', ', '_').replace(' ', '_')}_[{POWER}]": own for name, own in levels.items()}
    columns |= {f"{f:.0f}_Hz_[{POWER}]": own for f, own in zip(found.frequency[kept], lines, strict=True)}
    chart = Chart(panels, f"speed of the {up.shaft} in rpm", "speed", x_limits=(float(speed.min()), float(speed.max())))
    return Plot(f"{NAME}_waterfall", "Sound power over the speed", caption, chart, columns)


def transfer_paths(run: Run) -> Plot:
    """Share of every bearing direction at the loudest sensor, in its loudest third octave and in all."""
    stage, bodies = _at_hand(run, "Transfer paths")
    loudest = max(loudest_sensors(run.trace), key=lambda name: float(np.std(run.trace[name])))
    try:
        found = paths_of(run.trace, stage, bodies, loudest, run.window.start)
    except GearfmuError as error:
        raise MetricsError(f"Transfer paths of the housing: {error}") from error
    alone, joint = found.octaves()
    band = float(nominal(found.bands[[joint.sum(axis=0).argmax()]])[0])
    shares = {"all third octaves": 100 * found.share(), f"third octave {band:g} Hz": 100 * found.share(band)}
    caption = f"Share of every bearing direction in the mean square of {found.sensor}. Shares sum to 100 %; one "
    caption += (
        "below 0 makes the sensor quieter. Forces of bearings times transfer functions of the housing on its feet."
    )
    rows = zip(found.names, ACCELERATIONS.level(np.sqrt(alone)), strict=True)
    columns = {"third_octave_[Hz]": found.bands} | {f"{name}_[{ACCELERATIONS.label}]": own for name, own in rows}
    panels = tuple(_by_bearing(f"{words}: share in %", found.names, own) for words, own in shares.items())
    chart = Chart(panels, "bearing", f"{NAME}_paths")
    return Plot(f"{NAME}_paths", f"Transfer paths to {found.sensor.removeprefix(SENSOR)}", caption, chart, columns)


def _by_bearing(label: str, names: Sequence[str], shares: np.ndarray) -> Panel:
    """Shares in % of bearing.NAME.fx …: bearings along the axis, a bar for each of their directions."""
    parts = [name.removeprefix("bearing.").split(".") for name in names]
    bearings, directions = (list(dict.fromkeys(part[k] for part in parts)) for k in (0, 1))
    table = np.zeros((len(directions), len(bearings)))
    for (bearing, direction), share in zip(parts, shares, strict=True):
        table[directions.index(direction), bearings.index(bearing)] = share
    at = np.arange(len(bearings), dtype=float)
    curves = (Curve(at, row, name, "%", "bars") for name, row in zip(directions, table, strict=True))
    return Panel(label, tuple(curves), ticks=tuple(bearings))


def _at_hand(run: Run, what: str) -> tuple[Stage, Sequence[Body]]:
    if run.stage is None or run.bodies is None:
        raise MetricsError(f"{what} of the housing: the stage's bodies are not at hand.")
    return run.stage, run.bodies


def _radiated(run: Run, heard: Heard) -> tuple[SoundPower, int]:
    """Sound power by the matrix beside the body, and its boundary elements; by fewer where there is none."""
    stage, bodies = _at_hand(run, "Sound power")
    try:
        body = housing_body(stage, bodies)
        sound = kept_radiation(body, sound_path(body_path(stage, body.name)))
        sound = sound or radiation(body_skin(body), count=PATCHES)
        return radiated_power(run.trace, stage, bodies, sound, heard), sound.patches
    except GearfmuError as error:
        raise MetricsError(f"Sound power of the housing: {error}") from error


def _bars(levels: dict[str, np.ndarray], bands: np.ndarray, label: str, unit: str) -> Panel:
    """Levels by third octave, side by side."""
    at = np.arange(bands.size, dtype=float)
    curves = tuple(Curve(at, own, name, unit, "bars") for name, own in levels.items())
    ticks = tuple(f"{band:g}" for band in nominal(bands))
    return Panel(label, curves, limits=level_limits(curves), ticks=ticks)
