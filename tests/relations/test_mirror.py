"""R3: a mirrored stage gives mirrored results.

Mirrored at the plane y = 0, all gears have the other hand, drive and coast flanks change places, torque and speed turn
round; at z = 0 gears have the other hand and everything leans the other way. Friction, deviations of flanks and pitch,
runout, wobble and misalignment are on. The axes are at distances without backlash: backlash is taken off the coast
flanks alone, so that it has no image.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from kinds import COARSE, KINDS, Kind, are_same, assembled, bodies_of, drawn, held_as
from moved import renamed, run, start_of
from scipy.optimize import brentq

from gearfmu.body.toothed import reduced_gear
from gearfmu.stage import StageModel, Steady
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.general import Stage, ToothedBody
from gearfmu.stagefile.forms.shapes import MeshShape, mesh_shape
from gearfmu.stagefile.tables.bodies import DeviationClass, Eccentricity, LeadSpec, Wobble
from gearfmu.stagefile.tables.connections import FrictionSpec, Misalignment

FEW = COARSE.model_copy(update={"modes": 40})
SAME = 5e-3  # tables of coast flanks are read where they touch at the nominal distance: up to 2e-3 at this load
LIGHT = 0.3  # of the torque
ACROSS = "y"  # mirrored at y = 0: senses of rotation turn round
ALONG = "z"
# channels whose sign changes, by their last part without "_mean"
TURNED = {
    ACROSS: {"phi", "w", "tau", "tau_next", "te", "force", "slice", "y", "rx", "rz", "fy", "mx", "mz"},
    ALONG: {"z", "rx", "ry", "fz", "mx", "my"},
}


def fitting(stage: Stage, kind: Stage) -> Stage:
    """The stage with its axes at the distances that give the teeth twice their kind's backlash, none where several
    meshes share a gear or a shaft: there it would part the flanks that touch in the image. A set has none as it is."""
    rotors, lone = dict(stage.rotors), len(stage.engagements) == 1
    for mesh, plain in zip(stage.engagements, kind.engagements, strict=True) if not stage.carriers else ():
        shape, (a, b) = mesh_shape(stage, mesh), map(stage.rotor_of, mesh.gears)
        near, far = (np.array(stage.rotors[name].axis) for name in (a, b))

        def left(a: float, shape: MeshShape = shape, asked: float = 2 * lone * plain.backlash) -> float:
            return dataclasses.replace(shape, a=a).nominal_backlash - asked

        distance = brentq(left, shape.a - 3e-4, shape.a + 3e-4, xtol=1e-16)
        place = np.array(rotors[a].axis) + (far - near) * distance / shape.a
        rotors[b] = rotors[b].model_copy(update={"axis": tuple(place.tolist())})
    stage = stage.model_copy(update={"rotors": rotors})
    meshes = tuple(
        mesh.model_copy(update={"backlash": mesh_shape(stage, mesh).nominal_backlash}) for mesh in stage.engagements
    )
    return stage.model_copy(update={"engagements": meshes})


def rich(stage: Stage) -> Stage:
    """With friction and everything that is not the same in a mirror."""

    def gear(number: int, body: ToothedBody) -> ToothedBody:
        update: dict[str, Any] = {"eccentricity": Eccentricity(amount=6e-6, angle=0.5 + number)}
        if not stage.carriers:
            update["deviations"] = DeviationClass(tolerance_class=7, seed=3)
        if not stage.planar:
            update |= {"wobble": Wobble(amount=1e-4, angle=2.0 - number), "lead": LeadSpec(slope=4e-6, crowning=3e-6)}
        return body.model_copy(update=update)

    bodies = {
        name: gear(i, body) if isinstance(body, ToothedBody) else body
        for i, (name, body) in enumerate(stage.bodies.items())
    }
    update: dict[str, Any] = {"friction": FrictionSpec(coefficient=0.08)}
    if not stage.planar:
        update["misalignment"] = Misalignment(out_of_plane=8e-6, in_plane=-5e-6, span=0.1)
    meshes = tuple(mesh.model_copy(update=update) for mesh in stage.engagements)
    return stage.model_copy(update={"bodies": bodies, "engagements": meshes})


def image(stage: Stage, name: str, plane: str) -> str:
    """The body or rotor where the image of one is: of a planet the one that stands there, so that bolts stay bolts."""
    if plane == ALONG or name not in stage.rotors or stage.rotors[name].carried_by is None:
        return name
    x, y = stage.rotors[name].axis
    return min(
        (other for other in stage.rotors if other.startswith(name[:4])),
        key=lambda other: np.hypot(stage.rotors[other].axis[0] - x, stage.rotors[other].axis[1] + y),
    )


def mirrored(stage: Stage, plane: str) -> Stage:
    """The image of a stage, but for deviations by tooth: `mirrored_flanks`."""
    across = plane == ACROSS

    def angle(old: Any, reverse: bool) -> Any:
        return old and old.model_copy(update={"angle": -old.angle if across else old.angle + np.pi * reverse})

    def gear(body: ToothedBody) -> ToothedBody:
        update = {
            "helix_angle": -body.helix_angle,
            "eccentricity": angle(body.eccentricity, False),
            "wobble": angle(body.wobble, True),
            "lead": body.lead and body.lead.model_copy(update={"slope": -body.lead.slope}),
        }
        return body.model_copy(update=update)

    def mesh(old: Any) -> Any:
        skew = old.misalignment
        if skew is not None:
            skew = skew.model_copy(
                update={"out_of_plane": -skew.out_of_plane, "in_plane": skew.in_plane if across else -skew.in_plane}
            )
        return old.model_copy(update={"misalignment": skew})

    def flipped(vector: tuple[float, float]) -> tuple[float, float]:
        return (vector[0], -vector[1]) if across else vector

    bodies, rotors = {}, {}
    for name, body in stage.bodies.items():
        own = stage.bodies[image(stage, name, plane)]
        bodies[name] = gear(own).model_copy(update={"name": name}) if isinstance(own, ToothedBody) else body
    for name, rotor in stage.rotors.items():
        own = stage.rotors[image(stage, name, plane)]
        axis = rotor.axis if rotor.carried_by else flipped(rotor.axis)
        places = rotor.bodies if across else {body: -z for body, z in rotor.bodies.items()}
        rotors[name] = rotor.model_copy(update={"axis": axis, "offset": flipped(own.offset), "bodies": places})
    supports = tuple(
        support if across or support.at is None else support.model_copy(update={"at": -support.at})
        for support in held_as(stage, lambda body: image(stage, body, plane))
    )
    meshes = tuple(map(mesh, stage.engagements))
    return stage.model_copy(update={"bodies": bodies, "rotors": rotors, "supports": supports, "engagements": meshes})


def mirrored_flanks(model: StageModel, of: StageModel, plane: str, behind: Mapping[str, int]) -> StageModel:
    """A mirrored model with the images of another's deviations by tooth, flank and place across the width."""
    own, found = read_blob(of.blob), {}
    for i, gear in enumerate(model.stage.gears):
        if f"index{i}" in own:
            index = np.reshape(own[f"index{i}"], (2, gear.teeth))
            if plane == ACROSS:
                index = -np.roll(index[::-1, ::-1], 1, axis=1)
            found[f"index{i}"] = np.roll(index, behind[gear.name], axis=1)
        if f"flank{i}" in own:
            teeth, places, rolls = np.asarray(own[f"flank_size{i}"]).tolist()
            depth = np.reshape(own[f"flank{i}"], (teeth, 2, places, rolls))
            depth = np.roll(depth[::-1, ::-1], 1, axis=0) if plane == ACROSS else depth[:, :, ::-1]
            found[f"flank{i}"] = np.roll(depth, behind[gear.name], axis=0)
    return dataclasses.replace(model, blob=write_blob(dict(read_blob(model.blob)) | found))


