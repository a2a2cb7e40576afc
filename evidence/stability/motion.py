"""What drives the scenes: shafts whose outer ends turn at given speeds, wound up against each other under torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from evidence.stability.bench import SHAFTS, Variant, geometry, mean_te, model

RPM = 3.141592653589793 / 30.0


class Motion(NamedTuple):
    """Angle rad, speed rad/s, acceleration rad/s²."""

    phi: float
    w: float
    a: float


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


def winding(variant: Variant, torque: float) -> float:
    """Angle (rad) of the pinion's outer end against the unloaded train under a torque (N·m) on the pinion: both shafts
    and the mean quasi-static transmission error, backlash included where the torque is negative."""
    spec, pair = model(variant).spec, geometry(variant)
    ratio = spec.gears[1].teeth / spec.gears[0].teeth
    k = [spec.ports[name].k for name in SHAFTS]
    assert k[0] is not None and k[1] is not None, "both ports are springs"
    shafts = 1.0 / k[0] + ratio**2 / k[1]
    return torque * shafts + mean_te(variant, torque) / pair.gears[0].r_b


def mid_backlash(variant: Variant) -> float:
    """Angle (rad) of the pinion that centres its teeth in the spaces of the wheel."""
    pair = geometry(variant)
    return -0.5 * pair.normal_backlash / pair.gears[0].r_b


@dataclass(frozen=True)
class Turning:
    """Inputs of a pair with spring ports: the wheel's end turns as `motion` asks, the pinion's end too, and is wound up
    by the steps in `windings` (rad), one after the other."""

    variant: Variant
    motion: Constant | UpAndDown
    windings: Sequence[Step]

    def __call__(self, time: float) -> Mapping[str, float]:
        gears = model(self.variant).spec.gears
        ratio = gears[1].teeth / gears[0].teeth
        turn = self.motion(time)
        step = next((step for step in self.windings if time < step.end), self.windings[-1])
        wound = step(time)
        return {
            "pinion.phi": turn.phi + wound.phi,
            "pinion.w": turn.w + wound.w,
            "pinion.a": turn.a + wound.a,
            "wheel.phi": -turn.phi / ratio,
            "wheel.w": -turn.w / ratio,
            "wheel.a": -turn.a / ratio,
        }


def loaded(variant: Variant, motion: Constant | UpAndDown, torque: float) -> Turning:
    """Inputs under a mean torque (N·m on the pinion) that stays."""
    wound = winding(variant, torque)
    return Turning(variant, motion, (Step(0.0, 1.0, wound, wound),))
