"""Efficiency of the meshes of a stage: what a run loses to friction of the flanks, beside the closed forms.

P_V = P µ_mz H_V with the tooth loss factor of Ohlendorf, as Niemann and Winter and ISO/TR 14179-2 give it. Losses of
bearings, seals and churned oil are in neither number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.geometry.mesh import RingMesh
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.simulate import Steady, simulate
from gearfmu.stagefile.forms.shapes import MeshShape, mesh_shape
from gearfmu.stagefile.forms.turning import meshings, turns

STEP = 2e-5  # s


@dataclass(frozen=True)
class MeshLoss:
    """Of one engagement in a run at constant load. power: that rolls through it, in the axes that carry its gears, W;
    lost: mean friction power of the run over whole pitches, W; coefficient: mean coefficient of friction of the loaded
    contacts; loss_factor: H_V."""

    power: float
    lost: float
    coefficient: float
    loss_factor: float

    @property
    def closed(self) -> float:
        """P_V = P µ H_V with the run's mean coefficient, W (ISO/TR 14179-2)."""
        return self.power * self.coefficient * self.loss_factor

    @property
    def columns(self) -> dict[str, float]:
        """Names with units → values."""
        return {
            "rolling power (W)": self.power,
            "mesh loss of the run (W)": self.lost,
            "mean coefficient of friction": self.coefficient,
            "tooth loss factor H_V": self.loss_factor,
            "mesh loss P mu H_V (W)": self.closed,
        }


@dataclass(frozen=True)
class Efficiency:
    """Of one run at constant load. power: of the input, W; meshes: loss of every engagement by name; retried_steps:
    steps left unsolved."""

    power: float
    meshes: dict[str, MeshLoss]
    retried_steps: int

    @property
    def lost(self) -> float:
        """Of all meshes by the run, W."""
        return sum(mesh.lost for mesh in self.meshes.values())

    @property
    def closed(self) -> float:
        """Of all meshes by P µ H_V, W."""
        return sum(mesh.closed for mesh in self.meshes.values())

    @property
    def efficiency(self) -> float:
        """Of the meshes by the run: 1 − P_V/P."""
        return 1.0 - self.lost / self.power

    def columns(self) -> dict[str, Any]:
        """Names with units → values; of several meshes each by name."""
        return {
            "power (W)": self.power,
            **{name: mesh.columns for name, mesh in self.meshes.items()},
            "mesh loss of the run (W)": self.lost,
            "mesh efficiency of the run": self.efficiency,
            "mesh loss P mu H_V (W)": self.closed,
            "mesh efficiency by H_V": 1.0 - self.closed / self.power,
            "unsolved steps": float(self.retried_steps),
        }


def loss_factor(mesh: MeshShape) -> float:
    """H_V = π (u + 1)/(z₁ u cos β_b) · (1 − ε_α + ε₁² + ε₂²), u = z₂/z₁, negative in a ring: tooth loss factor of
    teeth that share the load evenly (Ohlendorf 1958; Niemann, Winter, Maschinenelemente II; ISO/TR 14179-2). ε₁, ε₂:
    contact ratios of recess and approach."""
    path, p = mesh.path, mesh.base_pitch
    recess, approach = (path["E"] - path["C"]) / p, (path["C"] - path["A"]) / p
    z_1, z_2 = (gear.z for gear in mesh.gears)
    u = -z_2 / z_1 if isinstance(mesh, RingMesh) else z_2 / z_1
    shape = 1.0 - (recess + approach) + recess**2 + approach**2
    return math.pi * (u + 1.0) / (z_1 * u * math.cos(mesh.gears[0].beta_b)) * shape


def mesh_efficiency(
    model: StageModel,
    torque: float,
    speed: float,
    parameters: Mapping[str, float] | None = None,
    settles: float = 0.01,
    pitches: int = 8,
) -> Efficiency:
    """Efficiency of the meshes of a stage that turns at `speed` (rad/s) of its input under `torque` (N·m).

    settles: time that is left out, s; pitches: whole ones of the slowest mesh that follow it. Torque ports are driven
    through springs (`StageModel.driven_by_springs`). Raises ModelError for bodies that do not know friction.
    """
    driven, stage = model.driven_by_springs(), model.stage
    turning = turns(stage, model.shafts.input)
    known = {name: (m, abs(float(m.relative(turning)) * speed)) for name, m in meshings(stage).items()}
    span = pitches * 2 * math.pi / min(meshing.teeth * rolls for meshing, rolls in known.values())
    count = math.ceil((settles + span) / STEP) + 1
    settings = {"effect.friction": 1.0, **(parameters or {})}
    trace = simulate(driven, Steady(driven, speed, torque), count * STEP, STEP, settings)
    settled = trace.time >= settles
    meshes = {}
    for mesh in stage.engagements:
        first, last = np.interp([settles, settles + span], trace.time, trace[f"{mesh.name}.friction_loss"])
        shape, (_, rolls) = mesh_shape(stage, mesh), known[mesh.name]
        force = abs(torque / place_of(model, mesh.name).lever)
        coefficient = float(trace[f"{mesh.name}.friction_ratio"][settled].mean())
        lost = float(last - first) / span
        meshes[mesh.name] = MeshLoss(force * shape.gears[0].r_b * rolls, lost, coefficient, loss_factor(shape))
    return Efficiency(abs(torque * speed), meshes, int(trace["solver.retried_steps"][-1]))
