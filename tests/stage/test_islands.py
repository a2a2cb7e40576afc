"""Engagements that act on each other within a step belong to one island, whatever couples them, and an island is solved
as well after any number of turns."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gearfmu.body import load_bodies
from gearfmu.spec.forms.expand import as_general, spread
from gearfmu.spec.forms.general import Stage, SupportSpec
from gearfmu.spec.forms.members import body_names
from gearfmu.spec.stage import load_stage
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.run.simulate import simulate

H, DURATION = 20e-6, 4e-4
BETWEEN = 1e9  # N/m
FAST = 1.0


@pytest.fixture(scope="module")
def pair() -> tuple[Stage, dict[str, Any]]:
    spec = load_stage("fzg_c/stage_relief")
    return as_general(spec), spread(spec, load_bodies(spec))


def held(support: SupportSpec, extra: float = 0.0) -> SupportSpec:
    """Held against tilting too, with `extra` N/m more and the same dashpot."""
    assert isinstance(support.radial, float)
    radial = support.radial + extra
    ratio = support.damping_ratio * math.sqrt(support.radial / radial)
    return support.model_copy(update={"radial": radial, "axial": 1e9, "tilt": 1e6, "damping_ratio": ratio})


def opposed(stage: Stage) -> Stage:
    """The pair and its image, turned by half a turn about the wheel's axis, with a bearing between both wheels."""
    two = {name: f"{name}2" for name in stage.bodies}
    axis = np.array(stage.rotors["wheel"].axis)
    bodies = {new: stage.bodies[old].model_copy(update={"name": new}) for old, new in two.items()}
    rotors = {
        f"{name}2": rotor.model_copy(
            update={
                "axis": tuple(2 * axis - np.array(rotor.axis)),
                "bodies": {two[body]: place for body, place in rotor.bodies.items()},
            }
        )
        for name, rotor in stage.rotors.items()
    }
    mesh = stage.engagements[0]
    again = mesh.model_copy(update={"name": "mesh2", "gears": tuple(two[name] for name in mesh.gears)})
    supports = [held(support) for support in stage.supports]
    supports += [s.model_copy(update={"name": two[s.name], "body": two[s.body]}) for s in supports]
    between = SupportSpec(name="between", body="wheel", to="wheel2", radial=BETWEEN, damping_ratio=0.0)
    ports = {two[name]: port.model_copy(update={"body": two[port.body]}) for name, port in stage.ports.items()}
    return stage.model_copy(
        update={
            "bodies": stage.bodies | bodies,
            "rotors": stage.rotors | rotors,
            "engagements": (mesh, again),
            "supports": (*supports, between),
            "ports": stage.ports | ports,
        }
    )


def run(stage: Stage, bodies: dict[str, Any], inputs: dict[str, float]) -> dict[str, np.ndarray]:
    model = assemble(stage, [bodies[name] for name in body_names(stage)])
    return {name: channel.values for name, channel in at_rest(model, inputs).channels.items()}


def at_rest(model: StageModel, inputs: dict[str, float]) -> Any:
    """A run that is wound up at the start, with outer ends that stand."""
    return simulate(model, lambda time: inputs, DURATION, H, {"level": FAST})


def test_a_bearing_between_two_rotors_couples_their_meshes(pair: tuple[Stage, dict[str, Any]]) -> None:
    """What acts on the wheel's image is opposite, so that the bearing between them acts as one of twice its stiffness
    on the ground. Seen by it: islands by rotors alone, which leave the wheels' common oscillators out of a step."""
    stage, bodies = pair
    spring = stage.model_copy(
        update={"ports": {n: p.model_copy(update={"kind": "spring", "k": 1e5, "c": 0.0}) for n, p in stage.ports.items()}}
    )
    alone = tuple(held(s, 2 * BETWEEN if s.body == "wheel" else 0.0) for s in spring.supports)
    wound = {"pinion.phi": 3e-3, "pinion.w": 40.0, "wheel.w": -40.0 * 16 / 24}
    one = run(spring.model_copy(update={"supports": alone}), bodies, wound)
    both = run(opposed(spring), bodies | {f"{n}2": b for n, b in bodies.items()}, wound | twice(wound))
    for name in ("mesh.force", "mesh.te", "pinion.gear.y", "wheel.gear.x", "wheel.gear.y"):
        size = np.abs(one[name]).max()
        assert np.abs(both[name] - one[name]).max() < 1e-5 * size, name
    assert np.abs(both["wheel2.gear.x"] + one["wheel.gear.x"]).max() < 1e-5 * np.abs(one["wheel.gear.x"]).max()


def twice(inputs: dict[str, float]) -> dict[str, float]:
    return {name.replace(".", "2.", 1): value for name, value in inputs.items()}
