"""Shapes of a gear's modes, made again from its finite elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearfmu.body import ReducedBody
from gearfmu.body.sector import body_sector
from gearfmu.errors import BodyError
from gearfmu.modes.cyclic import Progress, cyclic_modes
from gearfmu.modes.shapes import BodyModes
from gearfmu.spec.forms.general import RingBody, Stage
from gearfmu.spec.forms.members import member_of

AGREEMENT = 1e-6  # relative: frequencies made again against those of the file


def gear_modes(stage: Stage, stored: ReducedBody, count: int, progress: Progress | None = None) -> BodyModes:
    """The `count` lowest elastic modes of a gear of `stage` (one more where that would split a pair).

    stored : the gear's reduced body, whose frequencies they must have: BodyError where they differ (a file made by
    another program version).
    """
    gear, mesh = member_of(stage, stored.name).gear, body_sector(stage, stored.name)
    rigid = mesh.sets["rim" if isinstance(gear, RingBody) else "bore"] if gear.rigid_bore else None
    found = cyclic_modes(gear.name, mesh, gear.material, min(count, stored.modes), progress, rigid)
    return as_stored(found, stored.frequency, stored.damping_ratio)


def as_stored(found: BodyModes, frequency: np.ndarray, damping_ratio: np.ndarray) -> BodyModes:
    """The same modes with the damping ratios (n,) of the stored body, after its frequencies (n,) Hz were compared."""
    first = np.array([mode.numbers[0] - 1 for mode in found.modes])
    known = first < len(frequency)
    difference = np.abs(np.array([mode.frequency for mode in found.modes])[known] / frequency[first[known]] - 1).max()
    if difference > AGREEMENT:
        raise BodyError(
            f"{found.name}: frequencies made from the finite elements differ by {difference:.1e} from those of the "
            "stored body; make it again with 'gearfmu reduce --force STAGE'"
        )
    modes = [
        replace(mode, damping_ratio=float(damping_ratio[mode.numbers[0] - 1]))
        for mode, is_known in zip(found.modes, known, strict=True)
        if is_known
    ]
    return replace(found, modes=tuple(modes))
