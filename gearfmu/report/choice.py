"""Choice of a run's figures: a pair or train mesh by mesh, a set planet by planet, a run-up by its orders."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np

from gearfmu.modes.deformed import DeformedGear, deformed_gear
from gearfmu.report import deformation as drawn
from gearfmu.report import housing, mesh_cycle, planets, plots, plots_nvh, plots_runup
from gearfmu.report.chart import Plot
from gearfmu.report.kinds import FORCES, force_channels
from gearfmu.report.metrics import MetricsError
from gearfmu.report.moving import View, moving_view
from gearfmu.report.run import Run
from gearfmu.report.signals import meshes
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stage.assembly.observed import gear_bodies
from gearfmu.stage.run.deformation import DeformationError

Maker: TypeAlias = Callable[[], "Plot | None"]


def chosen_plots(run: Run) -> tuple[dict[str, list[Plot]], list[str]]:
    """Every figure the run allows, by chapter ("time", "speed", "frequency", "housing"), and in words why others are
    not there."""
    gears, gaps = deformed_gears(run)
    made: dict[str, list[Plot]] = {}
    missing = []
    makers = {"time": _over_time(run, gears), **_over_speed_or_frequency(run), "housing": housing.figures(run)}
    for chapter, own in makers.items():
        made[chapter] = []
        for maker in own:
            try:
                if (plot := maker()) is not None and not plot.empty:
                    made[chapter].append(plot)
            except MetricsError as error:
                missing.append(str(error))
    if not run.angles and run.planets is None:
        missing.append("No mesh orders: the trace has no gear speed or no tooth numbers.")
    return made, [*gaps, *run.statics[1], *dict.fromkeys(missing)]


def deformed_gears(run: Run) -> tuple[list[DeformedGear], list[str]]:
    """The gears whose recorded deformation can be drawn, and in words why others cannot."""
    if run.deformation is None:
        return [], []
    if run.stage is None:
        return [], ["Deformed gears: the stage's bodies are not at hand."]
    known, found, missing = gear_bodies(run.stage, run.bodies or ()), [], []
    phases = tooth_phases(run.stage)
    for name, motion in run.deformation.gears.items():
        try:
            found.append(deformed_gear(name, known[name], motion, phases[name]))
        except (DeformationError, KeyError) as error:
            missing.append(f"Deformed gears: {error}")
    return found, missing


def turning(run: Run) -> View | None:
    """The deformed stage over some mesh periods; None where bodies, angles or forces are not at hand."""
    forces = [mesh for mesh in meshes(run.trace) if f"{mesh}.force" in run.trace]
    if run.stage is None or run.trace.time.size < 2 or not forces:
        return None
    times = np.zeros(0) if run.deformation is None else run.deformation.time
    recorded = [(gear, times) for gear in deformed_gears(run)[0]]
    return moving_view(run.trace, run.stage, run.stage.by_name(run.bodies or ()), run.detail(forces[0]), recorded)


def _over_time(run: Run, gears: Sequence[DeformedGear]) -> list[Maker]:
    """Of a pair or train mesh by mesh, of a set its planets side by side. gears: to be drawn deformed."""
    trace, own = run.trace, run.planets
    makers: list[Maker] = [partial(plots.torque_and_slip, trace)]
    makers.append(partial(plots.speeds, trace, own.rotors if own else ()))
    if own is None:
        details = [(mesh, part) for mesh in meshes(trace) for part in (None, run.detail(mesh))]
        makers += [partial(plots.mesh_force_and_error, trace, *detail) for detail in details]
    else:
        makers += [partial(planets.forces, trace, own, part) for part in (None, run.detail(""))]
        makers += [partial(make, run, own) for make in (planets.planets, planets.sharing)]
        makers.append(partial(plots.pin_forces, trace, own.planets))
    makers += [partial(plots.bearing_forces, trace, own is not None), partial(plots.axial_and_tilting, trace)]
    if run.stage is not None:
        kinds = (mesh_cycle.transmission_error, mesh_cycle.contact_pattern)
        makers += [partial(kind, run, mesh) for kind in kinds for mesh in run.shown_meshes]
    if run.deformation is not None:
        views = [partial(view, run, run.deformation) for view in (drawn.pictures, drawn.film)]
        makers += [partial(view, gear) for gear in gears for view in views]
    return makers + ([partial(plots.energy, trace)] if own else [])


def _over_speed_or_frequency(run: Run) -> dict[str, list[Maker]]:
    """Orders over the speed of a run-up instead of spectra; in either case the orders of meshes along the run."""
    cuts: list[Maker] = []
    if run.planets is None:
        cuts = [partial(plots_nvh.order_cuts, run, mesh) for mesh in run.angles]
    if run.run_up is not None:
        return {"speed": [partial(make, run.run_up) for make in plots_runup.FIGURES], "frequency": cuts}
    if run.planets is not None:
        return {"speed": [], "frequency": [partial(plots_nvh.spectra_by_central, run, run.planets)]}
    spectra = partial(plots_nvh.spectra, run, force_channels(run.trace), FORCES)
    return {"speed": [], "frequency": [spectra, *cuts, partial(plots_nvh.force_spectrogram, run)]}
