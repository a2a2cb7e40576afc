"""The report of one run: report.html, the data of every plot as CSV, summary.json."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.files import write_text
from gearfmu.modes.deformed import DeformedGear, deformed_gear
from gearfmu.report import deformation as drawn
from gearfmu.report import page, picture, plots, plots_nvh, plots_runup, plots_set, runup
from gearfmu.report.levels import HEADER, fingerprint, levels_path, read_levels, shown_rows
from gearfmu.report.metrics import MetricsError
from gearfmu.report.plots import Plot
from gearfmu.report.plots_set import PlanetSet
from gearfmu.report.results import key_results, strict
from gearfmu.report.signals import SETTLED, Window, known_meshings, mesh_angles, meshes, window_of_interest
from gearfmu.spec.expand import as_general
from gearfmu.stage.deformation import Deformation, DeformationError
from gearfmu.stage.meshes import tooth_phases
from gearfmu.stage.observed import gear_bodies
from gearfmu.stage.trace import Trace, write_columns

NVH = ("spectrum", "orders", "spectrogram")


def write(
    trace: Trace,
    summary: Mapping[str, Any],
    out_dir: str | os.PathLike[str],
    spec: Any = None,
    bodies: Sequence[Any] | None = None,
    deformation: Deformation | None = None,
) -> Path:
    """Write report.html, summary.json and data/<plot>.csv into `out_dir` and return the path of the page.

    trace : any subset of channels; what a missing channel would feed is left out, and said where it matters.
    summary : fields of docs/file-formats.md; what is missing is shown as "not given".
    spec : the stage, for tooth numbers; bodies : its ReducedBody objects, for the picture of the deformed gears;
    deformation : of gears at chosen times, drawn where bodies are given too. Raises OSError when the folder cannot be
    written.
    """
    folder = Path(out_dir)
    results = key_results(trace)
    deformed, gaps = _deformed(deformation, spec, bodies)
    made, missing = _plots(trace, spec, bodies, _of_deformation(deformation, deformed, trace, spec))
    missing = [*gaps, *missing]
    for plot in made:
        write_columns(folder / "data" / f"{plot.name}.csv", plot.columns)
    write_text(folder / "summary.json", json.dumps(strict({**summary, "results": results}), indent=2) + "\n")
    write_text(folder / "report.html", _document(trace, summary, (made, missing), spec, bodies))
    return folder / "report.html"


def _deformed(
    deformation: Deformation | None, spec: Any, bodies: Sequence[Any] | None
) -> tuple[list[DeformedGear], list[str]]:
    """The gears whose deformation can be drawn, and in words why others cannot."""
    if deformation is None or spec is None or not bodies:
        return [], [] if deformation is None else ["Deformed gears: the stage's bodies are not at hand."]
    known, found, missing = gear_bodies(spec, bodies), [], []
    phases = tooth_phases(as_general(spec))
    for name, motion in deformation.gears.items():
        try:
            found.append(deformed_gear(name, known[name], motion, phases[name]))
        except (DeformationError, KeyError) as error:
            missing.append(f"Deformed gears: {error}")
    return found, missing


def _of_deformation(
    deformation: Deformation | None, gears: Sequence[DeformedGear], trace: Trace, spec: Any
) -> list[Callable[[], Plot | None]]:
    """What makes the pictures and films of deformed gears."""
    if deformation is None or not gears:
        return []
    stage = as_general(spec)
    kinds = (drawn.pictures, drawn.film)
    return [partial(kind, deformation, gear, trace, stage) for gear in gears for kind in kinds]


def _plots(
    trace: Trace, spec: Any, bodies: Sequence[Any] | None, deformed: Sequence[Callable[[], Plot | None]]
) -> tuple[list[Plot], list[str]]:
    """Every plot the trace allows, and in words why others are not there."""
    angles, window = mesh_angles(trace, spec), window_of_interest(trace)
    own_set = plots_set.planet_set(trace, known_meshings(trace, spec))
    makers: list[Callable[[], Plot | None]]
    if own_set is not None:
        return _made(_of_set(trace, own_set, spec, bodies, [*deformed, *_set_pair(trace, own_set, spec, bodies)]))
    makers = [lambda: plots.torque_and_slip(trace), lambda: plots.speeds(trace)]
    for mesh in meshes(trace):
        makers += [
            partial(plots.mesh_force_and_error, trace, mesh),
            partial(plots.mesh_force_and_error, trace, mesh, detail_window(trace, mesh, angles.get(mesh))),
        ]
    makers.append(lambda: plots.bearing_forces(trace))
    if spec is not None and bodies:
        makers += [partial(picture.deformed_pair, trace, as_general(spec), mesh, bodies) for mesh in meshes(trace)]
    makers += deformed
    run = _run_up(trace, window, spec, bodies)
    if run is not None:
        makers += [partial(make, run) for make in plots_runup.FIGURES]
    else:
        makers.append(lambda: plots_nvh.force_spectrum(trace, window, angles))
    makers += [partial(plots_nvh.order_cuts, trace, mesh, angle) for mesh, angle in angles.items()]
    if run is None:
        makers.append(lambda: plots_nvh.force_spectrogram(trace, angles))
    made, missing = _made(makers)
    if not angles:
        missing.append("No mesh orders: the trace has no gear speed or nobody said the tooth numbers.")
    return made, missing


def _run_up(trace: Trace, window: Window, spec: Any, bodies: Sequence[Any] | None) -> runup.RunUp | None:
    """The run-up of a stage of one engagement, with its resonances where the stage is at hand; None for no run-up."""
    known = known_meshings(trace, spec)
    if len(known) != 1:
        return None
    ((mesh, meshing),) = known.items()
    run = runup.run_up_of_pair(trace, mesh, meshing, window)
    if run is None or spec is None or not bodies or f"{mesh}.force" not in run.signals:
        return run
    return replace(run, resonances=runup.resonances(run, mesh, spec, bodies))


def _set_pair(trace: Trace, own: PlanetSet, spec: Any, bodies: Sequence[Any] | None) -> list[Callable[[], Plot | None]]:
    """What draws the sun with the planet that presses most."""
    if spec is None or not bodies or "sun" not in own.meshes:
        return []
    mesh = max(own.meshes["sun"].values(), key=lambda name: float(np.abs(trace[f"{name}.force"]).max()))
    known = list(gear_bodies(spec, bodies).values())
    return [partial(picture.deformed_pair, trace, as_general(spec), mesh, known)]


def _of_set(
    trace: Trace,
    own: PlanetSet,
    spec: Any,
    bodies: Sequence[Any] | None,
    deformed: Sequence[Callable[[], Plot | None]],
) -> list[Callable[[], Plot | None]]:
    """What makes the plots of a planetary set: its planets side by side instead of mesh by mesh."""
    window = window_of_interest(trace)
    run = runup.run_up_of_set(trace, own, window, spec, bodies)
    over_frequency: list[Callable[[], Plot | None]] = [lambda: plots_set.spectrum(trace, own, window)]
    if run is not None:
        over_frequency = [partial(make, run) for make in plots_runup.FIGURES]
    return [
        lambda: plots_set.speeds(trace, own),
        lambda: plots.torque_and_slip(trace),
        lambda: plots_set.forces(trace, own),
        lambda: plots_set.forces(trace, own, plots_set.detail_window(trace, own, window)),
        lambda: plots_set.planets(trace, own, window),
        lambda: plots_set.sharing(trace, own, window),
        lambda: plots_set.pin_forces(trace, own),
        *deformed,
        lambda: plots.bearing_forces(trace, carried=True),
        lambda: plots_set.energy(trace),
        *over_frequency,
    ]


def _made(makers: Sequence[Callable[[], Plot | None]]) -> tuple[list[Plot], list[str]]:
    """The plots that could be made, and in words why others could not."""
    made, missing = [], []
    for maker in makers:
        try:
            plot = maker()
        except MetricsError as error:
            missing.append(str(error))
            continue
        if plot is not None:
            made.append(plot)
    return made, list(dict.fromkeys(missing))


def detail_window(trace: Trace, mesh: str, angle: np.ndarray | None, periods: float = 6) -> tuple[float, float]:
    """About `periods` mesh periods (s) around the largest force of an engagement, or a twentieth of the run where its
    mesh angle is missing."""
    start, end = float(trace.time[0]), float(trace.time[-1])
    force = np.abs(trace[f"{mesh}.force"]) if f"{mesh}.force" in trace else np.zeros(1)
    centre = float(trace.time[int(np.argmax(force))])
    half = 0.025 * (end - start)
    if angle is not None and angle[-1] > 2 * np.pi * periods:
        frequency = np.interp(centre, trace.time, np.gradient(angle, trace.time)) / (2 * np.pi)
        half = min(0.5 * periods / max(frequency, 1e-9), 0.5 * (end - start))
    centre = min(max(centre, start + half), end - half)
    return centre - half, centre + half


def _document(
    trace: Trace,
    summary: Mapping[str, Any],
    plots_and_gaps: tuple[list[Plot], list[str]],
    spec: Any,
    bodies: Sequence[Any] | None,
) -> str:
    made, missing = plots_and_gaps
    title = str(summary.get("scene") or trace.meta.get("scene") or "simulation")
    stage = str(summary.get("stage") or trace.meta.get("stage") or "stage not named")
    about = " · ".join(str(summary[key]) for key in ("description", "started") if summary.get(key))
    body = [
        page.head(title, str(summary.get("outcome", "outcome not given")), f"{stage}{' · ' + about if about else ''}"),
        page.facts(_facts(summary)),
        *[page.warning(f"{text[:1].upper()}{text[1:]}.") for text in summary.get("warnings") or ()],
        *(_planets(trace, spec) or [page.section("Results", _results(trace))]),
        *[page.figure(plot) for plot in made if not plot.name.startswith(NVH)],
        *_warned(trace),
        *([page.section("Octave bands", bands)] if (bands := _octaves(trace)) else []),
        *[page.figure(plot) for plot in made if plot.name.startswith(NVH)],
        page.section("Accuracy and cost", *_accuracy(summary, spec, bodies)),
        page.details("Where it comes from", page.pairs_table(_provenance(summary)), _channels(trace)),
    ]
    if missing:
        body.insert(
            3 + len(summary.get("warnings") or ()),
            page.section("Not shown", *[page.note(reason) for reason in missing]),
        )
    return page.page(f"{title} – {stage}", body)


def _planets(trace: Trace, spec: Any) -> list[str]:
    """The table of planets of a set."""
    own, window = plots_set.planet_set(trace, known_meshings(trace, spec)), window_of_interest(trace)
    if own is None:
        return []
    try:
        table = page.table(*plots_set.results(trace, own, window))
    except MetricsError:
        return []
    where = f"From {window.start:.4g} s to {window.end:.4g} s, {window.reason}. Share: 1 where all planets carry alike."
    return [page.section("Planets", table, page.note(where))]


def _warned(trace: Trace) -> list[str]:
    try:
        warning = plots_nvh.sampling_warning(trace)
    except MetricsError:
        return []
    return [page.warning(warning)] if warning else []


def _facts(summary: Mapping[str, Any]) -> dict[str, str]:
    return {
        "fidelity level": _text(summary, "level"),
        "dynamic modes, all gears": _text(summary, "n_dyn"),
        "slices": _text(summary, "slices"),
        "internal step": _text(summary, "h", 1e6, "µs"),
        "communication step": _text(summary, "H", 1e6, "µs"),
        "simulated": _text(summary, "simulated_s", 1, "s"),
        "CPU time": _text(summary, "cpu_s", 1, "s"),
        "CPU time per simulated second": _text(summary, "realtime_factor"),
    }


def _text(summary: Mapping[str, Any], key: str, scale: float = 1, unit: str = "") -> str:
    value = summary.get(key)
    if value is None:
        return "not given"
    if isinstance(value, (bool, str)):
        return str(value)
    return f"{value * scale:.4g} {unit}".strip()


NAMES = {
    "mesh_force_mean_N": "mesh force, mean, N",
    "mesh_force_rms_ac_N": "mesh force, rms of the alternating part, N",
    "te_mean_um": "transmission error, mean, µm",
    "te_rms_ac_um": "transmission error, rms of the alternating part, µm",
    "contact_loss_percent": "teeth apart, % of the samples, whole run",
    "coast_contact_percent": "coast flanks carry, % of the samples, whole run",
    "impacts": "impacts, whole run",
    "lock_time_s": "clutch locked from, s",
}


def _results(trace: Trace) -> str:
    window = window_of_interest(trace)
    rows = [(_result_name(key, meshes(trace)), f"{value:.4g}") for key, value in key_results(trace).items()]
    where = f"From {window.start:.4g} s to {window.end:.4g} s, {window.reason}, unless it says otherwise. "
    where += (
        "Alternating: without the mean."
        if window.reason == SETTLED
        else "Alternating: without a moving average of 10 ms."
    )
    return (
        page.table(("", "value"), rows) + page.note(where)
        if rows
        else page.note("The trace holds no mesh or bearing channel.")
    )


def _result_name(key: str, names: Sequence[str]) -> str:
    """A result of key_results in words. names: of the meshes; of several the name stands first."""
    mesh = next((name for name in names if len(names) > 1 and key.startswith(f"{name}_")), "")
    plain = key.removeprefix(f"{mesh}_") if mesh else key
    if plain in NAMES:
        return f"{mesh}: {NAMES[plain]}" if mesh else NAMES[plain]
    bearing = key.removeprefix("bearing_").removesuffix("_rms_ac_N")
    return f"bearing {bearing}, rms of the alternating part, both directions, N"


def _octaves(trace: Trace) -> str:
    try:
        levels = plots_nvh.octave_table(trace, window_of_interest(trace))
    except MetricsError:
        return ""
    bands = list(dict.fromkeys(band for row in levels.values() for band in row))
    if not bands:
        return ""
    rows = [(name, *(f"{row[band]:.1f}" for band in bands)) for name, row in levels.items()]
    return page.note("Level in dB re 1 N (rms) over the window of the results.") + page.table(
        ("Hz", *(f"{band:g}" for band in bands)), rows
    )


def _accuracy(summary: Mapping[str, Any], spec: Any, bodies: Sequence[Any] | None) -> list[str]:
    rows = {
        "Coupling error (Richardson, relative)": _text(summary, "coupling_error"),
        "Energy residual (relative)": _text(summary, "energy_residual"),
        "CPU time per simulated second, stage alone": _text(summary, "stage_realtime_factor"),
        "CPU time per simulated second, whole run": _text(summary, "realtime_factor"),
    }
    parts = [
        page.pairs_table(
            {name: "not measured in this run" if text == "not given" else text for name, text in rows.items()}
        )
    ]
    made_with = fingerprint(body.input_hash for body in bodies or ())
    prices = [row for row in read_levels(levels_path(spec)) if row["bodies"] == made_with] if spec is not None else []
    if prices:
        parts += [
            "<h3>What the fidelity levels of this stage cost and how far they are off</h3>",
            page.table(HEADER, shown_rows(prices, str(summary.get("level")))),
            page.note(PRICES),
        ]
    else:
        parts.append(
            page.note(
                "The error of the fidelity levels of this stage with these bodies has not been measured "
                "(benchmarks/levels.py does it)."
            )
        )
    return parts + [page.note(_frf_words(body)) for body in bodies or () if hasattr(body, "frf")]


PRICES = (
    "Errors of the alternating part against level full at a fifth of its step, after settling, each level at its "
    "default step; "
    "CPU time of the stage as measured when the list was made."
)


def _frf_words(body: Any) -> str:
    frf = body.frf
    return (
        f"Body {body.name}: frequency response of the modes below {frf.cut / 1e3:g} kHz with their static "
        "residual against the finite elements: "
        f"largest relative error {frf.max_error:.1e} from {frf.band[0]:g} to {frf.band[1]:g} Hz, to be trusted up "
        f"to {frf.trusted_to / 1e3:.3g} kHz."
    )


def _provenance(summary: Mapping[str, Any]) -> dict[str, str]:
    shown = {
        "scene",
        "stage",
        "outcome",
        "level",
        "n_dyn",
        "slices",
        "h",
        "H",
        "simulated_s",
        "cpu_s",
        "realtime_factor",
    }
    flat: dict[str, str] = {}
    for key, value in summary.items():
        if isinstance(value, Mapping) and key not in shown:
            flat |= {f"{key}.{inner}": str(item) for inner, item in value.items()}
        elif key not in shown:
            flat[key] = str(value)
    return flat


def _channels(trace: Trace) -> str:
    rows = [(f"{name} – {c.description}" if c.description else name, c.unit) for name, c in trace.channels.items()]
    return "<h3>Channels in trace.h5</h3>" + page.table(("name", "unit"), rows)
