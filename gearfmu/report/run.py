"""One run as the parts of its report see it: trace, summary, stage and bodies where they are at hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gearfmu.body import Body
from gearfmu.errors import ModelError, SimulationError
from gearfmu.report import signals
from gearfmu.report.metrics import MetricsError, sample_step
from gearfmu.report.results import dynamic_factors, key_results
from gearfmu.report.runup import LEAST_LOAD, RunUp, resonances, run_up_of_meshes, run_up_of_set
from gearfmu.stage import assemble
from gearfmu.stage.run.deformation import Deformation
from gearfmu.stage.run.flank_loads import FlankLoads, flank_loads
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import statics_of
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.forms.turning import Meshing

POSITIONS, POSITIONS_OF_SET = 24, 16  # over a pitch: a set solves all its meshes at each
PERIODS, PERIODS_OF_SET = 6, 8  # of a mesh, seen in detail


@dataclass(frozen=True)
class Run:
    """trace; summary: fields of docs/file-formats.md; spec: the stage, bodies: its reduced bodies, deformation: of
    gears at chosen times, each None where it is not at hand."""

    trace: Trace
    summary: Mapping[str, Any]
    spec: Stage | None = None
    bodies: Sequence[Body] | None = None
    deformation: Deformation | None = None

    @cached_property
    def window(self) -> signals.Window:
        """The part that results and spectra are taken from."""
        return signals.window_of_interest(self.trace)

    @cached_property
    def part(self) -> Trace:
        """The trace within the window."""
        return self.trace.window(self.window.start, self.window.end)

    @cached_property
    def results(self) -> dict[str, float]:
        """Key results and dynamic factors."""
        return {**key_results(self.trace), **dynamic_factors(self.trace)}

    @cached_property
    def known(self) -> dict[str, Meshing]:
        """Meshing by engagement."""
        return signals.known_meshings(self.trace, self.spec)

    @cached_property
    def planets(self) -> signals.PlanetSet | None:
        """The planetary set, None for other stages."""
        return signals.planet_set(self.trace, self.known)

    @cached_property
    def shares(self) -> tuple[dict[str, np.ndarray], dict[str, float]]:
        """Share of every engagement in the force of its central gear, 1 where all planets carry alike: over time (n,),
        mean over one mesh period, NaN where that would reach beyond the run; and mean over the window. Empty for other
        stages; MetricsError for samples that are not even."""
        over_time: dict[str, np.ndarray] = {}
        means: dict[str, float] = {}
        if self.planets is None:
            return over_time, means
        trace, window = self.trace, self.window
        period = max(1, round(2 * np.pi / signals.mesh_speed(trace, self.planets) / sample_step(trace.time)))
        inside = (trace.time >= window.start) & (trace.time <= window.end)
        for own in self.planets.meshes.values():
            force = {mesh: np.abs(trace[signals.recorded(trace, f"{mesh}.force")]) for mesh in own.values()}
            smooth = {mesh: signals.running_mean(values, period) for mesh, values in force.items()}
            total = np.maximum(sum(smooth.values()), 1e-9)
            part = {mesh: float(np.mean(values[inside])) for mesh, values in force.items()}
            for mesh, values in smooth.items():
                over_time[mesh] = len(own) * values / total
                means[mesh] = len(own) * part[mesh] / max(sum(part.values()), 1e-9)
        return over_time, means

    @property
    def mean_shares(self) -> dict[str, float]:
        """The means of `shares`; empty for samples that are not even."""
        try:
            return self.shares[1]
        except MetricsError:
            return {}

    @cached_property
    def angles(self) -> dict[str, np.ndarray]:
        """Mesh angle (n,) rad by engagement."""
        return signals.mesh_angles(self.trace, self.spec)

    @cached_property
    def stage(self) -> Stage | None:
        """The stage in general terms, where it and its bodies are at hand."""
        return self.spec if self.bodies else None

    @cached_property
    def shown_meshes(self) -> list[str]:
        """Engagements with statics in the report: all, of a set the first of every central gear."""
        forces = [mesh for mesh in signals.meshes(self.trace) if f"{mesh}.force" in self.trace]
        if self.planets is None:
            return forces
        return [next(iter(own.values())) for own in self.planets.meshes.values()]

    @cached_property
    def statics(self) -> tuple[dict[str, FlankLoads], list[str]]:
        """Statics of engagements under the mean mesh force that each has over the window, and in words why others are
        not there; those with hardly a load are left out. Empty without stage and bodies."""
        found: dict[str, FlankLoads] = {}
        missing: list[str] = []
        kernel = None
        if self.stage is None:
            return found, missing
        model = assemble(self.stage, self.bodies or ())
        slices = float(self.trace.meta.get("slices") or 5)
        positions = POSITIONS if model.stage.frame_of(model.stage.engagements[0]) is None else POSITIONS_OF_SET
        for mesh in self.shown_meshes:
            try:
                place = place_of(model, mesh)
                torque = float(np.mean(self.part[f"{mesh}.force"])) * place.lever
                torque *= math.cos(mesh_shape(model.stage, model.stage.engagements[place.number]).gears[0].beta_b)
                if abs(torque) >= LEAST_LOAD * place.most:
                    kernel = kernel or statics_of(model, slices=slices)
                    found[mesh] = flank_loads(model, torque, mesh, positions, kernel)
            except (SimulationError, ModelError) as error:
                missing.append(f"Mesh cycle and contact pattern of {mesh}: {error}")
        return found, missing

    @property
    def loads(self) -> dict[str, FlankLoads]:
        """Statics under the run's mean load by engagement."""
        return self.statics[0]

    @cached_property
    def run_up(self) -> RunUp | None:
        """The run-up within the window, that of a pair or train with its resonances where the stage is at hand; None
        where no shaft gathers speed (or loses it) steadily."""
        if self.planets is not None:
            return run_up_of_set(self.part, self.planets)
        found = run_up_of_meshes(self.part, self.known) if self.known else None
        first = next(iter(self.known), "")
        if found is None or self.stage is None or f"{first}.force" not in found.signals:
            return found
        return replace(found, resonances=resonances(found, first, self.stage, self.bodies or ()))

    def detail(self, mesh: str) -> tuple[float, float]:
        """A few mesh periods (s): of a set the last ones within the window, else around the largest force of an
        engagement, or a twentieth of the run where its mesh angle is missing."""
        trace, angle = self.trace, self.angles.get(mesh)
        if self.planets is not None:
            width = PERIODS_OF_SET * 2 * np.pi / signals.mesh_speed(trace, self.planets)
            return max(self.window.start, self.window.end - width), self.window.end
        start, end = float(trace.time[0]), float(trace.time[-1])
        force = np.abs(trace[f"{mesh}.force"]) if f"{mesh}.force" in trace else np.zeros(1)
        centre = float(trace.time[int(np.argmax(force))])
        half = 0.025 * (end - start)
        if angle is not None and angle[-1] > 2 * np.pi * PERIODS:
            frequency = np.interp(centre, trace.time, np.gradient(angle, trace.time)) / (2 * np.pi)
            half = min(0.5 * PERIODS / max(frequency, 1e-9), 0.5 * (end - start))
        centre = min(max(centre, start + half), end - half)
        return centre - half, centre + half

    @property
    def title(self) -> str:
        """Name of scene or run."""
        return str(self.summary.get("scene") or self.trace.meta.get("scene") or "simulation")

    @property
    def stage_name(self) -> str:
        """Name of the stage."""
        return str(self.summary.get("stage") or self.trace.meta.get("stage") or "stage not named")
