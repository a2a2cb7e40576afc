"""R2: results do not depend on where a stage stands.

Turned as a whole, a stage has equal forces, speeds and energies, and its vectors turn with it; a deviation on another
planet gives the results of that planet. Teeth that are found by an angle with a branch see a layout across −x.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from kinds import KINDS, Kind, are_same, drawn, held_as
from moved import each_vector, renamed, run, start_of, turned_vector

from gearfmu.stage import Steady
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.general import Stage, ToothedBody
from gearfmu.stagefile.tables.bodies import Eccentricity, Wobble
from gearfmu.stagefile.tables.connections import FrictionSpec, Misalignment

ANGLES = (math.pi, -math.pi, 0.5 * math.pi, -2.0, 0.7)
OFFSETS = ((4e-6, -7e-6), (-3e-6, 5e-6), (2e-6, 6e-6))  # m: of rotors, one after the other
SAME = 1e-5


def whole(stage: Stage, angle: float) -> float:
    """The next angle that brings the teeth of every engagement into mesh where they were. A train's second pinion has
    its tooth 0 on +x, whichever way the first wheel stands on the same rotor: multiples of 2π/((z1 + z2) z3) do."""
    if len(stage.engagements) == 1:
        return angle
    z = [gear.teeth for gear in stage.gears]
    part = 2 * math.pi / ((z[0] + z[1]) * z[2])
    return round(angle / part) * part


def deviating(stage: Stage) -> Stage:
    """With friction, deviations of axes and toothings that do not run true, so that every direction matters."""
    update: dict[str, Any] = {"eccentricity": Eccentricity(amount=8e-6, angle=0.3)}
    if len(stage.engagements) > 1:  # drawn by the number of a tooth, which another start counts from elsewhere
        update["deviations"] = None
    if not stage.planar:
        update["wobble"] = Wobble(amount=1e-4, angle=2.0)
    bodies = {
        name: body.model_copy(update=update) if isinstance(body, ToothedBody) else body
        for name, body in stage.bodies.items()
    }
    rotors = {
        name: rotor.model_copy(update={"offset": offset})
        for (name, rotor), offset in zip(stage.rotors.items(), OFFSETS, strict=False)
    }
    more: dict[str, Any] = {"friction": FrictionSpec(coefficient=0.08)}
    if not stage.planar:
        more["misalignment"] = Misalignment(out_of_plane=8e-6, in_plane=-5e-6, span=0.1)
    # twice the backlash: the default step counts flanks within 50 µm as closed, near φ = 0, wherever that is
    meshes = tuple(mesh.model_copy(update=more | {"backlash": 2 * mesh.backlash}) for mesh in stage.engagements)
    return stage.model_copy(update={"bodies": bodies, "rotors": rotors, "engagements": meshes})


def turned(stage: Stage, angle: float) -> Stage:
    """The whole layout turned about the origin."""
    rotors = {
        name: rotor.model_copy(
            update={"axis": turned_vector(rotor.axis, angle), "offset": turned_vector(rotor.offset, angle)}
        )
        for name, rotor in stage.rotors.items()
    }
    return stage.model_copy(update={"rotors": rotors})


def check_turned(kind: Kind, angles: tuple[float, ...]) -> None:
    stage = deviating(kind.stage)
    kind = dataclasses.replace(kind, duration=(10 if len(stage.engagements) == 1 else 3) * kind.step)
    model = kind.model(lambda _: stage)
    steady = Steady(model.driven_by_springs(), kind.speed, kind.torque)
    expected, places = run(kind, model, steady), tooth_phases(stage)
    for angle in (whole(stage, angle) for angle in angles):
        other = turned(stage, angle)
        start, behind = start_of(other, {name: place + angle for name, place in places.items()})
        other = renamed(other, behind)
        found = run(kind, kind.model(lambda _, moved=other: moved), steady, start)
        found = each_vector(found, lambda _, x, y, angle=angle: turned_vector((x, y), -angle))
        are_same(expected, found, SAME, f"where the layout is turned by {angle:.3g}")


@pytest.mark.parametrize("name", ["pair", "helical", "internal", pytest.param("train", marks=pytest.mark.full)])
def test_a_layout_turned_as_a_whole(name: str) -> None:
    """Sees a tooth that is found across −x, a tilt or an offset that does not turn with the layout."""
    check_turned(KINDS[name], (*ANGLES[:2], ANGLES[-1]) if name == "pair" else ANGLES[-1:])


@pytest.mark.full
@pytest.mark.parametrize("name", ["pair", "helical", "internal", "train"])
def test_a_layout_turned_as_a_whole_by_any_angle(name: str) -> None:
    """A carrier's bolts are in their places by its body: planets change places instead, as below."""
    check_turned(KINDS[name], ANGLES[:-1])


@pytest.mark.full
@pytest.mark.parametrize("seed", range(20))
def test_a_drawn_layout_turned_as_a_whole(seed: int) -> None:
    kind = drawn(seed)
    if not kind.stage.carriers:
        check_turned(kind, ANGLES)
    else:
        check_planets(drawn(seed, even=True), EACH)


