"""Friction in the step is of second order: on gears that roll, every contact's friction reverses when its sliding does,
whatever the step is, whether contacts stay where they are or ride along a line of contact."""

from __future__ import annotations

import numpy as np
import pytest
from kinds import KINDS, Kind, some

from gearfmu.kernel import Kernel
from gearfmu.stage import Steady

REFERENCE = 1.25e-6  # s
FAST = {"pair", "helical", "internal"}  # stages with several meshes take half a minute and more


def ripple(kind: Kind, h: float, torque: float, settled: float, window: float) -> np.ndarray:
    """Transmission error (rad) at the ends of steps of h, after `settled` with the step of the reference."""
    model = kind.model().driven_by_springs()
    inputs = Steady(model, kind.speed, torque)
    kernel = Kernel(model.blob, {"level": 1.0, "h": h, "effect.friction": 1.0})
    for name, value in inputs(0.0).items():
        kernel.set(name, value)
    kernel.initialize()
    te = []
    for first, count, step in ((0.0, round(settled / REFERENCE), REFERENCE), (settled, round(window / h), h)):
        for i in range(count):
            now = first + i * step
            for name, value in inputs(now).items() if now else ():
                kernel.set(name, value)
            kernel.step(now, step)
            output, ratio = f"{model.shafts.output}.gear.phi", float(model.shafts.ratio)
            te.append(kernel.get(f"{model.shafts.input}.gear.phi") - ratio * kernel.get(output))
    return np.array(te[-count:])


def errors(kind: Kind, steps: tuple[float, ...], torque: float, settled: float, window: float) -> list[float]:
    """Of the transmission error against the reference, as parts of its ripple."""
    reference = ripple(kind, REFERENCE, torque, settled, window)
    found = []
    for h in steps:
        every = round(h / REFERENCE)
        exact = reference[every - 1 :: every]
        found.append(float(np.std(ripple(kind, h, torque, settled, window) - exact) / np.std(exact)))
    return found


def test_half_the_step_has_a_third_of_the_error() -> None:
    """The helical pair under a load at which its default step erred by several per cent: .034 % of the ripple at 2.5 µs
    and .120 % at 5 µs. Sees, each alone: what modes yield at once left behind by parts that ride (.15 and 2.4 %),
    friction at the end of the step with the coefficient of its mean (.085 and .36 %), parts that lead as if they moved
    with the faces (.056 and .17 %)."""
    half, whole = errors(KINDS["helical"], (2.5e-6, 5e-6), 300.0, 0.8e-3, 1.2e-3)
    assert whole < 2e-3
    assert half < min(5e-4, whole / 3.0)


@pytest.mark.parametrize("kind", some(FAST, KINDS.keys() - FAST))
def test_friction_is_resolved_at_the_default_step(kind: Kind) -> None:
    """Every kind of stage at 5 µs: largest error .19 % of the ripple (helical pair; .64 % before it was cured)."""
    (found,) = errors(kind, (5e-6,), kind.torque, 0.4e-3, 0.6e-3)
    assert found < 4e-3
