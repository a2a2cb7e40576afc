"""How shafts turn and loads change in time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

RPM = math.pi / 30.0


class Motion(NamedTuple):
    """Angle rad, speed rad/s, acceleration rad/s²."""

    phi: float
    w: float
    a: float


Turn = Callable[[float], Motion]


@dataclass(frozen=True)
class Constant:
    """Constant speed, rad/s."""

    speed: float

    def __call__(self, time: float) -> Motion:
        return Motion(self.speed * time, self.speed, 0.0)


@dataclass(frozen=True)
class UpAndDown:
    """From the speed `low` to `high` (rad/s) within `duration` (s), and back in the same time."""

    low: float
    high: float
    duration: float

    def __call__(self, time: float) -> Motion:
        rate = (self.high - self.low) / self.duration
        if time < self.duration:
            return Motion(self.low * time + 0.5 * rate * time**2, self.low + rate * time, rate)
        since = time - self.duration
        top = 0.5 * (self.low + self.high) * self.duration
        return Motion(top + self.high * since - 0.5 * rate * since**2, self.high - rate * since, -rate)


@dataclass(frozen=True)
class Swinging:
    """A speed (rad/s) with a swing of `acceleration` (rad/s²) at `frequency` (Hz)."""

    speed: float
    acceleration: float
    frequency: float

    def __call__(self, time: float) -> Motion:
        omega = 2.0 * math.pi * self.frequency
        sine, cosine = math.sin(omega * time), math.cos(omega * time)
        swing = self.acceleration / omega**2
        return Motion(self.speed * time - swing * sine, self.speed - swing * omega * cosine, self.acceleration * sine)


@dataclass(frozen=True)
class Step:
    """From one value to another between two times, twice continuously differentiable (quintic)."""

    start: float
    end: float
    before: float
    after: float

    def __call__(self, time: float) -> Motion:
        x = min(max((time - self.start) / (self.end - self.start), 0.0), 1.0)
        span, rise = self.end - self.start, self.after - self.before
        return Motion(
            self.before + rise * x**3 * (10.0 - 15.0 * x + 6.0 * x**2),
            rise * 30.0 * x**2 * (1.0 - x) ** 2 / span,
            rise * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / span**2,
        )
