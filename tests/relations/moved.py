"""Runs of a stage that stands elsewhere, turned or mirrored: where it starts, and its channels seen from there."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from kinds import Kind, at_level, channels

from gearfmu.stage import StageModel, Steady
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stage.run.simulate import simulate
from gearfmu.stagefile.forms.general import Stage, ToothedBody
from gearfmu.stagefile.forms.turning import turns
from gearfmu.stagefile.tables.bodies import Eccentricity, Wobble

WHOLE = 1e-6  # of a pitch
Vector = tuple[float, float]


def turned_vector(vector: Vector, angle: float) -> Vector:
    """A vector (x, y) turned by an angle (rad)."""
    c, s = math.cos(angle), math.sin(angle)
    return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]


def speeds(stage: Stage) -> dict[str, float]:
    """Speeds of all rotors per speed of the input."""
    return {name: float(speed) for name, speed in turns(stage, next(iter(stage.ports))).items()}


def start_of(stage: Stage, places: Mapping[str, float]) -> tuple[float, dict[str, int]]:
    """Angle (rad) of the input from which the teeth of a stage stand at `places`: angles (rad) of tooth 0 by gear, up
    to whole pitches, to none where that can be; and by gear how many pitches tooth 0 is behind its place."""
    first = stage.engagements[0].gears[0]
    phases, speed = tooth_phases(stage), speeds(stage)
    pitches = {gear.name: 2 * math.pi / gear.teeth for gear in stage.gears}

    def behind(start: float) -> dict[str, float]:
        return {
            name: math.remainder(place - phases[name] - start * speed[stage.rotor_of(name)], 2 * math.pi)
            / pitches[name]
            for name, place in places.items()
        }

    fitting = []
    for n in range(1000):
        start = (places[first] - phases[first] + n * pitches[first]) / speed[stage.rotor_of(first)]
        off = behind(start)
        if all(abs(number - round(number)) < WHOLE for number in off.values()):
            fitting.append((start, {name: round(number) for name, number in off.items()}))
    return next((found for found in fitting if not any(found[1].values())), fitting[0])


def renamed(stage: Stage, behind: Mapping[str, int]) -> Stage:
    """The stage whose deviations by tooth are where they would be if tooth 0 stood `behind` pitches farther on."""
    bodies = dict(stage.bodies)
    for name, number in behind.items():
        gear = bodies[name]
        assert isinstance(gear, ToothedBody)
        angle = 2 * math.pi * number / gear.teeth
        update: dict[str, object] = {
            "index_deviation": {(tooth + number) % gear.teeth: value for tooth, value in gear.index_deviation.items()}
        }
        for field in ("eccentricity", "wobble"):
            old: Eccentricity | Wobble | None = getattr(gear, field)
            if old is not None:
                update[field] = old.model_copy(update={"angle": old.angle + angle})
        bodies[name] = gear.model_copy(update=update)
    return stage.model_copy(update={"bodies": bodies})


def run(
    kind: Kind,
    model: StageModel,
    steady: Steady,
    start: float = 0.0,
    sense: float = 1.0,
    play: Mapping[str, float] = MappingProxyType({}),
) -> dict[str, np.ndarray]:
    """Channels of `kind.duration` from `start` (rad) of the input, rotors ahead of that by their `play` (rad), driven
    as `steady` drives: forwards, or backwards where `sense` is −1. Angles (gear.phi) count from there."""
    driven = model.driven_by_springs()
    places = {name: start * speed + play.get(name, 0.0) for name, speed in speeds(model.stage).items()}
    ahead = {name: places[model.stage.rotor_of(port.body)] for name, port in driven.stage.ports.items()}

    def inputs(time: float) -> dict[str, float]:
        values = {name: sense * value for name, value in steady(time).items()}
        return {name: value + ahead[name[:-4]] if name.endswith(".phi") else value for name, value in values.items()}

    found = channels(simulate(driven, inputs, kind.duration, kind.step, at_level(driven)))
    del found["energy.residual"]  # a small difference of energies that are compared themselves
    for rotor, place in places.items():
        if f"{rotor}.gear.phi" in found:
            found[f"{rotor}.gear.phi"] = found[f"{rotor}.gear.phi"] - place
    return {_of_family(name): values for name, values in found.items()}


def _of_family(name: str) -> str:
    """Names whose last part is common to what is judged together: slices of a mesh, energies."""
    head, dot, last = name.rpartition(".")
    if head == "energy":
        return f"{last}.energy"
    return f"{head}.{last[6:]}.slice" if last.startswith("slice_") else name


def each_vector(found: Mapping[str, np.ndarray], change: Callable[[str, np.ndarray, np.ndarray], tuple]) -> dict:
    """Channels with `change` of every vector: its kind ("" of motion, "r" of rotations, "f", "m"), its x and y."""
    out = dict(found)
    for name in found:
        head, dot, last = name.rpartition(".")
        kind, axis, mean = last[:-1], last[-1:], ""
        if last.endswith("_mean"):
            kind, axis, mean = last[:-6], last[-6:-5], "_mean"
        if axis == "x" and kind in ("", "r", "f", "m") and (other := f"{head}{dot}{kind}y{mean}") in found:
            out[name], out[other] = change(kind, found[name], found[other])
    return out
