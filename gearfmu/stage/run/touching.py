"""Where gears stand in a run, and which of their teeth touch there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.geometry import PairGeometry
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import EngagementSpec, Stage
from gearfmu.stagefile.forms.shapes import MeshShape, mesh_shape

GEAR_PHI = ".gear.phi"


@dataclass(frozen=True)
class Contact:
    """One tooth pair in contact: tooth number and roll (m) on either gear."""

    teeth: tuple[int, int]
    rolls: tuple[float, float]


def angle_of(trace: Trace, stage: Stage, gear: str) -> np.ndarray | None:
    """Angle (n,) rad of a gear in the axes in which its axis stands, those of its carrier where it has one; None where
    that was not recorded."""
    rotor = stage.rotor_of(gear)
    names = [name + GEAR_PHI for name in (rotor, stage.rotors[rotor].carried_by) if name is not None]
    if any(name not in trace for name in names):
        return None
    return trace[names[0]] - trace[names[1]] if len(names) > 1 else trace[names[0]]


def position_of(trace: Trace, stage: Stage, mesh: EngagementSpec) -> np.ndarray | None:
    """(n,) pitches by which gear A of an engagement would have turned on without load, from the angle of gear B; None
    where that was not recorded."""
    pair, angle = mesh_shape(stage, mesh), angle_of(trace, stage, mesh.gears[1])
    return None if angle is None else np.asarray(-pair.side * angle * pair.gears[1].z / (2 * math.pi))


def contacts_at(pair: MeshShape, angles: Sequence[float], sg: int) -> list[Contact]:
    """The tooth pairs whose contact point lies on both flanks `sg`, from gear A's root outward. angles (rad) of the
    bodies from the line of their centres, A to B; of a ring, B, from its axis to A's."""
    (a, b), external = pair.gears, isinstance(pair, PairGeometry)
    t, length = -sg * pair.alpha_wt, pair.length
    base, first, low, high = a.r_b, angles[0] + sg * a.psi_b - t, a.s_form, a.s_tip
    found, ends = [], sorted((b.s_form, b.s_tip))
    for k in range(a.z):
        roll = base * sg * _wrapped(first + 2 * math.pi * k / a.z)
        opposite = length - roll if external else length + roll
        if low <= roll <= high and ends[0] <= opposite <= ends[1]:
            turn = t + (math.pi if external else 0.0) + sg * (opposite / b.r_b - b.psi_b) - angles[1]
            found.append(Contact((k, round(turn * b.z / (2 * math.pi)) % b.z), (roll, opposite)))
    return sorted(found, key=lambda contact: contact.rolls[0])


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi
