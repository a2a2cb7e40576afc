"""One run as the parts of its report see it: trace, summary, stage and bodies where they are at hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gearfmu.body import Body
from gearfmu.report.mesh_cycle import static_loads
from gearfmu.report.metrics import MetricsError
from gearfmu.report.planets import shares
from gearfmu.report.results import dynamic_factors, key_results
from gearfmu.report.runup import RunUp, resonances, run_up_of_meshes, run_up_of_set
from gearfmu.report.signals import (
    PlanetSet,
    Window,
    known_meshings,
    mesh_angles,
    meshes,
    planet_set,
    window_of_interest,
)
from gearfmu.stage.run.deformation import Deformation
from gearfmu.stage.run.flank_loads import FlankLoads
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.turning import Meshing


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
    def window(self) -> Window:
        """The part that results and spectra are taken from."""
        return window_of_interest(self.trace)

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
        return known_meshings(self.trace, self.spec)

    @cached_property
    def planets(self) -> PlanetSet | None:
        """The planetary set, None for other stages."""
        return planet_set(self.trace, self.known)

    @cached_property
    def mean_shares(self) -> dict[str, float]:
        """Share of every planet in the force of its central gear by engagement, mean over the window; empty for other
        stages and for samples that are not even."""
        try:
            return {} if self.planets is None else shares(self.trace, self.planets, self.window)[1]
        except MetricsError:
            return {}

    @cached_property
    def angles(self) -> dict[str, np.ndarray]:
        """Mesh angle (n,) rad by engagement."""
        return mesh_angles(self.trace, self.spec)

    @cached_property
    def stage(self) -> Stage | None:
        """The stage in general terms, where it and its bodies are at hand."""
        return self.spec if self.bodies else None

    @cached_property
    def shown_meshes(self) -> list[str]:
        """Engagements with statics in the report: all, of a set the first of every central gear."""
        forces = [mesh for mesh in meshes(self.trace) if f"{mesh}.force" in self.trace]
        if self.planets is None:
            return forces
        return [next(iter(own.values())) for own in self.planets.meshes.values()]

    @cached_property
    def statics(self) -> tuple[dict[str, FlankLoads], list[str]]:
        """Statics under the run's mean load by engagement, and why some are missing; empty without stage and bodies."""
        if self.stage is None:
            return {}, []
        return static_loads(self.trace, self.window, self.shown_meshes, self.stage, self.bodies or ())

    @property
    def loads(self) -> dict[str, FlankLoads]:
        """Statics under the run's mean load by engagement."""
        return self.statics[0]

    @cached_property
    def run_up(self) -> RunUp | None:
        """The run-up within the window, that of a pair or train with its resonances where the stage is at hand; None
        where no shaft gathers speed (or loses it) steadily."""
        if self.planets is not None:
            return run_up_of_set(self.trace, self.planets, self.window)
        found = run_up_of_meshes(self.trace, self.known, self.window) if self.known else None
        first = next(iter(self.known), "")
        if found is None or self.stage is None or f"{first}.force" not in found.signals:
            return found
        return replace(found, resonances=resonances(found, first, self.stage, self.bodies or ()))

    @property
    def title(self) -> str:
        """Name of scene or run."""
        return str(self.summary.get("scene") or self.trace.meta.get("scene") or "simulation")

    @property
    def stage_name(self) -> str:
        """Name of the stage."""
        return str(self.summary.get("stage") or self.trace.meta.get("stage") or "stage not named")
