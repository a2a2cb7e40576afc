"""Efficiency of a pair's mesh: what a run loses to friction of the flanks, beside the closed forms.

P_V = P µ_mz H_V with the tooth loss factor of Ohlendorf, as Niemann and Winter and ISO/TR 14179-2 give it. Losses of
bearings, seals and churned oil are in neither number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gearfmu.errors import ModelError
from gearfmu.geometry import PairGeometry
from gearfmu.stage.model import StageModel
from gearfmu.stage.simulate import Steady, simulate

STEP = 2e-5  # s


@dataclass(frozen=True)
class Efficiency:
    """Of one run at constant load. power: of the input, W; lost: mean friction power of the run over whole pitches, W;
    coefficient: mean coefficient of friction of the loaded contacts; loss_factor: H_V;
    retried_steps: steps left unsolved."""

    power: float
    lost: float
    coefficient: float
    loss_factor: float
    retried_steps: int

    @property
    def closed(self) -> float:
        """P_V = P µ H_V with the run's mean coefficient, W (ISO/TR 14179-2)."""
        return self.power * self.coefficient * self.loss_factor

    @property
    def efficiency(self) -> float:
        """Of the mesh by the run: 1 − P_V/P."""
        return 1.0 - self.lost / self.power

    def columns(self) -> dict[str, float]:
        """Names with units → values."""
        return {
            "power (W)": self.power,
            "mesh loss of the run (W)": self.lost,
            "mesh efficiency of the run": self.efficiency,
            "mean coefficient of friction": self.coefficient,
            "tooth loss factor H_V": self.loss_factor,
            "mesh loss P mu H_V (W)": self.closed,
            "mesh efficiency by H_V": 1.0 - self.closed / self.power,
            "unsolved steps": float(self.retried_steps),
        }


def loss_factor(pair: PairGeometry) -> float:
    """H_V = π (u + 1)/(z₁ u cos β_b) · (1 − ε_α + ε₁² + ε₂²): tooth loss factor of teeth that share the load evenly
    (Ohlendorf 1958; Niemann, Winter, Maschinenelemente II; ISO/TR 14179-2). ε₁, ε₂: contact ratios of recess and
    approach."""
    path, p = pair.path, pair.base_pitch
    recess, approach = (path["E"] - path["C"]) / p, (path["C"] - path["A"]) / p
    z_1, z_2 = (gear.z for gear in pair.gears)
    u = z_2 / z_1
    shape = 1.0 - (recess + approach) + recess**2 + approach**2
    return math.pi * (u + 1.0) / (z_1 * u * math.cos(pair.gears[0].beta_b)) * shape


def mesh_efficiency(
    model: StageModel,
    torque: float,
    speed: float,
    parameters: Mapping[str, float] | None = None,
    settles: float = 0.01,
    pitches: int = 8,
) -> Efficiency:
    """Efficiency of the mesh of a pair that turns at `speed` (rad/s) of its input under `torque` (N·m).

    settles: time that is left out, s; pitches: whole ones that follow it. Raises ModelError for trains and planetary
    sets, whose meshes have outputs of their own (friction_power), and for bodies that do not know friction.
    """
    if model.spec.kind != "external_pair":
        raise ModelError("efficiency knows pairs: of a train or set add up friction_power of its meshes")
    pair = PairGeometry.of(model.spec)
    span = pitches * 2 * math.pi / (pair.gears[0].z * abs(speed))
    count = math.ceil((settles + span) / STEP) + 1
    settings = {"effect.friction": 1.0, **(parameters or {})}
    trace = simulate(model, Steady(model, speed, torque), count * STEP, STEP, settings)
    first, last = np.interp([settles, settles + span], trace.time, trace["mesh.friction_loss"])
    settled = trace.time >= settles
    return Efficiency(
        abs(torque * speed),
        float(last - first) / span,
        float(trace["mesh.friction_ratio"][settled].mean()),
        loss_factor(pair),
        int(trace["solver.retried_steps"][-1]),
    )
