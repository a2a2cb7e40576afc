"""Pairs that nothing connects are two models; engagements that act on each other within a step belong to one island,
whatever couples them, and an island is solved as well after any number of turns."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

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
Place = tuple[float, float]


def doubled(stage: Stage, named: Callable[[str], str], placed: Callable[[Place], Place]) -> Stage:
    """A stage on the ground and another like it, whose names `named` gives and whose axes (x, y), m, `placed`."""
    bodies = {named(n): body.model_copy(update={"name": named(n)}) for n, body in stage.bodies.items()}
    rotors = {
        named(n): rotor.model_copy(
            update={"axis": placed(rotor.axis), "bodies": {named(body): at for body, at in rotor.bodies.items()}}
        )
        for n, rotor in stage.rotors.items()
    }
    meshes = tuple(
        mesh.model_copy(update={"name": named(mesh.name), "gears": tuple(map(named, mesh.gears))})
        for mesh in stage.engagements
    )
    supports = tuple(s.model_copy(update={"name": named(s.name), "body": named(s.body)}) for s in stage.supports)
    ports = {named(n): port.model_copy(update={"body": named(port.body)}) for n, port in stage.ports.items()}
    return stage.model_copy(
        update={
            "bodies": stage.bodies | bodies,
            "rotors": stage.rotors | rotors,
            "engagements": stage.engagements + meshes,
            "supports": stage.supports + supports,
            "ports": stage.ports | ports,
        }
    )


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


Inputs = Callable[[float], dict[str, float]]


def run(stage: Stage, bodies: dict[str, Any], inputs: Inputs) -> dict[str, np.ndarray]:
    """A run at level fast."""
    model = assemble(stage, [bodies[name] for name in stage.files])
    trace = simulate(model, inputs, DURATION, H, {"level": FAST})
    return {name: channel.values for name, channel in trace.channels.items()}


def with_ports(stage: Stage, kinds: dict[str, str]) -> Stage:
    changed = {
        name: port.model_copy(update={"kind": kinds[name], "k": 1e5 if kinds[name] == "spring" else None, "c": None})
        for name, port in stage.ports.items()
    }
    return stage.model_copy(update={"ports": changed})


def turning(prefix: str, twist: float, speed: float) -> Inputs:
    """Of a pair whose names have a prefix: shaft ends wound up by a twist (rad) turn at a speed (rad/s)."""

    def inputs(time: float) -> dict[str, float]:
        ends = {"pinion": (twist, speed), "wheel": (0.0, -speed * 16 / 24)}
        of_all = {name: {"phi": start + w * time, "w": w} for name, (start, w) in ends.items()}
        return {f"{prefix}{name}.{what}": value for name, of in of_all.items() for what, value in of.items()}

    return inputs


def test_two_pairs_in_one_model_run_as_two_models_do(pair: tuple[Stage, dict[str, Any]]) -> None:
    """Pairs that nothing connects do not know of each other, at different loads and speeds: the same bits as each alone
    at its place."""
    stage, bodies = with_ports(pair[0], dict.fromkeys(pair[0].ports, "spring")), pair[1]
    both = doubled(stage, lambda name: f"b_{name}", lambda axis: (axis[0], 1.0))
    there = {n: rotor.model_copy(update={"axis": (rotor.axis[0], 1.0)}) for n, rotor in stage.rotors.items()}
    first, second = turning("", 3e-3, 200.0), turning("b_", 1e-3, 90.0)
    named = bodies | {f"b_{name}": body for name, body in bodies.items()}
    together = run(both, named, lambda time: first(time) | second(time))
    apart = run(stage.model_copy(update={"rotors": there}), bodies, turning("", 1e-3, 90.0))
    for prefix, alone in (("", run(stage, bodies, first)), ("b_", apart)):
        for name in alone:
            if name.startswith(("energy.", "solver.")):
                continue
            head, _, rest = name.partition(".")
            found = together[f"bearing.{prefix}{rest}" if head == "bearing" else prefix + name]
            assert np.array_equal(found, alone[name]), name
        assert np.ptp(alone["mesh.force"]) > 1e-3 * alone["mesh.force"].mean()


def test_a_bearing_between_two_rotors_couples_their_meshes(pair: tuple[Stage, dict[str, Any]]) -> None:
    """What acts on the wheel's image is opposite, so that the bearing between them acts as one of twice its stiffness
    on the ground. Seen by it: islands by rotors alone, which leave the wheels' common oscillators out of a step."""
    stage, bodies = pair
    spring = with_ports(stage, dict.fromkeys(stage.ports, "spring"))
    alone = tuple(held(s, 2 * BETWEEN if s.body == "wheel" else 0.0) for s in spring.supports)
    one = run(spring.model_copy(update={"supports": alone}), bodies, lambda _: {"pinion.phi": 3e-3})
    named = bodies | {f"{name}2": body for name, body in bodies.items()}
    both = run(opposed(spring), named, lambda _: {"pinion.phi": 3e-3, "pinion2.phi": 3e-3})
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
    one, other = (
        run(stage, bodies, lambda _, phi=phi: {"input.phi": 3e-3 + phi, "output.tau": 400.0}) for phi in (0.0, back)
    )
    for name in ("stage1.force", "stage2.force"):
        assert np.abs(other[name] - one[name]).max() < SAME * np.abs(one[name]).max(), name
