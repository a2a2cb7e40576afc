"""Gears whose own motion is an output of the model: rigid motion and amplitudes of the free body's modes.

The displacement of the body in its own axes is x + θ × r + √m Σ q̂_k φ_k(r), with the mode shapes φ_k, kg^-½, of the
body's file. q̂_k = q_k/√m, m, is the root-mean-square displacement, by mass, of the body in that mode alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from gearfmu.body import Body
from gearfmu.errors import ModelError
from gearfmu.stage.assembly.ground_part import NODE_MEMBERS
from gearfmu.stage.assembly.groups import Group, families
from gearfmu.stagefile.forms.general import Of, Stage

MOTION, MODE = ".motion.", ".mode_"


def observed_number(stage: Stage, name: str) -> int:
    """Number of a gear in the stage. ModelError for any other body."""
    names = [gear.name for gear in stage.gears]
    if name not in names:
        raise ModelError(f"stage {stage.name}: no gear '{name}' whose motion could be an output; {', '.join(names)}")
    return names.index(name)


def observed_sections(index: int, bodies: Sequence[Body], groups: Sequence[Group]) -> dict[str, Any]:
    """Sections of the blob that make the motion of gear `index` outputs. bodies: reduced gears of the stage."""
    layout, body = groups[0].layout, bodies[index]
    flank = layout.bodies[index].flank
    assert flank is not None
    found: dict[str, Any] = {
        f"observed{index}": layout.bodies[index].name,
        f"own_number{index}": np.concatenate([-1 - np.arange(6), flank.low + 1]).astype(np.int32),
        f"own_member{index}": np.concatenate([NODE_MEMBERS, body.toothed.part[flank.low]]).astype(np.int32),
        f"mode_number{index}": (flank.chosen + 1).astype(np.int32),
        f"mode_scale{index}": np.array([1 / math.sqrt(body.total_mass)]),
    }
    for s, group in enumerate(groups):
        read = np.flatnonzero(group.owner == families(group.layout)[index])
        elastic = group.shapes[group.at[index]][len(layout.freedoms(index)) :]
        rows = np.vstack([group.rigid(index), elastic / math.sqrt(body.total_mass)])
        found[f"own_rows{index}_{s}"] = np.ascontiguousarray(rows[:, read])
    return found


def gear_bodies(stage: Stage, bodies: Sequence[Of]) -> dict[str, Of]:
    """`Stage.by_name` of the gears alone: their bodies, or what stands for them, such as hashes."""
    found = stage.by_name(bodies)
    return {gear.name: found[gear.name] for gear in stage.gears}
