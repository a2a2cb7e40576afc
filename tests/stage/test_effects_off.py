"""An effect that is off is not there: whatever its data say, not one bit of the run changes. On, they matter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gearfmu.stage import StageModel, simulate
from gearfmu.stage.blob import read_blob, write_blob

H, DURATION = 60e-6, 4e-3
CURVE, EDGE, BEARING = 11, 13, slice(16, 18)  # places in a gear's numbers
BACKLASH, DASHPOT = 1, 2  # in the pair's
Sections = dict[str, np.ndarray]


def of_gears(place: int | slice, factor: float) -> Callable[[Sections], None]:
    def change(sections: Sections) -> None:
        for name in ("gear0", "gear1"):
            sections[name][place] *= factor

    return change


def of_pair(place: int, factor: float) -> Callable[[Sections], None]:
    def change(sections: Sections) -> None:
        sections["pair"][place] *= factor

    return change


def of_modes(sections: Sections) -> None:
    for name in ("zeta0", "zeta1"):
        sections[name][:] *= 20


def of_bodies(sections: Sections) -> None:
    for name in ("c_ff0", "c_ff1"):
        sections[name][:] *= 1.2


DATA = {
    "effect.elastic": of_bodies,
    "effect.tip_relief": of_gears(CURVE, 2.0),
    "effect.tip_contact": of_gears(EDGE, 1.001),  # more would leave a step between flank and edge
    "effect.contact_damping": of_pair(DASHPOT, 5.0),
    "effect.coast_flank": of_pair(BACKLASH, 0.5),
    "effect.bearings": of_gears(BEARING, 0.3),
    "effect.modal_damping": of_modes,
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
    other = with_data(relieved, DATA[effect])
    assert bits(relieved, effect, on=False) == bits(other, effect, on=False)
    assert bits(relieved, effect, on=True) != bits(other, effect, on=True)
