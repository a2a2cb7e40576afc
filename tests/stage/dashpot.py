"""The path that a contact's dashpot is parallel to (docs/theory.md, 2.5), read from the kernel, and what a damping
constant is worth on it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gearfmu.body import Body
from gearfmu.kernel.linear import LinearModel
from gearfmu.stage.assembly.assemble import assemble
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape

POSITIONS = 16  # of one pitch


def own_path(model: StageModel, torque: float) -> float:
    """Path of a contact's dashpot through both teeth and the local law, m/N: with it and the whole face width a tooth
    pair loses what its slices lose. Mean over the tooth pairs in contact at positions of one pitch, `torque` (N·m) on
    the pinion. SimulationError(no_equilibrium) where the pair finds none."""
    kernel = model.kernel(level=0.0, contact_damping=1.0)
    kernel.prepare()
    pitch, paths = 2 * math.pi / mesh_shape(model.stage, model.stage.engagements[0]).gears[1].z, []
    for part in np.arange(POSITIONS) / POSITIONS:
        kernel.transmission(-part * pitch, torque)
        paths += _paths(kernel.linearise())
    return float(np.mean(paths))


def _paths(linear: LinearModel) -> list[float]:
    """Of every tooth pair: root of the mean square, across the width, of what 1 N on it closes along the paths."""
    contact, found = linear.label[:, 0] >= 0, []
    for key in np.unique(linear.label[contact, :3], axis=0):
        own = np.flatnonzero((linear.label[:, :3] == key).all(axis=1))
        load = linear.force[own] / linear.force[own].sum()
        closes = linear.own[np.ix_(own, own)] @ load
        found.append(math.sqrt(linear.dashpot[own] @ closes**2 / linear.dashpot[own].sum()))
    return found


def same_loss(spec: Stage, bodies: Sequence[Body], others: Sequence[Body]) -> float:
    """Contact damping (N·s/m²) with which `others`, reductions of the same gears, lose what `bodies` lose with that of
    `spec`: the more modes are stored, the shorter is the path, and the loss goes with c times its square. Taken at half
    of the largest load."""
    own, other = (own_path(assemble(spec, some), 0.5 * spec.written.torque_max) for some in (bodies, others))
    return float(spec.written.contact.damping * (own / other) ** 2)
