"""An effect that is off is not there: whatever its data say, not one bit of the run changes. On, they matter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gearfmu.stage import StageModel, simulate
from gearfmu.stage.assembly.blob import GEAR_NUMBERS, read_blob, write_blob

H, DURATION = 60e-6, 4e-3
GEARS = (0, 1)
ENGAGEMENT_NUMBERS = ("x_a", "y_a", "x_b", "y_b", "backlash", "nominal_backlash", "damping")  # the first ones
Sections = dict[str, np.ndarray]


def of_gears(name: str, factor: float) -> Callable[[Sections], None]:
    def change(sections: Sections) -> None:
        for g in GEARS:
            sections[f"gear{g}"][GEAR_NUMBERS.index(name)] *= factor

    return change


def of_pair(name: str, factor: float) -> Callable[[Sections], None]:
    def change(sections: Sections) -> None:
        sections["engagement"][ENGAGEMENT_NUMBERS.index(name)] *= factor

    return change


def of_sections(factor: float, *names: str) -> Callable[[Sections], None]:
    def change(sections: Sections) -> None:
        for name in names:
            sections[name][:] *= factor

    return change


def of_supports(sections: Sections) -> None:
    """What only a stage on its bearings has: the set that is not held."""
    for name in ("omega_ground0", "damper0", "kappa0", "support_compliance0"):
        sections[name][:] *= 0.3


DATA = {
    "effect.elastic": of_sections(1.2, "residual_own0", "residual_own1"),
    "effect.tip_relief": of_gears("relief", 2.0),
    "effect.tip_contact": of_gears("tip_edge", 1.001),  # more would leave a step between flank and edge
    "effect.contact_damping": of_pair("damping", 5.0),
    "effect.coast_flank": of_pair("backlash", 0.5),
    "effect.bearings": of_supports,
    "effect.modal_damping": of_sections(20, "zeta0", "zeta1", "zeta_ground0"),
}


def with_data(model: StageModel, change: Callable[[Sections], None]) -> StageModel:
    sections = {name: np.array(value) if isinstance(value, np.ndarray) else value
                for name, value in read_blob(model.blob).items()}  # fmt: skip
    change(sections)
    return replace(model, blob=write_blob(sections))


def swinging(time: float) -> dict[str, float]:
    """The pinion's shaft end turns and swings by ±10 mrad: the load reverses through the backlash."""
    phi = 210.0 * time + 0.01 * math.sin(2 * math.pi * 500 * time + 0.5)
    return {"pinion.phi": phi, "pinion.w": 210.0, "wheel.phi": -140.0 * time, "wheel.w": -140.0}


def bits(model: StageModel, effect: str, on: bool) -> bytes:
    trace = simulate(model, swinging, DURATION, H, {"level": 1, effect: float(on)})
    assert trace.meta["outcome"] == "completed" and np.abs(trace["mesh.force"]).max() > 2000
    return trace["mesh.te"].tobytes() + trace["mesh.force"].tobytes()


@pytest.mark.parametrize("effect", DATA)
def test_data_of_an_effect_count_when_it_is_on_and_only_then(relieved: StageModel, effect: str) -> None:
    if effect == "effect.tip_contact":  # relieved tips do not touch
        relieved = with_data(relieved, of_gears("relief", 0.0))
    other = with_data(relieved, DATA[effect])
    assert bits(relieved, effect, on=False) == bits(other, effect, on=False)
    assert bits(relieved, effect, on=True) != bits(other, effect, on=True)
