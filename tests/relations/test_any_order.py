"""R1, order: a stage is what its tables say, in whatever order they say it. Supports, bodies, rotors, engagements and
ports are shuffled, and the gears of external engagements exchanged; every channel stays, by name.

Results may differ by rounding alone: sums run in another order, and equal eigenvalues of the ground oscillators get
other eigenvectors. Which engagement is first stays where a gear has several, and so do its gears: the first gear of all
has its tooth 0 on +x at φ = 0, so that another first one is another stage. External engagements stay before those of a
ring: which one places a gear counts the whole pitches to its tooth 0, which carries its runout.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from kinds import (
    HOUSED,
    KINDS,
    Change,
    Drawn,
    Kind,
    are_same,
    at_level,
    channels,
    drawn,
    even,
    every,
    family,
    loaded,
    some,
)

from gearfmu.errors import SimulationError
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stage.run.simulate import simulate
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.general import EngagementSpec, Stage, ToothedBody

# tolerances, of a channel's family
ALONE = 1e-8  # one engagement: found up to 2e-10
DRAWN = 5e-6  # one engagement with pitch errors and runout: found up to 4e-7
COUPLED = 5e-4  # several, which are solved in turns to 1e-7 of their gaps: found up to 1.3e-4, the tilt of spur gears
DASHPOTS = 2e-3  # accelerations of a housing, whose dashpots a step takes one after the other
OTHER_TEETH = 3e-6  # rows in single precision, turned by other teeth: found up to 5e-7
SHORT = 2e-4  # s


def shuffled(values: Mapping[str, Any] | tuple[Any, ...], seed: int) -> Any:
    """The same entries in a drawn order, the last one first at least."""
    order = np.random.default_rng(seed).permutation(len(values))
    if len(order) > 1 and np.array_equal(order, np.arange(len(order))):
        order = order[::-1]
    if isinstance(values, tuple):
        return tuple(values[i] for i in order)
    entries = list(values.items())
    return dict(entries[i] for i in order)


def engagements(stage: Stage) -> Stage:
    """Shuffled; where gears have several, internal ones stay behind the external ones, and the first stays first."""
    if not shares_gears(stage):
        return stage.model_copy(update={"engagements": shuffled(stage.engagements, 6)})
    external = tuple(mesh for mesh in stage.engagements if not stage.internal(mesh))
    internal = tuple(mesh for mesh in stage.engagements if stage.internal(mesh))
    meshes = (external[0], *shuffled(external[1:], 6), *shuffled(internal, 7))
    return stage.model_copy(update={"engagements": meshes})


def gears(stage: Stage) -> Stage:
    """First and second gear of every external engagement exchanged, the first engagement's not."""
    meshes = (mesh if stage.internal(mesh) else exchanged(stage, mesh) for mesh in stage.engagements[1:])
    return stage.model_copy(update={"engagements": (stage.engagements[0], *meshes)})


def exchanged(stage: Stage, mesh: EngagementSpec) -> EngagementSpec:
    """The engagement with its gears exchanged: torque and speed are those of the other gear then."""
    ratio = teeth(stage, mesh.gears[1]) / teeth(stage, mesh.gears[0])
    limits = {"torque_max": mesh.torque_max * ratio, "speed_max": mesh.speed_max / ratio}
    return mesh.model_copy(update=limits | {"gears": mesh.gears[::-1]})


def shares_gears(stage: Stage) -> bool:
    names = [name for mesh in stage.engagements for name in mesh.gears]
    return len(names) > len(set(names))


def everything(stage: Stage) -> Stage:
    """All of it; of a set the gears too, where its teeth are alike."""
    rotors = {
        name: rotor.model_copy(update={"bodies": shuffled(rotor.bodies, 3)}) for name, rotor in stage.rotors.items()
    }
    tables = {
        "supports": shuffled(stage.supports, 1),
        "bodies": shuffled(stage.bodies, 2),
        "rotors": shuffled(rotors, 4),
        "ports": shuffled(stage.ports, 5),
    }
    other = engagements(stage.model_copy(update=tables))
    return gears(other) if stage.carriers and even(stage).bodies == stage.bodies else other


@cache
def run(kind: Kind, change: Change | None = None, shift: float = 0.0, **parameters: float) -> dict[str, np.ndarray]:
    """A short run, driven as the unchanged stage is: the order of the ports says which one is the input. shift: s."""
    model, inputs = kind.model(change).driven_by_springs(), loaded(kind)
    trace = simulate(model, lambda time: inputs(time + shift), SHORT, kind.step, at_level(model, **parameters))
    assert trace.meta["outcome"] == "completed"
    return channels(trace)


