"""Points of a sweep: grids, keys and what they belong to, values as text."""

from __future__ import annotations

from typing import Any

import pytest

from gearfmu.errors import SpecError
from gearfmu.sweeps.plan import RUN, SIMULATE, TE, SweepError, key_and_values, plan, split


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("torque=100, 200,300 N*m", ["100 N*m", "200 N*m", "300 N*m"]),
        ("torque=100 N*m, 0.2 kN*m", ["100 N*m", "0.2 kN*m"]),
        ("speed=1000:2000:3 rpm", ["1000 rpm", "1500 rpm", "2000 rpm"]),
        ("stage.slices=3,5", [3, 5]),
        ("final=1.5:2:2", [1.5, 2.0]),
        ("stage.level=fast, full", ["fast", "full"]),
        ("stage.effects.hertz=true,false", [True, False]),
        ("ratio=4.1", [4.1]),
    ],
)
def test_values_as_text(text: str, values: list[Any]) -> None:
    key, found = key_and_values(text)
    assert key == text.partition("=")[0] and found == values and list(map(type, found)) == list(map(type, values))


@pytest.mark.parametrize("text", ["torque", "=1", "torque=", "speed=a:b:3 rpm"])
def test_values_that_are_none(text: str) -> None:
    with pytest.raises(SweepError, match="start:end:count|KEY=VALUES"):
        key_and_values(text)


def test_the_last_key_of_a_grid_is_fastest_and_single_values_are_no_axes() -> None:
    made = plan("pair_loaded", {"torque": [1.0, 2.0], "stage.level": "fast", "speed": ["1 rpm", "2 rpm"]})
    assert made.what == RUN and made.axes == ("torque", "speed")
    assert [(p["torque"], p["speed"]) for p in made.points] == [(1, "1 rpm"), (1, "2 rpm"), (2, "1 rpm"), (2, "2 rpm")]


def test_a_stage_with_a_speed_is_run_and_without_one_is_static() -> None:
    assert plan("fzg_c", {"torque": [1.0], "speed": [2.0]}).what == SIMULATE
    assert plan("fzg_c", {"torque": [1.0]}).what == TE
    with pytest.raises(SweepError, match="its points need torque"):
        plan("fzg_c", {"speed": [1.0]})
    with pytest.raises(SweepError, match="all with the same keys"):
        plan("fzg_c", [{"torque": 1.0}, {"torque": 1.0, "level": "fast"}])
    with pytest.raises(SpecError, match="no such stage"):
        plan("fzg_q", {"torque": [1.0]})


def test_keys_belong_to_the_scene_or_to_the_stage_file() -> None:
    keys = "torque stage.level stage.contact stage.contact.damping stage.effects.hertz stage.torque_max".split()
    stage, scene = split(RUN, dict.fromkeys(keys, 1))
    assert set(stage) == {"contact.damping", "torque_max"}
    assert set(scene) == {"torque", "stage.level", "stage.contact", "stage.effects.hertz"}


@pytest.mark.parametrize(
    ("subject", "key", "unit"),
    [
        ("pair_loaded", "torque", "N*m"),
        ("clutch_closure", "torque", "N*m"),
        ("pair_loaded", "speed", "rad/s"),
        ("pair_loaded", "coupling.step", "s"),
        ("pair_loaded", "stage.level", None),
        ("pair_loaded", "stage.gears.wheel.tip_relief.amount", "m"),
        ("pair_loaded", "stage.ports.wheel.k", "N*m/rad"),
        ("two_stage", "stage.bodies.pinion1.face_width", "m"),
        ("planetary54", "stage.set.load_sharing", ""),
        ("planetary_backfire", "shaft_loads.carrier.alternating.frequency", "Hz"),
    ],
)
def test_units_of_keys(subject: str, key: str, unit: str | None) -> None:
    assert plan(subject, {"torque": 1.0, key: 1.0}).unit(key) == unit
