"""The parts of a report in words and numbers: key results, tables, accuracy, where it comes from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from gearfmu.report import heading, page, plots_nvh
from gearfmu.report.levels import HEADER, fingerprint, levels_path, read_levels, shown_rows
from gearfmu.report.metrics import MetricsError
from gearfmu.report.names import mesh_words, plain
from gearfmu.report.plots import RPM, pin_force
from gearfmu.report.results import dynamic_factors, energy_balance
from gearfmu.report.run import Run
from gearfmu.report.signals import SETTLED, bearings, meshes, noise_floor, recorded
from gearfmu.stage import assemble
from gearfmu.stage.run.refinement import left_of_slices
from gearfmu.stage.run.trace import Trace

if TYPE_CHECKING:
    from gearfmu.reduction.cyclic.frf import FrfError

WORDS = {  # key of a result: words, channel of the mesh, unit
    "mesh_force_mean_N": ("Mesh force, mean", "force", "N"),
    "mesh_force_rms_ac_N": ("Mesh force, rms of the alternating part", "force", "N"),
    "te_mean_um": ("Transmission error, mean", "te", "µm"),
    "te_rms_ac_um": ("Transmission error, rms of the alternating part", "te", "µm"),
    "dynamic_factor": ("Dynamic factor", "force", ""),
    "contact_loss_percent": ("Teeth apart, share of the samples of the whole run", "contact", "%"),
    "coast_contact_percent": ("Coast flanks carry, share of the samples of the whole run", "contact", "%"),
    "impacts": ("Impacts, whole run", "impacts", ""),
}
OPERATION = {  # words: key of the summary, scale, unit
    "torque of the input": ("torque", 1.0, "N·m"),
    "speed of the input": ("speed", RPM, "rpm"),
    "speed at the end": ("end_speed", RPM, "rpm"),
}
FACTS = {
    "fidelity level": ("level", 1.0, ""),
    "dynamic modes, all gears": ("n_dyn", 1.0, ""),
    "slices": ("slices", 1.0, ""),
    "internal step": ("h", 1e6, "µs"),
    "communication step": ("H", 1e6, "µs"),
    "simulated": ("simulated_s", 1.0, "s"),
    "CPU time": ("cpu_s", 1.0, "s"),
    "CPU time per simulated second": ("realtime_factor", 1.0, ""),
}
NOT_GIVEN = "not given"
FACTOR_WORDS = (
    "Dynamic factor: largest mesh force over the static one, in the sense of K_v of ISO 6336-1 (there by rating "
    "methods, here of the simulation). "
)


def tiles(run: Run) -> list[tuple[str, str, str]]:
    """The key results: value, unit, description; of several meshes the largest, with its name."""
    results, names, found = run.results, meshes(run.trace), []
    for key, scale, unit, words in (
        ("mesh_force_mean_N", 1e-3, "kN", "mean mesh force"),
        ("dynamic_factor", 1.0, "", "dynamic factor: largest mesh force over the static one"),
        ("te_rms_ac_um", 1.0, "µm rms", "alternating transmission error"),
        ("contact_loss_percent", 1.0, "%", "of the samples with teeth apart"),
    ):
        keys = {mesh: f"{mesh}_{key}" if len(names) > 1 else key for mesh in names}
        known = {mesh: results[own] for mesh, own in keys.items() if own in results}
        if known:
            mesh = max(known, key=lambda name: abs(known[name]))
            where = f", {mesh_words(mesh)} (the largest)" if len(known) > 1 and known[mesh] else ""
            found.append((f"{abs(known[mesh]) * scale:.3g}", unit, f"{words}{where}"))
    if means := run.mean_shares:
        mesh = max(means, key=lambda name: means[name])
        found.append((f"{means[mesh]:.3f}", "", f"largest share of a planet, {mesh_words(mesh)} (1: all alike)"))
    loud = {name: results.get(f"bearing_{name}_rms_ac_N", -1.0) for name in bearings(run.trace)}
    name = max(loud, key=lambda bearing: loud[bearing], default="")
    if loud.get(name, -1.0) >= noise_floor(run.trace):
        found.append((f"{loud[name]:.3g}", "N rms", f"alternating bearing force, {name}"))
    if "lock_time_s" in results:
        found.append((f"{results['lock_time_s']:.4g}", "s", "clutch locked from here on"))
    return found


def results(run: Run) -> str:
    """The table of key results."""
    names = meshes(run.trace)
    floor = noise_floor(run.trace)
    noise = {key for key, value in run.results.items() if key.endswith("rms_ac_N") and value < floor}
    rows = []
    for key, value in run.results.items():
        words, channel, unit = result_words(key, names)
        breaking = escape(channel).replace(".", ".<wbr>")  # behind its dots, not within its words
        code = page.Ready(f'<code class="channel">{breaking}</code>')
        rows.append((words, code, f"{0.0 if key in noise else value:.4g}", unit))
    if not rows:
        return page.note("The trace holds no mesh or bearing channel.")
    window = run.window
    where = f"From {window.start:.4g} s to {window.end:.4g} s, {window.reason}, unless it says otherwise. "
    steady = window.reason == SETTLED
    where += "Alternating: without the mean. " if steady else "Alternating: without a moving average of 10 ms. "
    where += FACTOR_WORDS + (
        "Static: the mean." if steady else "Static: the moving average of 10 ms, where it is a tenth of its largest."
    )
    where += f" Forces below {floor:.2g} N, 1e-4 of the largest mesh force, are shown as 0." if noise else ""
    return page.table(("", "channel", "value", "unit"), rows, (0, 1, 3)) + page.note(where)


def result_words(key: str, names: Sequence[str]) -> tuple[str, str, str]:
    """A result of key_results: words, its channel, its unit. names: of the meshes; of several with the name."""
    mesh = next((name for name in names if len(names) > 1 and key.startswith(f"{name}_")), "")
    inner = key.removeprefix(f"{mesh}_") if mesh else key
    if inner in WORDS:
        words, channel, unit = WORDS[inner]
        return f"{words}, {mesh_words(mesh)}" if mesh else words, f"{mesh or names[0]}.{channel}", unit
    if inner == "lock_time_s":
        return "Clutch locked from", "*.locked", "s"
    bearing = inner.removeprefix("bearing_").removesuffix("_rms_ac_N")
    words = f"Bearing force of {bearing}, rms of the alternating part, both directions"
    return words, f"bearing.{bearing}.fx, fy", "N"


def planets(run: Run) -> list[str]:
    """Key numbers of a set, and the table of its planets: mean, alternating part and share of every mesh force,
    transmission error, pin force; over the window."""
    if run.planets is None or not run.mean_shares:
        return []
    part, window, rows = run.part, run.window, []
    for planet, mesh in (pair for own in run.planets.meshes.values() for pair in own.items()):
        force = part[recorded(part, f"{mesh}.force")]
        te = part[f"{mesh}.te"] * 1e6 if f"{mesh}.te" in part else np.array([np.nan])
        pin = pin_force(part, planet)
        held = np.nan if pin is None else np.mean(pin)
        numbers = (np.mean(force), np.std(force), run.mean_shares[mesh], np.mean(te), np.std(te), held)
        rows.append((mesh_words(mesh), *("–" if np.isnan(number) else f"{number:.4g}" for number in numbers)))
    head = ("mesh", "force, N", "alternating, N rms", "share", "TE, µm", "TE alternating, µm rms", "pin force, N")
    where = (
        f"From {window.start:.4g} s to {window.end:.4g} s, {window.reason}. Share: 1 where all planets carry alike. "
    )
    where += FACTOR_WORDS if any(math.isfinite(v) for v in dynamic_factors(run.trace).values()) else ""
    key_numbers = page.table(("", ""), heading.of_set(run), (0, 1))
    return [
        page.section("Key numbers", key_numbers, name="results"),
        page.section("Planets", page.table(head, rows), page.note(where)),
    ]


def warned(trace: Trace) -> list[str]:
    """Influence of the sampling on spectra, as a warning."""
    try:
        warning = plots_nvh.sampling_warning(trace)
    except MetricsError:
        return []
    return [page.warning(warning)] if warning else []


def octaves(run: Run) -> str:
    """Table of octave-band levels; "" without any, and of a run-up, whose levels change with its speed."""
    if run.run_up is not None:
        return ""
    try:
        levels = plots_nvh.octave_table(run)
    except MetricsError:
        return ""
    bands = list(dict.fromkeys(band for row in levels.values() for band in row))
    if not bands:
        return ""
    rows = [(plain(name) or name, *(f"{row[band]:.1f}" for band in bands)) for name, row in levels.items()]
    return page.note("Level in dB re 1 N (rms) over the window of the results.") + page.table(
        ("Hz", *(f"{band:g}" for band in bands)), rows
    )


def facts(summary: Mapping[str, object]) -> dict[str, str]:
    """How it was run."""
    shown = {words: own for words, own in OPERATION.items() if summary.get(own[0]) is not None} | FACTS
    return {words: _text(summary, *own) for words, own in shown.items()}


def _text(summary: Mapping[str, Any], key: str, scale: float = 1, unit: str = "") -> str:
    value = summary.get(key)
    if value is None:
        return NOT_GIVEN
    if isinstance(value, (bool, str)):
        return str(value)
    return f"{value * scale:.4g} {unit}".strip()


def _left_of_slices(run: Run) -> str:
    """Error by the number of slices of a helical pair; "" for other stages, where that takes minutes, and
    without torque or bodies."""
    torque = run.summary.get("torque")
    if not run.spec or not run.bodies or len(run.spec.engagements) != 1:
        return ""
    if not isinstance(torque, (int, float)) or not torque:
        return ""
    left = left_of_slices(assemble(run.spec, run.bodies), [torque], slices=int(run.summary.get("slices") or 0))
    return left.text if left else ""


def accuracy(run: Run) -> list[str]:
    """Errors and cost of the run, and of the fidelity levels of its stage where they were measured."""
    summary, spec, bodies = run.summary, run.spec, run.bodies
    of = f" of {summary['coupling_error_of']}" if summary.get("coupling_error_of") else ""
    left = energy_balance(run.trace)
    rows = {
        f"Coupling error{of} (Richardson), of the rms of the alternating part": _text(summary, "coupling_error"),
        "Energy residual of the stage, of the work through its ports": _text(left, "energy_residual_of_port_work"),
        "CPU time per simulated second, stage alone": _text(summary, "stage_realtime_factor"),
        "CPU time per simulated second, whole run": _text(summary, "realtime_factor"),
    }
    if summary.get("exchanged_work_J"):
        lost = _text(summary, "energy_residual")
        rows["Work lost between the stage and its shafts, of the work exchanged"] = lost
    if change := _left_of_slices(run):
        rows["Static transmission error, twice the slices"] = change
    told = {name: "not measured in this run" if text == NOT_GIVEN else text for name, text in rows.items()}
    made_with = fingerprint(body.how.hash for body in bodies or ())
    prices = [row for row in read_levels(levels_path(spec)) if row["bodies"] == made_with] if spec is not None else []
    if prices:
        of_levels = [
            "<h3>Price and error of the fidelity levels of this stage</h3>",
            page.table(HEADER, shown_rows(prices, str(summary.get("level")))),
            page.note(
                "Errors of the alternating part against level full at a fifth of its step, after settling, each level "
                "at its default step; CPU time of the stage as measured when the list was made."
            ),
        ]
    else:
        missing = "The error of the fidelity levels of this stage with these bodies has not been measured "
        of_levels = [page.note(f"{missing}(evidence/study/levels.py does it).")]
    errors = [_frf_words(body.name, body.error) for body in bodies or () if body.error is not None and body.error.cut]
    return [page.pairs_table(told), *of_levels, *map(page.note, errors)]


def _frf_words(name: str, frf: FrfError) -> str:
    return (
        f"Body {name}: frequency response of the modes below {(frf.cut or 0) / 1e3:g} kHz with their static "
        "residual against the finite elements: "
        f"largest error {frf.max_error:.1e} of the response from {frf.band[0]:g} to {frf.band[1]:g} Hz, to be "
        f"trusted up to {frf.trusted_to / 1e3:.3g} kHz."
    )


def provenance(summary: Mapping[str, object]) -> dict[str, str]:
    """The rest of the summary."""
    shown = {"scene", "stage", "outcome", "coupling_error", "coupling_error_of", "energy_residual"}
    shown |= {key for key, _, _ in FACTS.values()}
    flat: dict[str, object] = {}
    for key, value in summary.items():
        if key not in shown:
            flat |= (
                {f"{key}.{name}": own for name, own in value.items()} if isinstance(value, Mapping) else {key: value}
            )
    return {name: str(value) for name, value in flat.items()}


def channels(trace: Trace) -> str:
    """The channels of the trace: plain name, name, unit, description."""
    rows = [
        (plain(name), page.Ready(f"<code>{escape(name)}</code>"), own.unit, own.description)
        for name, own in trace.channels.items()
    ]
    return "<h3>Channels in trace.h5</h3>" + page.table(("", "name", "unit", "meaning"), rows, range(4))
