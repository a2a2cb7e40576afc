"""Which gears a run records deformed, and when. Declared once; docs are made from it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from gearfmu.errors import Problem
from gearfmu.stagefile.reading.base import Name, Quantity, Spec, Switch

Time = Annotated[float, Quantity("time")]
MOST_FRAMES = 2000


class DeformationChoice(Spec):
    """Gears whose rigid motion and modal amplitudes are recorded, and the frames: `times`, shown as pictures, and one
    `every` so often, shown as a film."""

    gears: Annotated[tuple[Name, ...], Field(min_length=1, description="names of gears, e.g. ring")]
    times: tuple[Time, ...] = Field(default=(), description="the report shows a picture of each")
    every: Annotated[float, Quantity("step")] | None = Field(
        default=None, description="from one frame of the film to the next"
    )
    vtu: Switch = Field(default=False, description="also write every frame for ParaView, as .vtu with a .pvd")

    def film_steps(self, step: float, steps: int) -> list[int]:
        """Numbers of the communication steps (s) at whose ends the film has a frame, 0: the start."""
        if self.every is None:
            return []
        count = int(steps * step / self.every * (1 + 1e-9)) + 1
        return sorted({round(k * self.every / step) for k in range(count)})

    def picture_steps(self, step: float) -> list[int]:
        """The same of the pictures."""
        return sorted({round(time / step) for time in self.times})


def deformation_problems(choice: DeformationChoice, step: float, duration: float, file: str) -> Iterator[Problem]:
    """What no single field shows."""
    for k, time in enumerate(choice.times):
        if time > duration * (1 + 1e-9):
            remedy = f"must not exceed the duration, {duration:g} s"
            yield Problem(file, f"deformation.times[{k}]", f"{time:g} s", remedy)
    if not choice.times and choice.every is None:
        yield Problem(file, "deformation", "", 'when? write times = ["10 ms"], every = "1 ms", or both')
    if choice.every is not None and choice.every < step * (1 - 1e-9):
        remedy = f"must not be below the communication step, {step:g} s"
        yield Problem(file, "deformation.every", f"{choice.every:g} s", remedy)
    elif choice.every is not None and duration / choice.every > MOST_FRAMES:
        remedy = f"makes more than {MOST_FRAMES} frames: use {duration / MOST_FRAMES:.2g} s or more"
        yield Problem(file, "deformation.every", f"{choice.every:g} s", remedy)
