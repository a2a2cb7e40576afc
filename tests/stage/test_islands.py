"""Engagements that act on each other within a step belong to one island, whatever couples them, and an island is solved
as well after any number of turns."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from doubled import doubled

from gearfmu.body import load_bodies
from gearfmu.stage import assemble
from gearfmu.stage.run.simulate import simulate
from gearfmu.stagefile.forms.general import GearBody, Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import SupportSpec

H, DURATION = 20e-6, 4e-4
BETWEEN = 1e9  # N/m
FAST = 1.0
TORQUE_OUT = {"input": "spring", "output": "torque"}
SAME = 3e-6  # of the largest value: ten times the largest difference found


@pytest.fixture(scope="module")
def pair() -> tuple[Stage, dict[str, Any]]:
    spec = load_stage("fzg_c/stage_relief")
    return spec, spec.by_name(load_bodies(spec))


def held(support: SupportSpec, extra: float = 0.0) -> SupportSpec:
    """Held against tilting too, with `extra` N/m more and the same dashpot."""
    assert isinstance(support.radial, float)
    radial = support.radial + extra
    ratio = support.damping_ratio * math.sqrt(support.radial / radial)
    return support.model_copy(update={"radial": radial, "axial": 1e9, "tilt": 1e6, "damping_ratio": ratio})


def opposed(stage: Stage) -> Stage:
    """The pair and its image, turned by half a turn about the wheel's axis, with a bearing between both wheels."""
    axis = stage.rotors["wheel"].axis
    both = doubled(
        stage.model_copy(update={"supports": tuple(map(held, stage.supports))}),
        lambda name: f"{name}2",
        lambda own: (2 * axis[0] - own[0], 2 * axis[1] - own[1]),
    )
    between = SupportSpec(name="between", body="wheel", to="wheel2", radial=BETWEEN, damping_ratio=0.0)
    return both.model_copy(update={"supports": (*both.supports, between)})


def run(stage: Stage, bodies: dict[str, Any], inputs: dict[str, float]) -> dict[str, np.ndarray]:
    """A run at level fast from rest, under inputs that stay."""
    model = assemble(stage, [bodies[name] for name in stage.files])
    trace = simulate(model, lambda time: inputs, DURATION, H, {"level": FAST})
    return {name: channel.values for name, channel in trace.channels.items()}


def with_ports(stage: Stage, kinds: dict[str, str]) -> Stage:
    changed = {
        name: port.model_copy(update={"kind": kinds[name], "k": 1e5 if kinds[name] == "spring" else None, "c": None})
        for name, port in stage.ports.items()
    }
    return stage.model_copy(update={"ports": changed})


def test_a_bearing_between_two_rotors_couples_their_meshes(pair: tuple[Stage, dict[str, Any]]) -> None:
    """What acts on the wheel's image is opposite, so that the bearing between them acts as one of twice its stiffness
    on the ground. Seen by it: islands by rotors alone, which leave the wheels' common oscillators out of a step."""
    stage, bodies = pair
    spring = with_ports(stage, dict.fromkeys(stage.ports, "spring"))
    alone = tuple(held(s, 2 * BETWEEN if s.body == "wheel" else 0.0) for s in spring.supports)
    one = run(spring.model_copy(update={"supports": alone}), bodies, {"pinion.phi": 3e-3})
    two = {"pinion.phi": 3e-3, "pinion2.phi": 3e-3}
    both = run(opposed(spring), bodies | {f"{name}2": body for name, body in bodies.items()}, two)
    for name in ("mesh.force", "mesh.te", "pinion.gear.y", "wheel.gear.x", "wheel.gear.y"):
        assert np.abs(both[name] - one[name]).max() < SAME * np.abs(one[name]).max(), name
    opposite = both["wheel2.gear.x"] + one["wheel.gear.x"]
    assert np.abs(opposite).max() < SAME * np.abs(one["wheel.gear.x"]).max()


def test_a_given_torque_is_met_as_well_after_many_turns() -> None:
    """All teeth of the train are where they were after z2 z4 turns of the input. Seen by it: the tolerance of an island
    in parts of the largest gap of all its rows, among them the angle of the port where a torque is given."""
    spec = load_stage("two_stage")
    stage, bodies = with_ports(spec, TORQUE_OUT), spec.by_name(load_bodies(spec))
    teeth = {name: body.teeth for name, body in stage.bodies.items() if isinstance(body, GearBody)}
    back = 2 * math.pi * teeth["wheel1"] * teeth["wheel2"]
    one, other = (run(stage, bodies, {"input.phi": 3e-3 + phi, "output.tau": 400.0}) for phi in (0.0, back))
    for name in ("stage1.force", "stage2.force"):
        assert np.abs(other[name] - one[name]).max() < SAME * np.abs(one[name]).max(), name
