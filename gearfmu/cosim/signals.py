"""Functions of time that may jump: what a drivetrain receives from outside (clutch capacity, torque)."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

TIME_NOISE = 1e-9  # s: two times closer than this are one (communication points carry rounding noise)


@dataclass(frozen=True)
class Ramp:
    """Straight lines through the points (time s, value), constant before the first and after the last.

    The same time twice is a jump. Jumps and corners are exact when they fall on the micro-steps of the unit.
    """

    points: tuple[tuple[float, float], ...]

    @cached_property
    def _times(self) -> list[float]:
        return [time for time, _ in self.points]

    def ends(self, t0: float, t1: float) -> tuple[float, float]:
        """Right limit at t0, left limit at t1 (s)."""
        return self._limit(t0 + TIME_NOISE, t0, bisect_right), self._limit(t1 - TIME_NOISE, t1, bisect_left)

    def _limit(self, near: float, time: float, bisect: Callable) -> float:
        k = bisect(self._times, near)
        if k == 0:
            return self.points[0][1]
        if k == len(self.points):
            return self.points[-1][1]
        (ta, va), (tb, vb) = self.points[k - 1], self.points[k]
        return va + (vb - va) * min(max((time - ta) / (tb - ta), 0.0), 1.0)
