"""Quasi-static forces of every tooth pair and slice of an engagement over one pitch: where on the flank they act."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gearfmu.kernel import Kernel
from gearfmu.stage.assembly.meshes import direction_of, mesh_axes, tooth_phases
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.limits import limit_named, place_of
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.shapes import face_width, mesh_shape

SIDES = (1, -1)  # of the kernel's flanks 0 (drive) and 1 (coast)


@dataclass(frozen=True)
class FlankLoads:
    """position (P,) in pitches by which gear A would have turned on without load,
    from the angle of gear B · te (P,) m, as the output M.te · face_width (m), common · width (S,) m: middles of the
    slices from mid-width · side: +1 drive flanks, −1 coast flanks · roll (K, S) m on gear A and force (K, S) N of every
    loaded tooth pair at every position, K in all · at (K,): number of its position."""

    position: np.ndarray
    te: np.ndarray
    face_width: float
    width: np.ndarray
    side: int
    roll: np.ndarray
    force: np.ndarray
    at: np.ndarray

    def line_load(self, roll: np.ndarray) -> np.ndarray:
        """(R, S) N/m: force per width on the flank of gear A at these rolls (m), linear between positions; 0 where no
        pair was loaded."""
        found = np.zeros((roll.size, self.width.size))
        for s in range(self.width.size):
            order = np.argsort(self.roll[:, s])
            found[:, s] = np.interp(roll, self.roll[order, s], self.force[order, s], left=0.0, right=0.0)
        return found * self.width.size / self.face_width


def flank_loads(
    model: StageModel, torque: float, mesh: str, positions: int = 24, kernel: Kernel | None = None
) -> FlankLoads:
    """Statics of `loaded_te` under `torque` (N·m on the input), with the forces that its sums are made of. positions:
    over one pitch, end point left out. kernel: of `statics_of`, one for several meshes; a new one when None.
    SimulationError where there is no equilibrium."""
    kernel, place = kernel or statics_of(model), place_of(model, mesh)
    stage = model.stage
    engagement = stage.engagements[place.number]
    pair = mesh_shape(stage, engagement)
    gear = pair.gears[0]
    frame = tooth_phases(stage)[engagement.gears[0]] - direction_of(pair, *mesh_axes(stage, engagement))
    te, rolls, forces, at, sums = np.empty(positions), [], [], [], np.zeros(2)
    behind = np.zeros(positions)
    slices, face = int(kernel.get("slices")), face_width(model.stage, engagement)
    width = ((np.arange(slices) + 0.5) / slices - 0.5) * face
    for i, part in enumerate(np.arange(positions) / positions):
        with limit_named(model, torque):
            state = kernel.transmission(-part * place.pitch, torque, place.number, keep=i > 0)
        te[i] = state.output_te
        if stage.rotor_of(engagement.gears[0]) == stage.rotor_of(stage.ports[model.shafts.input].body):
            behind[i] = (state.phi - state.te / gear.r_b) * gear.z / (2 * math.pi) - part
        for (flank, tooth), force in state.forces.items():
            if not any(force):
                continue
            sg, turned = SIDES[flank], 2 * math.pi * (part + behind[i] + tooth) / gear.z
            middle = gear.r_b * math.remainder(sg * (turned + frame) + gear.psi_b + pair.alpha_wt, 2 * math.pi)
            rolls.append(middle + sg * width * math.tan(gear.beta_b))
            forces.append(force)
            at.append(i)
            sums[flank] += sum(force)
    side = SIDES[int(np.argmax(sums))]
    return FlankLoads(
        np.arange(positions) / positions + round(float(behind.mean()), 9),
        te,
        face,
        width,
        side,
        np.array(rolls),
        np.array(forces),
        np.array(at),
    )
