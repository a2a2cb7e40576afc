"""Drawn stages: shipped bodies in a stage file of drawn numbers, under drawn loads, steps, communication steps and
effects. Each runs a few milliseconds and must be finite, balanced in energy, solved in every step and equal after its
state was restored, or be refused by a clear message. What is found here becomes a hard case."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from driven import give

from evidence.stability.checks import at_most, common
from evidence.stability.record import Inputs, Stopped, Watched, run_times
from gearfmu.body import load_bodies
from gearfmu.errors import GearfmuError, SimulationError, SpecError
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stagefile.stage import load_stage

PAIRS, TRAINS, SETS = ("fzg_c/stage_relief", "helical_demo"), ("two_stage",), ("planetary54", "helical_set")
LIMITS = {  # largest torque (N·m) and speed (rad/s) of the input
    "fzg_c/stage_relief": (600.0, 628.0),
    "helical_demo": (200.0, 628.0),
    "two_stage": (300.0, 300.0),
    "planetary54": (600.0, 300.0),
    "helical_set": (600.0, 150.0),
}
ENERGY = 1e-4  # left by the balance
CUT_SHORT = 1e-3  # by pairs whose force ends with their flanks: sets, tip contact off
DURATION = {PAIRS: 10e-3, TRAINS: 4e-3, SETS: 2e-3}  # s
SWITCHES = ("hertz", "coast_flank", "contact_damping", "tip_relief", "tip_contact", "bearings", "modal_damping")
OUTER = {"ports.carrier.kind": "spring", "ports.carrier.k": 5e4, "ports.carrier.c": 10.0}
RESTORED = 20  # communication steps run twice


@dataclass(frozen=True)
class Draw:
    """A stage with changes of its file, a load on its input, parameters of the kernel, communication steps (s)."""

    stage: str
    changes: Mapping[str, Any]
    torque: float
    speed: float
    parameters: Mapping[str, float]
    level: str
    steps: tuple[float, ...]


class Dice(np.random.Generator):
    """What is drawn from one seed."""

    def __init__(self, seed: int) -> None:
        super().__init__(np.random.PCG64(seed))

    def between(self, low: float, high: float) -> float:
        """Evenly, over the logarithm where both ends are positive; four digits."""
        value = np.exp(self.uniform(np.log(low), np.log(high))) if low > 0 else self.uniform(low, high)
        return float(f"{value:.4g}")

    def one(self, *of: Any) -> Any:
        return of[self.integers(len(of))]

    def some(self, of: Sequence[str], most: int) -> list[str]:
        return [of[k] for k in self.permutation(len(of))[: self.integers(most + 1)]]


Field = Callable[[Dice], Mapping[str, Any]]  # fields of a stage file with drawn values


def ranged(key: str, low: float, high: float) -> Field:
    return lambda dice: {key: dice.between(low, high)}


def flanks(gear: str) -> list[Field]:
    """What may be drawn of a gear's flanks."""
    return [
        lambda dice: {
            f"{gear}.deviations.class": dice.one(*range(4, 12)),
            f"{gear}.deviations.seed": dice.one(1, 2, 3),
        },
        ranged(f"{gear}.eccentricity.amount", 0.0, 60e-6),
        ranged(f"{gear}.modal_damping", 2e-3, 0.1),
    ]


def misplaced(dice: Dice) -> Mapping[str, Any]:
    """Two pins of a set out of their places."""
    return {f"set.pin_errors.{k}": (dice.between(-3e-5, 3e-5), dice.between(-3e-5, 3e-5)) for k in (1, 2)}


def fields(stage: str) -> list[Field]:
    """Fields of a stage file that may be drawn."""
    if stage in SETS:
        own = [ranged("planet.bearing.stiffness", 1e7, 1e10), ranged("sun.bearing.stiffness", 1e3, 1e9)]
        return [misplaced, *own, *flanks("sun"), *flanks("planet")]
    found: list[Field] = []
    for gear in load_stage(stage).gears:
        if stage in PAIRS:
            found += flanks(f"gears.{gear.name}")
            found.append(ranged(f"gears.{gear.name}.bearing.stiffness", 1e7, 1e10))
        else:
            found += flanks(f"bodies.{gear.name}")
    for port in load_stage(stage).ports:
        found += [ranged(f"ports.{port}.k", 2e3, 1e6), ranged(f"ports.{port}.c", 0.5, 50.0)]
    return found


