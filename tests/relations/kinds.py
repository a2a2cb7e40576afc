"""Stages of every kind for the relations: each in the terms of any stage, with its bodies by name, a load and a speed.

A relation changes the stage (`Kind.model(change)`), runs both (`Kind.run`) and compares channels by name. No stored
numbers. Assembled models and reduced bodies are made once a process.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _pytest.mark.structures import ParameterSet

from gearfmu.body import load_bodies
from gearfmu.body.toothed import reduced_gear
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stage.run.simulate import Inputs, simulate
from gearfmu.stage.run.te import statics_of
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage, ToothedBody
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import BodySpec, DeviationClass, Eccentricity, MeshSpec
from gearfmu.stagefile.tables.connections import SupportSpec

ROOT = Path(__file__).parents[2]
COARSE = BodySpec(
    strip_half_width=4.5e-4,
    modes=100,
    roll_points=8,
    width_functions=3,
    mesh=MeshSpec(flank=4, thickness=1, root=2, rim=2, width=2),
)
Change = Callable[[Stage], Stage]
FULL = pytest.mark.full


@dataclass(frozen=True)
class Kind:
    """A stage with its load: torque (N·m) and speed (rad/s) of its input; step between samples and duration, s."""

    name: str
    file: str
    torque: float
    speed: float
    step: float = 20e-6
    duration: float = 2e-3

    @property
    def stage(self) -> Stage:
        return _stage(self.file)

    def model(self, change: Change | None = None) -> StageModel:
        """The assembled model, of the stage as it is or as `change` returns it."""
        return _model(self.file) if change is None else assembled(change(self.stage), bodies_of(self.file))

    def run(self, model: StageModel, parameters: Mapping[str, float] | None = None, scale: float = 1.0) -> Trace:
        """A few milliseconds under `scale` times the torque, at level fast unless `parameters` say another."""
        driven = model.driven_by_springs()
        inputs = Steady(driven, self.speed, scale * self.torque)
        return simulate(driven, inputs, self.duration, self.step, at_level(driven) | dict(parameters or {}))


KINDS = {
    kind.name: kind
    for kind in (
        Kind("pair", "fzg_c/stage_relief", 302.0, 209.0),
        Kind("helical", "helical_demo", 100.0, 209.0),
        Kind("internal", "internal", 80.0, 150.0),
        Kind("train", "two_stage", 150.0, 150.0),
        Kind("set", "planetary54", 600.0, 85.0, duration=1e-3),
        Kind("helical_set", "helical_set", 300.0, 60.0, duration=1e-3),
    )
}
HOUSED = Kind("housed", "two_stage/stage_housed", 150.0, 150.0)  # for relations that a housing may break


@dataclass(frozen=True)
class Drawn(Kind):
    """A stage of one of the kinds with drawn numbers: supports, backlash, pin errors, runout, pitch errors; `even`:
    without those of the last two."""

    seed: int = 0
    even: bool = False

    @property
    def stage(self) -> Stage:
        stage = _drawn(self.file, self.seed)
        return even(stage) if self.even else stage

    def model(self, change: Change | None = None) -> StageModel:
        """The assembled model, of the stage as drawn or as `change` returns it."""
        return assembled((change or (lambda stage: stage))(self.stage), bodies_of(self.file))


def drawn(seed: int, even: bool = False) -> Drawn:
    """The same stage for every run of the tests."""
    kind = list(KINDS.values())[seed % len(KINDS)]
    return Drawn(f"{kind.name}-{seed}", kind.file, kind.torque, kind.speed, kind.step, kind.duration, seed, even)


def even(stage: Stage) -> Stage:
    """Every tooth of a gear like the others."""
    nominal = {"eccentricity": None, "deviations": None}
    plain = {
        name: body.model_copy(update=nominal) if isinstance(body, ToothedBody) else body
        for name, body in stage.bodies.items()
    }
    return stage.model_copy(update={"bodies": plain})


def held_as(stage: Stage, other: Callable[[str], str]) -> tuple[SupportSpec, ...]:
    """Supports of a stage, each of a carried body with the springs of the body `other`."""
    fields = ("radial", "axial", "tilt", "torsion", "damping_ratio")
    carried = {support.body: support for support in stage.supports if support.to is not None}

    def own(support: SupportSpec) -> SupportSpec:
        if support.to is None or other(support.body) == support.body:
            return support
        return support.model_copy(update={name: getattr(carried[other(support.body)], name) for name in fields})

    return tuple(map(own, stage.supports))


@cache
def _drawn(file: str, seed: int) -> Stage:
    dice = np.random.default_rng(seed)
    stage = _stage(file)

    def times(value: float | str | None) -> float | str | None:
        return value * float(np.exp(dice.uniform(-1, 1))) if isinstance(value, float) else value

    def support(old: SupportSpec) -> SupportSpec:
        stiff = {name: times(getattr(old, name)) for name in ("radial", "axial", "tilt", "torsion")}
        return old.model_copy(update=stiff | {"damping_ratio": float(dice.uniform(0.005, 0.2))})

    def gear(old: ToothedBody) -> ToothedBody:
        runout = Eccentricity(amount=float(dice.uniform(0, 2e-5)), angle=float(dice.uniform(-3, 3)))
        quality = DeviationClass(tolerance_class=int(dice.integers(4, 9)), seed=int(dice.integers(1, 4)))
        return old.model_copy(update={"eccentricity": runout, "deviations": quality})

    bodies = {name: gear(body) if isinstance(body, ToothedBody) else body for name, body in stage.bodies.items()}
    meshes = tuple(
        mesh.model_copy(update={"backlash": mesh.backlash * dice.uniform(0.8, 1.5)}) for mesh in stage.engagements
    )
    rotors = {
        name: rotor.model_copy(update={"offset": tuple(dice.uniform(-1e-5, 1e-5, 2))}) if rotor.carried_by else rotor
        for name, rotor in stage.rotors.items()
    }
    return stage.model_copy(
        update={
            "bodies": bodies,
            "engagements": meshes,
            "rotors": rotors,
            "supports": tuple(map(support, stage.supports)),
        }
    )


@cache
def loaded(kind: Kind, scale: float = 1.0) -> Inputs:
    """Inputs as of `Steady` under `scale` times the torque, wound up for one position and all effects, whatever a run
    has, not for the mean over a pitch: a load at a sixteenth of the cost. No `Wound`, which a run winds up anew."""
    steady = Steady(kind.model().driven_by_springs(), kind.speed, scale * kind.torque)
    winding = statics_of(kind.model()).transmission(0.0, steady.torque).phi
    steady.__dict__["winding"] = float(winding)
    return lambda time: steady(time)


def assembled(stage: Stage, bodies: Mapping[str, Any]) -> StageModel:
    """The model of a stage whose bodies are found by name, in whatever order the stage has them."""
    return assemble(stage, listed(stage, bodies))


def listed(stage: Stage, bodies: Mapping[str, Any]) -> list[Any]:
    """Bodies found by name as `assemble` takes them, one for every file."""
    own = {stage.file_of(name): body for name, body in bodies.items()}
    return [own[name] for name in stage.files]


def level_number(model: StageModel, level: str) -> int:
    """The kernel's number of a fidelity level."""
    variable = next(v for v in model.kernel_variables() if v.name == "level")
    return variable.items.index(level)


