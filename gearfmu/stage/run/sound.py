"""Sound power of a housing in a run: its motion under recorded bearing forces, by the radiation matrix of its skin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.body import Body
from gearfmu.sound import WIDTH, Radiation, SoundError, SoundPower, power_of, segments
from gearfmu.stage.assembly.groups import MOTIONS
from gearfmu.stage.assembly.observed import MODE, MOTION
from gearfmu.stage.run.housing import HousingAlone
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage

SEGMENTS = 40  # of a waterfall, half overlapping, where its lines are not `WIDEST` apart then
WIDEST = 40.0  # Hz


@dataclass(frozen=True)
class Heard:
    """What of a run counts. speed: channel of a waterfall, one spectrum a segment, their mean when None; start: s."""

    speed: str | None = None
    start: float = 0.0

    def width(self, time: np.ndarray) -> float:
        """Hz, spacing of the lines: that of the steady state, or as wide as `SEGMENTS` of a waterfall need."""
        if self.speed is None or time.size < 2:
            return WIDTH
        return float(np.clip(0.5 * SEGMENTS / (time[-1] - time[0]), WIDTH, WIDEST))


def radiated_power(run: Trace, stage: Stage, bodies: Sequence[Body], sound: Radiation, heard: Heard) -> SoundPower:
    """Sound power that the housing of a stage radiates in a run; bodies as of `assemble`, sound: of all coordinates of
    the housing.

    Raises SoundError for a stage without a housing and a record without equal steps; TraceError where the forces of
    the bearings were not recorded.
    """
    known = _recorded(run, housing_body(stage, bodies))
    coordinates = HousingAlone.of(stage, bodies).motion(run).velocity if known is None else known
    counts = run.time >= heard.start
    time = run.time[counts]
    pieces = segments(time, coordinates[counts], heard.width(time), moved=known is not None)
    turning = None if heard.speed is None else np.interp(pieces.middle, run.time, run[heard.speed])
    return power_of(pieces, sound.of(coordinates.shape[1]), turning, steady=heard.speed is None)


def housing_body(stage: Stage, bodies: Sequence[Body]) -> Body:
    """The reduced housing of a stage. SoundError where it has none."""
    if not stage.housings:
        raise SoundError(f"stage {stage.name} has no housing: name one, or put it under the run with `gearfmu house`")
    return stage.by_name(bodies)[stage.housings[0].name]


def _recorded(run: Trace, body: Body) -> np.ndarray | None:
    """(T, 6 + n): motion of the housing, where a trace of `house` has it."""
    rigid = [f"{body.name}{MOTION}{own}" for own in MOTIONS]
    modes = [name for i in range(body.modes) if (name := f"{body.name}{MODE}{i + 1}") in run]
    if not all(name in run for name in rigid):
        return None
    moved, root = [run[name] for name in rigid], math.sqrt(body.total_mass)
    return np.stack([*moved, *(root * run[name] for name in modes)], axis=1)