# ---- planets ---------------------------------------------------------------------------------------------------------
Change = tuple[str, float]
EACH = tuple((what, sign) for what in ("radial", "tangential", "runout") for sign in (1.0, -1.0))
SIZE = {"radial": 3e-6, "tangential": 0.7e-6, "runout": 5e-6}  # m


def even(stage: Stage) -> Stage:
    """With equal planets, pins and meshes."""
    own = stage.bodies["planet1"]
    backlash = {"sun": stage.engagements[0].backlash, "ring": stage.engagements[-1].backlash}
    bodies = {
        name: own.model_copy(update={"name": name, "deviations": None}) if name.startswith("planet") else body
        for name, body in stage.bodies.items()
    }
    rotors = {name: rotor.model_copy(update={"offset": (0.0, 0.0)}) for name, rotor in stage.rotors.items()}
    supports = held_as(stage, lambda body: "planet1" if body.startswith("planet") else body)
    meshes = tuple(
        mesh.model_copy(update={"backlash": next(backlash[gear] for gear in mesh.gears if gear in backlash)})
        for mesh in stage.engagements
    )
    update = {"bodies": bodies, "rotors": rotors, "supports": supports, "engagements": meshes}
    return stage.model_copy(update=update)


def with_error(stage: Stage, planet: str, change: Change) -> Stage:
    """A set with one planet's pin out of its place, or its toothing beside its axis."""
    what, amount = change[0], change[1] * SIZE[change[0]]
    rotor, gear = stage.rotors[planet], stage.bodies[planet]
    if what == "runout":
        assert isinstance(gear, ToothedBody)
        runout = Eccentricity(amount=abs(amount), angle=0.4 if amount > 0 else 0.4 + math.pi)
        return stage.model_copy(
            update={"bodies": stage.bodies | {planet: gear.model_copy(update={"eccentricity": runout})}}
        )
    vector = (amount, 0.0) if what == "radial" else (0.0, amount)
    offset = turned_vector(vector, math.atan2(rotor.axis[1], rotor.axis[0]))
    return stage.model_copy(update={"rotors": stage.rotors | {planet: rotor.model_copy(update={"offset": offset})}})


def loads(kind: Kind, stage: Stage, angle: float) -> np.ndarray:
    """(2, 2, N): transmission error (m) and force (N) of all meshes at sun and ring where the sun has turned by `angle`
    (rad) in the axes of the carrier."""
    model = kind.model(lambda _: stage)
    kernel, place = statics_of(model), place_of(model, "sun_planet1")
    at = -angle * stage.gears[0].teeth / (2 * math.pi) * place.pitch
    states = [kernel.transmission(at, kind.torque, mesh, keep=mesh > 0) for mesh in range(len(stage.engagements))]
    found = [[state.te for state in states], [sum(map(sum, state.forces.values())) for state in states]]
    return np.reshape(found, (2, 2, -1))


def check_planets(kind: Kind, changes: Sequence[Change], planets: Sequence[int] | None = None) -> None:
    """An error of planet k shows where an error of the first shows once sun and ring have turned to it: forces change
    places with the planets."""
    stage = even(kind.stage)
    for change in changes:
        expected = loads(kind, with_error(stage, "planet1", change), 0.0)
        for k in planets or range(1, expected.shape[2]):
            x, y = stage.rotors[f"planet{k + 1}"].axis
            found = loads(kind, with_error(stage, f"planet{k + 1}", change), math.atan2(y, x))
            apart = np.abs(np.roll(found, -k, axis=2) - expected).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))
            assert apart.max() < SAME, f"{change} of planet {k + 1}: {found} for {expected} of planet 1"


@pytest.mark.parametrize("name", ["set", "helical_set"])
def test_teeth_are_placed_alike_whichever_mesh_is_first(name: str) -> None:
    """Sees a first gear that is placed wrongly by its second: all gears have rolled on by the same part of a pitch."""
    stage = KINDS[name].stage
    places, others = (
        tooth_phases(stage.model_copy(update={"engagements": order}))
        for order in (stage.engagements, stage.engagements[::-1])
    )
    rolled = {
        gear.name: (-1 if gear.name == "sun" else 1) * gear.teeth * (others[gear.name] - places[gear.name])
        for gear in stage.gears
    }
    assert max(abs(math.remainder(angle - rolled["ring"], 2 * math.pi)) for angle in rolled.values()) < 1e-9


def test_an_error_of_another_planet() -> None:
    """Sees a planet across −x whose teeth are counted from the other side: with its pin ahead it carried nothing."""
    check_planets(KINDS["set"], (("tangential", 1.0),), (2,))


@pytest.mark.full
@pytest.mark.parametrize("name", ["set", "helical_set"])
def test_each_error_of_each_planet(name: str) -> None:
    check_planets(KINDS[name], EACH)
