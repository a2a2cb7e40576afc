"""Torques on the shafts of a stage: sums of laws of time and speed. Declared once; docs are made from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated

from pydantic import Field

from gearfmu.stagefile.reading.base import Quantity, Spec, entry

Found = Iterator[tuple[str, str, str]]  # field of the scene, value, remedy
Torque = Annotated[float, Quantity("torque")]
Time = Annotated[float, Quantity("time")]


class ProportionalTorque(Spec):
    """A torque that follows the speed of the shaft: `torque` at `speed`, zero at rest. A brake has the other sign than
    its speed."""

    torque: Torque = entry("torque at that speed")
    speed: Annotated[float, Quantity("speed")] = entry("speed at which the shaft has this torque")

    @property
    def slope(self) -> float:
        """Torque per speed, N·m·s/rad."""
        return self.torque / self.speed


class AlternatingTorque(Spec):
    """amplitude · sin(2π frequency t)."""

    amplitude: Annotated[float, Quantity("amplitude")] = entry("of the sine")
    frequency: Annotated[float, Quantity("frequency")] = entry("of the sine, which begins at zero")


class SpeedControl(Spec):
    """A drive that follows a speed over time: damping · (wanted speed − speed), on top of the other torques."""

    damping: Annotated[float, Quantity("control_damping")] = entry("torque per deviation of the speed")
    over_time: Annotated[
        tuple[tuple[Time, Annotated[float, Quantity("speed")]], ...],
        Field(min_length=1, description="wanted speed: straight lines through (time, speed), constant outside"),
    ]


class ShaftLoad(Spec):
    """Torque of the outside on one shaft about +z: the sum of the given laws."""

    constant: Torque | None = entry("the same at all times", None)
    over_time: Annotated[tuple[tuple[Time, Torque], ...], Field(min_length=1)] | None = entry(
        "straight lines through (time, torque), constant outside; the same time twice jumps", None
    )
    proportional: ProportionalTorque | None = entry("follows the speed of the shaft", None)
    alternating: AlternatingTorque | None = entry("a sine of time", None)
    speed_control: SpeedControl | None = entry("follows a wanted speed over time", None)


def load_problems(loads: dict[str, ShaftLoad]) -> Found:
    """What no single field of [shaft_loads] shows."""
    if not loads:
        yield "shaft_loads", "", 'no shaft has a load: write e.g. [shaft_loads.sun] constant = "9 N*m"'
    for name, load in loads.items():
        yield from law_problems(load, f"shaft_loads.{name}")


def law_problems(load: ShaftLoad, table: str) -> Found:
    """What no single field of the torque in `table` shows."""
    laws = ShaftLoad.model_fields
    if all(getattr(load, name) is None for name in laws):
        yield table, "", f"this shaft has no torque: give one or more of {', '.join(laws)}"
    wanted = load.speed_control.over_time if load.speed_control is not None else ()
    for field, points in (("over_time", load.over_time or ()), ("speed_control.over_time", wanted)):
        yield from time_problems(points, f"{table}.{field}")
    if load.proportional is not None and load.proportional.speed == 0.0:
        yield f"{table}.proportional.speed", "0 rad/s", "a torque at rest follows no speed: write it as constant"


def time_problems(points: Sequence[tuple[float, float]], field: str) -> Found:
    """Points (time, value) that go back in time."""
    times = [time for time, _ in points]
    if any(b < a for a, b in zip(times, times[1:], strict=False)):
        yield field, "", "times must not decrease: sort the points by time"