def reflected(channels: Mapping[str, np.ndarray], plane: str) -> dict[str, np.ndarray]:
    """Channels of the image as the stage itself would have them."""
    out = {}
    for name, values in channels.items():
        head, _, last = name.rpartition(".")
        last = last.removesuffix("_mean")
        sign = -1.0 if last in TURNED[plane] else 1.0
        out[name] = sign * values
        if plane == ACROSS and last in ("force_drive", "force_coast"):
            other = {"force_drive": "force_coast", "force_coast": "force_drive"}[last]
            out[name] = channels[f"{head}.{other}"]
        if plane == ALONG and last == "slice":
            mesh, _, number = head.rpartition(".")
            count = sum(other.startswith(f"{mesh}.") and other.endswith(".slice") for other in channels)
            out[name] = channels[f"{mesh}.{count + 1 - int(number)}.slice"]
    return out


@cache
def coarse(file: str, gear: str, hand: int) -> Any:
    """A gear of a stage, coarsely reduced here, or its image (hand −1)."""
    stage = next(kind.stage for kind in KINDS.values() if kind.file == file)
    body = stage.bodies[gear]
    assert isinstance(body, ToothedBody)
    body = body.model_copy(update={"body": FEW, "helix_angle": hand * body.helix_angle})
    return reduced_gear(body)


