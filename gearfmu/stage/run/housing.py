"""Motion of a housing after a run: the housing on its feet alone, driven by the forces that its bearings recorded.

The forces of shafts on seats (`bearing.NAME.fx_mean` …, their dashpots' share included) are all that moves a housing
but its feet. Its oscillators on the feet, theory eq. 2d with this one body, follow them exactly as constant
over every communication step:

    q̈ + (2ζΩ + Eᵀ c E) q̇ + Ω² q = P f,      ẋ = Φ q̇

P: rows of the seats, E elongations of the feet's springs, c their dashpots, x rigid motion and oscillators of the free
housing: what `body.skin` and `body.sensors` read. The radiation matrix of the skin makes sound power of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sl

from gearfmu.body import Body
from gearfmu.errors import ModelError
from gearfmu.sound import WIDTH, Radiation, SoundError, SoundPower, power_of, segments
from gearfmu.stage.assembly.assemble import layout_of
from gearfmu.stage.assembly.groups import FORCES, MOTIONS, Group, mount
from gearfmu.stage.assembly.observed import MODE, MOTION
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage

SEGMENTS = 40  # of a waterfall, half overlapping, where its lines are not `WIDEST` apart then
WIDEST = 40.0  # Hz


@dataclass(frozen=True)
class HousingMotion:
    """time (T,) s; velocity (T, 6 + n): of rigid motion x, y, z, rx, ry, rz about the origin, m/s and rad/s, and of the
    n oscillators of the free housing that are dynamic, kg^½·m/s. The skin moves with
    `skin_modes[:, :, : 6 + n] @ velocity[t]`."""

    time: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class HousingAlone:
    """A housing on its feet. group: its oscillators; channels: forces of the bearings on it; pushes (s, k): what a unit
    of each does to the oscillators; body: as it was reduced."""

    body: Body
    group: Group
    channels: tuple[str, ...]
    pushes: np.ndarray

    @classmethod
    def of(cls, stage: Stage, bodies: Sequence[Body]) -> HousingAlone:
        """The housing of a stage; bodies as of `assemble`. ModelError where the stage has none."""
        if not stage.housings:
            raise ModelError(f"{stage.name} has no housing: its bearings stand on rigid ground")
        layout = layout_of(stage, bodies)
        last = len(layout.bodies) - 1
        feet = [replace(s, first=(0, s.first[1])) for s in layout.supports if s.first[0] == last]
        group = mount(replace(layout, bodies=layout.bodies[last:], rotors=[], supports=feet, stands=frozenset()))
        seats = [s for s in layout.supports if s.second is not None and s.second[0] == last]
        own = [(s.name, s.second[1], d) for s in seats if s.second is not None for d in s.directions]
        names = tuple(f"{name}.{FORCES[direction]}_mean" for name, _, direction in own)
        pushes = np.array([group.node_rows(0, node, direction) for _, node, direction in own])
        return cls(bodies[-1], group, names, pushes)

    def motion(self, trace: Trace) -> HousingMotion:
        """How the housing of a run moved, from rest under its first forces. TraceError where the run did not record
        the forces of its bearings."""
        group, n, step = self.group, self.group.omega.size, float(trace.time[1] - trace.time[0])
        force = np.stack([trace[name] for name in self.channels], axis=1)
        damping = np.diag(2 * group.zeta * group.omega) + (group.damper_rows.T * group.damper) @ group.damper_rows
        rate = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(group.omega**2), -damping]])
        flow = sl.expm(step * rate)
        pushed = np.linalg.solve(
            rate, (flow - np.eye(2 * n)) @ np.vstack([np.zeros_like(self.pushes.T), self.pushes.T])
        )
        state, found = np.zeros(2 * n), np.zeros((len(force), n))
        state[:n] = (self.pushes.T @ force[0]) / group.omega**2
        for k in range(1, len(force)):
            state = flow @ state + pushed @ force[k]
            found[k] = state[n:]
        return HousingMotion(trace.time, found @ group.shapes.T)


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
