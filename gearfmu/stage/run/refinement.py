"""Slices as a discretisation: the lines of contact of helical teeth are cut into as many parts, and twice as many show
how much of a result is due to their number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.errors import SimulationError
from gearfmu.quantities import all_ranges
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.te import loaded_te
from gearfmu.stagefile.forms.general import Stage, ToothedBody

ORDERS, POSITIONS = 8, 20
HEARD = 10e-9  # m: an order that changes by less, a hundredth of the form deviations of the finest flanks (ISO 1328-1,
# class 1: 1 µm), is not judged by its level


def twice(stage: Stage, slices: int) -> int:
    """Twice as many slices where lines of contact slant, at most as many as a model takes; else as many."""
    slanting = any(isinstance(body, ToothedBody) and body.helix_angle != 0 for body in stage.bodies.values())
    return min(2 * slices, int(all_ranges()["slices"].high)) if slanting else slices


@dataclass(frozen=True)
class Change:
    """Change by twice the slices of orders 1 … ORDERS of the static transmission error: the largest change (m), and
    the largest in level (dB) of those that change by more than HEARD."""

    slices: int
    length: float
    level: float

    @property
    def text(self) -> str:
        """In one line."""
        level = f", {self.level:.2g} dB" if self.level else ""
        return f"orders 1 to {ORDERS} change by at most {1e9 * self.length:.2g} nm{level} with {self.slices} slices"


def left_of_slices(
    model: StageModel, torques: Sequence[float], slices: int | None = None, mesh: str | None = None, **parameters: float
) -> Change | None:
    """Under these torques (N·m on the input), of the stage's own number of slices or another; None for spur stages, and
    where a torque has no equilibrium. Mesh and parameters as `loaded_te` takes them."""
    own = slices or model.stage.slices
    finer = twice(model.stage, own)
    if finer == own:
        return None
    try:
        found = [
            loaded_te(model, torques, POSITIONS, mesh, 1, None, slices=float(n), **parameters) for n in (own, finer)
        ]
    except SimulationError:
        return None
    coarse, fine = (result.harmonics(ORDERS) for result in found)
    length = np.abs(fine - coarse)
    if not np.isfinite(length).all():
        return None
    level = np.abs(20 * np.log10(np.maximum(fine, 1e-15) / np.maximum(coarse, 1e-15)))
    heard = level[length > HEARD]
    return Change(finer, float(length.max()), float(heard.max()) if heard.size else 0.0)