def bodies(kind: Kind, hand: int) -> dict[str, Any]:
    """Reduced bodies of a kind or its image: helical gears are coarse."""
    known = dict(bodies_of(kind.file))
    for name, body in kind.stage.bodies.items():
        if isinstance(body, ToothedBody) and body.helix_angle:
            known[name] = coarse(kind.file, name, hand)
    return known


def as_coarse(stage: Stage) -> Stage:
    own = {
        name: body.model_copy(update={"body": FEW}) if isinstance(body, ToothedBody) and body.helix_angle else body
        for name, body in stage.bodies.items()
    }
    return stage.model_copy(update={"bodies": own})


def pair_of(kind: Kind, plane: str) -> tuple[StageModel, StageModel, float, dict[str, float]]:
    """A kind and its image, where the input of the image starts (rad), and by rotor what the gears turn beside that
    until the other flanks touch."""
    plain = next(other.stage for other in KINDS.values() if other.file == kind.file)
    stage = rich(fitting(as_coarse(kind.stage), plain))
    model = assembled(stage, bodies(kind, 1))
    other, sense = mirrored(stage, plane), -1.0 if plane == ACROSS else 1.0
    places = {image(stage, name, plane): sense * place for name, place in tooth_phases(stage).items()}
    second, play = stage.gears[-1], 0.0
    if len(stage.engagements) == 1:
        play = math.remainder(places[second.name] - tooth_phases(other)[second.name], 2 * math.pi / second.teeth)
        places[second.name] -= play
    start, behind = start_of(other, places)
    there = mirrored_flanks(assembled(renamed(other, behind), bodies(kind, -1)), model, plane, behind)
    return model, there, start, {stage.rotor_of(second.name): play}


def check(kind: Kind, plane: str) -> None:
    kind = dataclasses.replace(kind, duration=10 * kind.step)
    model, there, start, play = pair_of(kind, plane)
    steady = Steady(model.driven_by_springs(), kind.speed, LIGHT * kind.torque)
    expected = run(kind, model, steady)
    found = reflected(run(kind, there, steady, start, -1.0 if plane == ACROSS else 1.0, play), plane)
    found["mesh.te"] = found["mesh.te"] - np.mean(found["mesh.te"] - expected["mesh.te"])  # the play
    are_same(expected, found, SAME, "in the image")


def check_statics(kind: Kind) -> None:
    """Transmission errors and forces of all meshes."""
    model, there, start, _ = pair_of(kind, ACROSS)
    stage, driven = model.stage, model.shafts
    names = [mesh.name for mesh in stage.engagements]
    for position in (0.3, 0.8):
        place = place_of(model, names[0])
        found = []
        for sense, own, at in ((1.0, model, 0.0), (-1.0, there, start / driven.ratio)):
            kernel = statics_of(own)
            states = [
                kernel.transmission(
                    at - sense * position * place.pitch, sense * LIGHT * kind.torque, mesh, keep=mesh > 0
                )
                for mesh in range(len(names))
            ]
            found.append([[sense * s.te, sum(map(sum, s.forces.values()))] for s in states])
        expected, got = np.array(found[0]), np.array(found[1])
        order = [image_of_mesh(stage, number) for number in range(len(names))]
        apart = np.abs(got[order] - expected).max(axis=0) / np.abs(expected).max(axis=0)
        assert apart.max() < SAME, f"{got[order]} for {expected}"


def image_of_mesh(stage: Stage, number: int) -> int:
    """The engagement where the image of one is."""
    gears = {image(stage, name, ACROSS) for name in stage.engagements[number].gears}
    return next(i for i, mesh in enumerate(stage.engagements) if set(mesh.gears) == gears)


@pytest.mark.parametrize("name", ["pair", "helical", "internal"])
def test_the_image_across(name: str) -> None:
    """Sees what is right on drive flanks or for one sense of rotation only."""
    check(KINDS[name], ACROSS)


def test_the_image_along_the_axes() -> None:
    """Sees what is right for one hand, or on one side of mid-width, only."""
    check(KINDS["helical"], ALONG)


@pytest.mark.full
@pytest.mark.parametrize("name", ["train", "set"])
def test_the_image_across_of_several_meshes(name: str) -> None:
    """Statics: without play both flanks of a mesh are near, and steps are too short for a test."""
    check_statics(KINDS[name])


@pytest.mark.full
@pytest.mark.parametrize("seed", range(20))
def test_the_image_of_a_drawn_stage(seed: int) -> None:
    """Sets without pitch errors: `mirrored_flanks` does not let planets change places."""
    kind = drawn(seed)
    if len(kind.stage.engagements) == 1:
        check(kind, ACROSS)
    else:
        check_statics(drawn(seed, even=bool(kind.stage.carriers)))
