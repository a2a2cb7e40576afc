"""Frames of a run: motion of chosen gears at some of its communication points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.cosim.units import Unit
from gearfmu.errors import CouplingError
from gearfmu.scenefile.scene import DeformationChoice, SceneSpec
from gearfmu.stage.assembly.groups import MOTIONS
from gearfmu.stage.assembly.observed import MODE, MOTION
from gearfmu.stage.run.deformation import Deformation, GearMotion


@dataclass(frozen=True)
class FramePlan:
    """Gears, and numbers of the communication steps at whose ends there is a picture or a frame of the film."""

    gears: tuple[str, ...]
    pictures: tuple[int, ...]
    film: tuple[int, ...]

    @property
    def steps(self) -> list[int]:
        """All of them, ascending."""
        return sorted({*self.pictures, *self.film})

    @property
    def patterns(self) -> tuple[str, ...]:
        """Names of the outputs, which a trace leaves out."""
        return tuple(f"{gear}{kind}*" for gear in self.gears for kind in (MOTION, MODE))


def frame_plan(scene: SceneSpec, choice: DeformationChoice) -> FramePlan:
    """Frames that a scene asks for, by its choice of gears and times."""
    step = scene.coupling.step
    return FramePlan(choice.gears, tuple(choice.picture_steps(step)), tuple(choice.film_steps(step, scene.steps)))


class FrameRecorder:
    """Keeps the frames of a run. CouplingError for a stage whose outputs do not tell how a gear moves."""

    def __init__(self, stage: Unit, plan: FramePlan) -> None:
        known = stage.outputs()
        missing = [gear for gear in plan.gears if f"{gear}{MOTION}x" not in known]
        if missing:
            raise CouplingError(
                f"the stage does not report how {', '.join(missing)} moves: take an FMU exported with --observe "
                f"{missing[0]}, or none"
            )
        self.plan = plan
        self._names = [name for name in known if any(name.startswith(p[:-1]) for p in plan.patterns)]
        self._log = stage.log(self._names, len(plan.steps))
        self._wanted, self._time = frozenset(plan.steps), list[float]()

    def take(self, number: int, time: float) -> None:
        """Keep the present motion where a frame is wanted after step `number`, at `time` (s)."""
        if number in self._wanted:
            self._log.take()
            self._time.append(time)

    def frames(self, bodies: Mapping[str, str], meta: Mapping[str, object]) -> Deformation:
        """Everything kept so far. bodies : hash of the reduced body of every gear."""
        rows = self._log.rows()[: len(self._time)].copy()
        at = {step: k for k, step in enumerate(self.plan.steps[: len(rows)])}
        pictures, film = (
            np.array([at[s] for s in steps if s in at], int) for steps in (self.plan.pictures, self.plan.film)
        )
        gears = {gear: _motion(gear, self._names, rows, bodies[gear]) for gear in self.plan.gears}
        return Deformation(np.array(self._time), pictures, film, gears, dict(meta))


def _motion(gear: str, names: Sequence[str], rows: np.ndarray, body_hash: str) -> GearMotion:
    column = {name: k for k, name in enumerate(names)}
    modes = sorted(int(name.removeprefix(gear + MODE)) for name in names if name.startswith(gear + MODE))
    amplitude = rows[:, [column[f"{gear}{MODE}{mode}"] for mode in modes]]
    return GearMotion(body_hash, np.array(modes, int), amplitude, rows[:, [column[gear + MOTION + m] for m in MOTIONS]])