def compare(
    kind: Kind, one: dict[str, np.ndarray], other: dict[str, np.ndarray], tolerance: float | None = None
) -> None:
    """Energies are judged by what passed through the stage."""
    alone = DRAWN if isinstance(kind, Drawn) else ALONE
    tolerance = tolerance or (alone if len(kind.stage.engagements) == 1 else COUPLED)
    energies = {"energy.work", "energy.dissipated", "energy.residual"}
    are_same(*({name: of[name] for name in of if name not in energies} for of in (one, other)), tolerance)
    for name in energies:
        assert np.abs(one[name] - other[name]).max() < tolerance * kind.torque * kind.speed * SHORT, name


@pytest.mark.parametrize("kind", every(full=["helical_set"]))
def test_the_order_of_the_tables_does_not_matter(kind: Kind) -> None:
    """Seen by it: a bearing that carries the damper of another one; an engagement that takes a port's rows for its
    own; a first gear of a set that its second has placed, at the wrong phase."""
    compare(kind, run(kind), run(kind, everything))


@pytest.mark.full
def test_the_order_of_the_tables_of_a_housed_stage_does_not_matter() -> None:
    one, other = run(HOUSED), run(HOUSED, everything)
    felt = {name for name in one if name.startswith("sensor.")}
    compare(HOUSED, *({name: of[name] for name in of if name not in felt} for of in (one, other)))
    are_same({name: one[name] for name in felt}, {name: other[name] for name in felt}, DASHPOTS)


@pytest.mark.parametrize("effect", ["friction", "film"])
@pytest.mark.parametrize("kind", some(["helical"], ["train", "set", "helical_set"]))  # engagements share gears
def test_the_order_of_the_tables_does_not_matter_to_lubricated_flanks(kind: Kind, effect: str) -> None:
    on = {f"effect.{effect}": 1.0}
    compare(kind, run(kind, **on), run(kind, everything, **on))


@pytest.mark.full
@pytest.mark.parametrize("seed", [4, 5, 10, 11, 16, 17])
def test_the_gears_of_a_mesh_of_a_drawn_set_may_be_named_in_either_order(seed: int) -> None:
    """Toothing without errors of single teeth: those belong to a tooth's number, and rolling from the first gear of all
    counts whole pitches another way."""
    kind = drawn(seed)
    compare(kind, run(kind, even), run(kind, lambda stage: gears(even(stage))))


@pytest.mark.parametrize("kind", some(["pair", "helical"]))
def test_a_pair_may_be_named_by_its_wheel_first(kind: Kind) -> None:
    """The wheel's tooth 0 is on +x then: the same motion begins at another time. Not for a train: each of its meshes
    would begin at its own."""
    pinion = kind.stage.engagements[0].gears[0]
    one = run(kind)
    begins = math.remainder(tooth_phases(wheel_first(kind.stage))[pinion], 2 * math.pi / teeth(kind.stage, pinion))
    other = dict(run(kind, wheel_first, -begins / kind.speed))
    for channel in [name for name in one if family(name) == "phi"]:
        other[channel] = other[channel] + one[channel][0] - other[channel][0]
    compare(kind, one, other, OTHER_TEETH)


def wheel_first(stage: Stage) -> Stage:
    return stage.model_copy(update={"engagements": (exchanged(stage, stage.engagements[0]),)})


def teeth(stage: Stage, name: str) -> int:
    body = stage.bodies[name]
    assert isinstance(body, ToothedBody)
    return body.teeth


# ---- at rest: one equilibrium, whichever engagement is looked at -----------------------------------------------------
@pytest.mark.parametrize("kind", some(["pair", "internal", "train", "set"]))
def test_an_equilibrium_is_seen_at_every_engagement_without_another_search(kind: Kind) -> None:
    """A search ends within 1e-11 m, a part in 1e6 of what flanks approach by."""
    kernel = statics_of(kind.model())
    for mesh in range(len(kind.stage.engagements)):
        sought = kernel.transmission(-0.01, kind.torque, mesh)
        assert kernel.transmission_at(mesh) == sought
        kernel.transmission(-0.01, kind.torque, 0)
        seen = kernel.transmission_at(mesh)
        assert (seen.te, seen.output_te) == pytest.approx((sought.te, sought.output_te), rel=1e-6)
        assert [*seen.forces] == [*sought.forces]
        forces = [np.array([*state.forces.values()]) for state in (seen, sought)]
        assert np.abs(forces[0] - forces[1]).max() < 1e-5 * forces[1].max()


def test_after_a_step_there_is_no_equilibrium_to_see() -> None:
    model = KINDS["pair"].model().driven_by_springs()
    kernel = model.kernel(level=1.0)
    kernel.initialize()
    kernel.step(0.0, 1e-5)
    with pytest.raises(SimulationError, match="not allowed now"):
        kernel.transmission_at(0)
