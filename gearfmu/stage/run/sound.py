"""Sound power of a housing in a run: its motion under recorded bearing forces, by the radiation matrix of its skin."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gearfmu.body import Body
from gearfmu.body.body import Skin as BodySkin
from gearfmu.sound import Radiation, Skin, SoundError, SoundPower, power_of, radiation, segments, skin_of
from gearfmu.sound.store import load_radiation, save_radiation
from gearfmu.spec.forms.general import Stage
from gearfmu.stage.build.observed import MODE, MOTION
from gearfmu.stage.run.housing import HousingAlone
from gearfmu.stage.run.trace import Trace

MOTIONS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Sounding:
    """matrix: file of the radiation matrix, made when it is not there and kept; patches: of its boundary elements;
    speed: channel of a waterfall, one spectrum a segment, their mean when None; start: from which it counts, s."""

    matrix: str | os.PathLike[str] | None = None
    patches: int = 1000
    speed: str | None = None
    start: float = 0.0


def radiated_power(run: Trace, stage: Stage, bodies: Sequence[Body], how: Sounding) -> SoundPower:
    """Sound power that the housing of a stage radiates in a run; bodies as of `assemble`.

    Raises SoundError for a stage without a housing or skin and a record without equal steps; TraceError where the
    forces of the bearings were not recorded.
    """
    body, own = _skinned(stage, bodies)
    known = _recorded(run, body)
    coordinates = HousingAlone.of(stage, bodies).motion(run).velocity if known is None else known
    count = coordinates.shape[1]
    heard = run.time >= how.start
    pieces = segments(run.time[heard], coordinates[heard], moved=known is not None)
    skin = skin_of(own.points, own.faces, own.skin_modes[:, :, :count])
    sound = _matrix(skin, how, f"{body.how.hash} {count} {how.patches}")
    turning = None if how.speed is None else np.interp(pieces.middle, run.time, run[how.speed])
    return power_of(pieces, sound, turning, steady=how.speed is None)


def _skinned(stage: Stage, bodies: Sequence[Body]) -> tuple[Body, BodySkin]:
    """The reduced housing of a stage and its skin. SoundError where it has none, or no skin."""
    if not stage.housings:
        raise SoundError(f"stage {stage.name} has no housing: name one, or put it under the run with `gearfmu house`")
    body = stage.by_name(bodies)[stage.housings[0].name]
    if body.skin is None:
        raise SoundError(f"the housing of {stage.name} has no skin: name its outer surface in [import], skin = …")
    return body, body.skin


def _recorded(run: Trace, body: Body) -> np.ndarray | None:
    """(T, 6 + n): motion of the housing, where a trace of `house` has it."""
    rigid = [f"{body.name}{MOTION}{own}" for own in MOTIONS]
    modes = [name for i in range(body.modes) if (name := f"{body.name}{MODE}{i + 1}") in run]
    if not all(name in run for name in rigid):
        return None
    moved, root = [run[name] for name in rigid], math.sqrt(body.total_mass)
    return np.stack([*moved, *(root * run[name] for name in modes)], axis=1)


def _matrix(skin: Skin, how: Sounding, key: str) -> Radiation:
    """The radiation matrix of a file where it is of this skin, else made, and kept in the file."""
    if how.matrix is not None and Path(how.matrix).exists():
        found, known = load_radiation(how.matrix)
        if known == key:
            return found
    found = radiation(skin, count=how.patches)
    if how.matrix is not None:
        save_radiation(found, how.matrix, key)
    return found