def draw(seed: int) -> Draw:
    """The same for every run of the tests."""
    dice = Dice(seed)
    stage = dice.one(*PAIRS, *PAIRS, *TRAINS, *SETS)
    known, (torque, speed) = fields(stage), LIMITS[stage]
    changes: dict[str, Any] = dict(OUTER) if stage in SETS else {}
    for k in dice.permutation(len(known))[: dice.integers(5)]:
        changes |= known[k](dice)
    parameters = {f"effect.{name}": 0.0 for name in dice.some(SWITCHES, 2)} | {"slices": float(dice.one(1, 3, 5, 10))}
    if dice.one(True, False):
        parameters |= {"effect.friction": 1.0, "friction_coefficient": dice.between(0.01, 0.15)}
    if dice.one(True, False):
        parameters |= {"effect.film": 1.0, "oil_viscosity": dice.between(1e-3, 0.2)}
    parameters["h"] = dice.one(0.0, 0.0, 2e-6, 5e-6, 1e-5)
    duration = next(length for stages, length in DURATION.items() if stage in stages)
    steps = list[float]()
    while sum(steps) < duration:
        steps.append(dice.between(2e-6, 5e-4))
    load = torque * dice.uniform(-1.0, 1.0), speed * dice.one(0.0, 1.0, dice.uniform(-1.0, 1.0))
    return Draw(stage, changes, *load, parameters, dice.one("rigid", "fast"), tuple(steps))


def driven(model: StageModel, drawn: Draw) -> tuple[Inputs, dict[str, float]]:
    """Inputs under the drawn load, and the speed at which a shaft without a spring starts."""
    if drawn.stage not in SETS:
        return Steady(model, drawn.speed, drawn.torque), {}
    ratio = model.shafts.ratio

    def inputs(time: float) -> Mapping[str, float]:
        return {"carrier.phi": drawn.speed * time, "carrier.w": drawn.speed, "sun.tau": -drawn.torque * abs(ratio)}

    return inputs, {"sun.w_start": drawn.speed / ratio}


def same_after_restore(kernel: Kernel, inputs: Inputs, start: float, steps: tuple[float, ...]) -> bool:
    """A piece of the run, from its state twice: all outputs are equal to the last bit."""
    state, found = kernel.save(), list[list[float]]()
    names = [v.name for v in kernel.variables.values() if v.causality == "output"]
    for _ in range(2):
        kernel.restore(state)
        time = start
        for step in steps:
            give(kernel, inputs(time))
            kernel.step(time, step)
            time += step
        found.append([kernel.get(name) for name in names])
    return np.array_equal(*found, equal_nan=True)


def complaints(drawn: Draw) -> list[str]:
    """What is wrong with the run of a draw; nothing where it is refused by a clear message."""
    try:
        spec = load_stage(drawn.stage, drawn.changes)
        model = assemble(spec, load_bodies(load_stage(drawn.stage)))
        inputs, start = driven(model, drawn)
        kernel = Kernel(model.blob, drawn.parameters | start)
        kernel.set("level", kernel.variables["level"].items.index(drawn.level))
    except SpecError as refused:
        return [] if all(problem.file and problem.remedy for problem in refused.problems) else [str(refused)]
    except GearfmuError as refused:
        return [] if len(str(refused)) > 20 else [str(refused)]
    times = np.concatenate([[0.0], np.cumsum(drawn.steps)])
    try:
        watched = Watched(tuple(mesh.name for mesh in model.stage.engagements), tuple(model.stage.ports))
        made = run_times(kernel, inputs, times, watched)
    except Stopped as stop:
        return [f"{stop.record.outcome} at {stop.record.time[-1]:.6g} s"]
    except SimulationError as nothing_carries:
        return [] if "effect.coast_flank" in drawn.parameters else [str(nothing_carries)]
    ends = drawn.stage in SETS or "effect.tip_contact" in drawn.parameters
    said = common(made, CUT_SHORT if ends else ENERGY)
    said += at_most("number of steps left unsolved", float(made["solver.retried_steps"][-1]), 0.0)
    if not same_after_restore(kernel, inputs, float(times[-1]), drawn.steps[:RESTORED]):
        said.append("another run from the same state")
    return said


FOUND = dict.fromkeys((49, 56, 74, 75, 95, 131), "energy balance leaves 1e-4 to 4e-4")  # by 200 draws, not cured yet
CYCLED = 92  # a contact stuck, parted, slid and stuck again without end, until what would hold it showed the side


def later(seed: int) -> object:
    """A draw that only `make test-full` takes."""
    known = [pytest.mark.xfail(reason=FOUND[seed], strict=True)] if seed in FOUND else []
    return pytest.param(seed, marks=[pytest.mark.full, *known])


QUICK = (2, 3, 5, 6, 7, 24, CYCLED)  # every kind of stage


@pytest.mark.parametrize("seed", [*QUICK, *(later(seed) for seed in range(200) if seed not in QUICK)])
def test_what_is_drawn_runs_or_is_refused(seed: int) -> None:
    drawn = draw(seed)
    print(drawn)
    assert not complaints(drawn)