def at_level(model: StageModel, level: str = "fast", **parameters: float) -> dict[str, float]:
    """Parameters of a run at a fidelity level."""
    return {"level": float(level_number(model, level))} | parameters


def every(full: Iterable[str] = (), seeds: Iterable[int] = range(20)) -> list[ParameterSet]:
    """A test's parameters: each kind, those named `full` under make test-full, and there the drawn stages too."""
    return some([name for name in KINDS if name not in full], full) + [
        pytest.param(drawn(seed), id=f"drawn-{seed}", marks=FULL) for seed in seeds
    ]


def some(quick: Iterable[str], full: Iterable[str] = ()) -> list[ParameterSet]:
    """A test's parameters: kinds by their names, and those that only make test-full has."""
    fast = set(quick)
    chosen = fast.union(full)
    return [pytest.param(KINDS[name], id=name, marks=[FULL] * (name not in fast)) for name in KINDS if name in chosen]


def channels(trace: Trace) -> dict[str, np.ndarray]:
    """Values of all real channels of a trace, by name."""
    return {name: channel.values for name, channel in trace.channels.items() if channel.values.dtype == float}


def differences(one: Mapping[str, np.ndarray], other: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Largest difference of every channel over the largest value of its family (`family`) in either:
    a bearing without load is judged by the bearings that carry."""
    assert one.keys() == other.keys(), one.keys() ^ other.keys()
    size: dict[str, float] = {}
    for name, values in (*one.items(), *other.items()):
        size[family(name)] = max(size.get(family(name), 0.0), float(np.abs(values).max()))
    return {
        name: float(np.abs(values - other[name]).max()) / (size[family(name)] or 1.0) for name, values in one.items()
    }


def are_same(one: Mapping[str, np.ndarray], other: Mapping[str, np.ndarray], within: float, where: str = "") -> None:
    """Every channel differs by less than a part of the largest value of its family."""
    apart = differences(one, other)
    worst = max(apart, key=apart.__getitem__)
    assert apart[worst] < within, f"{worst} differs by {apart[worst]:.2g} {where}"


def family(name: str) -> str:
    """What a channel is, whosever it is: forces of supports in all directions are one family, and so are moments,
    displacements, tilts and slices."""
    last = name.rpartition(".")[2]
    return re.sub(r"(?<=^[fmr])[xyz]|^[xyz]$|_\d+$", "", last)


@cache
def _stage(file: str) -> Stage:
    if file == "internal":
        spec = load_stage(ROOT / "tests" / "reference" / "internal_pair" / "stage.toml")
        coarse = {name: body.model_copy(update={"body": COARSE}) for name, body in spec.bodies.items()}
        spring = {"kind": "spring", "k": 2e4, "c": 1.0}
        ports = {name: port.model_copy(update=spring) for name, port in spec.ports.items()}
        rotors = {name: rotor.model_copy(update={"stands": False}) for name, rotor in spec.rotors.items()}
        return spec.model_copy(update={"bodies": coarse, "ports": ports, "rotors": rotors})
    return load_stage(file)


@cache
def bodies_of(file: str) -> dict[str, Any]:
    """Reduced bodies of a stage file by the names of its general form."""
    if file == "internal":
        return {gear.name: reduced_gear(gear) for gear in _stage(file).gears}
    spec = load_stage(file)
    return spec.by_name(load_bodies(spec))


@cache
def _model(file: str) -> StageModel:
    return assembled(_stage(file), bodies_of(file))
