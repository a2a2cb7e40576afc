"""Light-load rattle of a pair between springs: the pinion's shaft end swings while it turns, the teeth part for a good
part of the time, or hit the coast flanks too. Statistics of such a run, which repeat where the motion itself is
chaotic."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gearfmu.stage import StageModel, Steady, Trace, simulate
from gearfmu.stage.run.simulate import Wound

STEP = 60e-6  # s, communication step
SETTLE = 0.05  # s
# of what a step may change: the share of the time as a difference, others relative
LIMITS = {"open_share": 0.01, "force_rms": 0.015, "te_std": 0.005, "impulse": 0.005}


@dataclass(frozen=True)
class LightRattle:
    """torque: mean, N·m; swing: amplitude of the pinion's shaft end, rad; speed of the pinion, rad/s; its
    frequency (Hz) and phase (rad)."""

    torque: float
    swing: float
    speed: float = 2000 * math.pi / 30
    frequency: float = 127.0
    phase: float = math.pi / 2 + 0.3

    def inputs(self, model: StageModel) -> Wound:
        """Steady drive plus the swing, with speed and acceleration."""
        return _Swinging(Steady(model, self.speed, self.torque), self)


SCENES = {"one flank": LightRattle(8.0, 2.75e-3), "both flanks": LightRattle(9.0, 4e-3)}


@dataclass(frozen=True)
class _Swinging(Wound):
    steady: Steady
    swing: LightRattle

    def under(self, parameters: Mapping[str, float]) -> _Swinging:
        return replace(self, steady=self.steady.under(parameters))

    def over(self, times: np.ndarray) -> dict[str, np.ndarray]:
        values, s = self.steady.over(times), self.swing
        pinion, omega = self.steady.model.stage.gears[0].name, 2 * math.pi * s.frequency
        angle = (omega * times + s.phase).tolist()
        sine, cosine = (np.array(list(map(f, angle))) for f in (math.sin, math.cos))
        values[f"{pinion}.phi"] = values[f"{pinion}.phi"] + s.swing * sine
        values[f"{pinion}.w"] = values[f"{pinion}.w"] + s.swing * omega * cosine
        values[f"{pinion}.a"] = -s.swing * omega**2 * sine
        return values


def run(model: StageModel, scene: LightRattle, duration: float, parameters: Mapping[str, float]) -> Trace:
    """The scene for SETTLE + duration (s)."""
    return simulate(model, scene.inputs(model), SETTLE + duration, STEP, parameters)


def statistics(trace: Trace) -> dict[str, float]:
    """After settling: open_share of the time, rms of the mesh force (means over STEP, N), std of the transmission error
    (m), impulse a second (mean of the force's magnitude, N)."""
    settled = trace.time > SETTLE
    seconds = trace.time[-1] - SETTLE
    force, before = trace["mesh.force_mean"][settled], np.flatnonzero(~settled)[-1]
    return {
        "open_share": float(trace["mesh.open_time"][-1] - trace["mesh.open_time"][before]) / seconds,
        "force_rms": float(np.sqrt(np.mean(force**2))),
        "te_std": float(np.std(trace["mesh.te"][settled])),
        "impulse": float(np.mean(np.abs(force))),
    }


def missed(found: dict[str, float], wanted: dict[str, float]) -> list[str]:
    """Names of the statistics that are not within LIMITS."""
    scale = wanted | {"open_share": 1.0}
    return [name for name, most in LIMITS.items() if abs(found[name] - wanted[name]) > most * scale[name]]
