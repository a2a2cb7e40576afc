"""Friction of the flanks: what a stage file says → starts of the kernel's parameters; rows along the profile."""

from __future__ import annotations

import numpy as np

from gearfmu.spec.general import GeneralStage
from gearfmu.stage.groups import Group

LAWS = ("constant", "benedict_kelley", "iso_tr_14179")  # in the kernel's order


def friction_starts(stage: GeneralStage) -> dict[str, float]:
    """Parameter → start. Empty where no engagement says anything about friction; else it is on, and an engagement that
    says nothing has none."""
    if not any(mesh.friction for mesh in stage.engagements):
        return {}
    starts = {"effect.friction": 1.0}
    for mesh in stage.engagements:
        prefix = f"{mesh.name}." if len(stage.engagements) > 1 else ""
        own = mesh.friction
        if own is None:
            starts[f"{prefix}friction_coefficient"] = 0.0
            continue
        starts |= {
            f"{prefix}friction_law": float(LAWS.index(own.law)),
            f"{prefix}friction_coefficient": own.coefficient,
            f"{prefix}oil_viscosity": own.viscosity,
            f"{prefix}flank_roughness": own.roughness,
        }
    return starts


def along_rows(group: Group, body: int) -> np.ndarray:
    """(3, 2, P, A, n): what the flanks of a body read of the ground oscillators along the profile beside its rigid
    motion, as c₀, c_c, c_s; but for what supports displace there beyond the modes. Summed in one order."""
    flank = group.layout.bodies[body].flank
    assert flank is not None and flank.along is not None
    shapes = group.shapes[group.at[body]][len(group.layout.freedoms(body)) :]
    total = np.zeros((*flank.along.patterns.shape[:-1], group.omega.size))
    for k, shape in enumerate(shapes):
        total += flank.along.patterns[..., k, None] * shape
    return total
