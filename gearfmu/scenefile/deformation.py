"""Which gears a run records deformed, and when. Declared once; docs are made from it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from gearfmu.scenefile.shaft_loads import Found, Time
from gearfmu.stagefile.reading.base import Name, Quantity, Spec, Switch, entry

MOST_FRAMES = 2000


class DeformationChoice(Spec):
    """Gears whose rigid motion and modal amplitudes are recorded, and the frames: `times`, shown as pictures, and one
    `every` so often, shown as a film."""

    gears: Annotated[tuple[Name, ...], Field(min_length=1, description="names of gears, e.g. ring")]
    times: tuple[Time, ...] = entry("the report shows a picture of each", ())
    every: Annotated[float, Quantity("step")] | None = entry("from one frame of the film to the next", None)
    vtu: Switch = entry("also write every frame for ParaView, as .vtu with a .pvd", False)

    def film_steps(self, step: float, steps: int) -> list[int]:
        """Numbers of the communication steps (s) at whose ends the film has a frame, 0: the start."""
        if self.every is None:
            return []
        count = int(steps * step / self.every * (1 + 1e-9)) + 1
        return sorted({round(k * self.every / step) for k in range(count)})

    def picture_steps(self, step: float) -> list[int]:
        """Numbers of the communication steps (s) at whose ends a picture is taken."""
        return sorted({round(time / step) for time in self.times})


def deformation_problems(choice: DeformationChoice, step: float, duration: float) -> Found:
    """What no single field shows."""
    for k, time in enumerate(choice.times):
        if time > duration * (1 + 1e-9):
            yield f"deformation.times[{k}]", f"{time:g} s", f"must not exceed the duration, {duration:g} s"
    if not choice.times and choice.every is None:
        yield "deformation", "", 'when? write times = ["10 ms"], every = "1 ms", or both'
    if choice.every is not None and choice.every < step * (1 - 1e-9):
        yield "deformation.every", f"{choice.every:g} s", f"must not be below the communication step, {step:g} s"
    elif choice.every is not None and duration / choice.every > MOST_FRAMES:
        remedy = f"makes more than {MOST_FRAMES} frames: use {duration / MOST_FRAMES:.2g} s or more"
        yield "deformation.every", f"{choice.every:g} s", remedy
