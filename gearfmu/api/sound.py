"""A housing under a finished run, and the sound power of a housing's skin."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gearfmu.api.models import PathLike, assemble, load, reduce
from gearfmu.api.results import stage_and_bodies, trace_file
from gearfmu.api.settings import Quantity, checked
from gearfmu.body.body import Body
from gearfmu.body.body import Skin as BodySkin
from gearfmu.modes.housed import Housed, housed
from gearfmu.modes.housing import Placed, placed_housing
from gearfmu.modes.rings import stage_rings
from gearfmu.sound import Radiation, Skin, SoundError, SoundPower, power_of, radiation, segments, skin_of
from gearfmu.sound.store import load_radiation, save_radiation
from gearfmu.spec.forms.general import Stage
from gearfmu.stage.build.observed import MODE, MOTION
from gearfmu.stage.run.housing import HousingAlone
from gearfmu.stage.run.trace import Channel, Trace

HIGHEST = 10e3  # Hz, of the housing's motion; less where the run's step does not resolve it
MOTIONS, UNITS = ("x", "y", "z", "rx", "ry", "rz"), ("m", "m", "m", "rad", "rad", "rad")


def house(trace: Trace | PathLike, housing: PathLike | Stage, torque: Quantity | None = None) -> Trace:
    """A housing under a finished run on rigid ground: its motion, the forces on its seats and mounts, accelerations.

    trace : of the run, or its file or folder. housing : a stage with the same bearings in a housing, as
    "two_stage/stage_housed"; any number of them under one run. torque : on the input, that of the run when None.

    The trace has `bearing.*` (on seats that yield), `mount.*`, `sensor.*` and the motion of the housing, all without
    their means; theory 11 says what it leaves out. Raises SoundError for a run that lost contact or has a housing;
    ModelError for other bearings.
    """
    run = _trace(trace)
    own, _ = stage_and_bodies(run.meta)
    _require_contact(run, own)
    stage = load(housing) if isinstance(housing, (str, os.PathLike)) else housing
    given = run.meta.get("torque") if torque is None else checked("torque", torque, "torque")
    if given is None:
        raise SoundError("the run does not say its torque: give the torque on the input")
    speeds = {name: float(run[f"{name}.gear.w"].mean()) for name in own.rotors if f"{name}.gear.w" in run}
    rings = stage_rings(assemble(own), float(given), speeds)
    placed = placed_housing(stage, reduce(stage), rings.names)
    found = housed(rings, placed.housing, *_forces(run, rings.names))
    turning = {name: c for name, c in run.channels.items() if name.endswith((".gear.phi", ".gear.w"))}
    said = {"stage": stage.name, "stage_path": str(stage.source), "housed": own.name}
    return Trace(run.time, turning | _channels(found, placed, run), run.meta | said)


def sound_power(
    trace: Trace | PathLike,
    housing: PathLike | Stage | None = None,
    matrix: PathLike | None = None,
    patches: int = 1000,
    speed: str | None = None,
) -> SoundPower:
    """Sound power that the housing of a run radiates into free air, over frequency, in W; beside it equivalent radiated
    power (ERP). `total()`, `total_a()`, `third_octaves()` give levels and bands.

    trace : a run of a housed stage, or a trace of `house`. housing : its stage, that which the trace names when None.
    matrix : file of the radiation matrix, made when it is not there and kept, and made anew for another housing.
    patches : of the boundary elements; their edge is to be a sixth of a wave's length, above that power is ERP.
    speed : name of a channel for a waterfall, as "input.gear.w": one spectrum a segment; their mean when None.

    Raises SoundError for a stage without a skin and a record without equal steps.
    """
    run = _trace(trace)
    stage = load(housing) if isinstance(housing, (str, os.PathLike)) else housing or stage_and_bodies(run.meta)[0]
    bodies = reduce(stage)
    body, own = _skinned(stage, bodies)
    known = _recorded(run, body)
    coordinates = HousingAlone.of(stage, bodies).motion(run).velocity if known is None else known
    count = coordinates.shape[1]
    skin = skin_of(own.points, own.faces, own.skin_modes[:, :, :count])
    sound = _matrix(skin, patches, matrix, f"{body.how.hash} {count}")
    pieces = segments(run.time, coordinates, moved=known is not None)
    steady = speed is None
    turning = None if speed is None else np.interp(pieces.middle, run.time, run[speed])
    return power_of(pieces, sound, turning, steady)


def _trace(trace: Trace | PathLike) -> Trace:
    return trace if isinstance(trace, Trace) else Trace.load(trace_file(trace))


def _require_contact(run: Trace, stage: Stage) -> None:
    """SoundError where the run is not the linear one that a housing can be put under."""
    if stage.housings:
        raise SoundError(f"the housing of {stage.name} was in the run: its sensors and mounts are in the trace")
    settled = run.window(float(run.meta.get("settle") or 0.0))
    for mesh in stage.engagements:
        name = f"{mesh.name}.contact"
        if name in settled and np.ptp(settled[name]):
            raise SoundError(
                f"{mesh.name} lost contact or changed flanks in the run, so it is not linear: run it housed"
            )


def _forces(run: Trace, names: tuple[str, ...]) -> tuple[np.ndarray, float, float]:
    """Bearing forces (T, s), step, highest frequency. SoundError where they were not recorded."""
    if missing := [name for name in names if name not in run]:
        raise SoundError(f"the run did not record {', '.join(missing)}: record bearing.* at every communication step")
    step = float(run.time[-1] - run.time[0]) / (len(run.time) - 1)
    return np.stack([run[name] for name in names], axis=1), step, min(HIGHEST, 0.4 / step)


def _channels(found: Housed, placed: Placed, run: Trace) -> dict[str, Channel]:
    """Channels of a housed run."""
    channels = {}
    for i, name in enumerate(placed.seats):
        said = "force on the seat, which yields, less its mean"
        channels[name] = Channel(found.force[:, i], run.channels[name].unit, said)
    for i, name in enumerate(placed.feet):
        unit = "N" if name.split(".")[-1][0] == "f" else "N.m"
        channels[name] = Channel(found.mount[:, i], unit, "force of a foot on the ground, less its mean")
    for i, name in enumerate(placed.sensors):
        channels[name] = Channel(found.sensor[:, i], "m/s2", "acceleration of a sensor")
    root = math.sqrt(placed.housing.mass[0, 0])
    for i, values in enumerate(found.coordinates.T):
        if i < 6:
            channels[f"{placed.name}{MOTION}{MOTIONS[i]}"] = Channel(values, UNITS[i], "rigid motion of the housing")
        else:
            said = "root-mean-square displacement of the housing, by mass, in one mode"
            channels[f"{placed.name}{MODE}{i - 5}"] = Channel(values / root, "m", said)
    return channels


def _skinned(stage: Stage, bodies: Sequence[Body]) -> tuple[Body, BodySkin]:
    """The reduced housing of a stage and its skin. SoundError where it has none, or no skin."""
    if not stage.housings:
        raise SoundError(f"stage {stage.name} has no housing: name one, or put it under the run with `gearfmu house`")
    body = stage.by_name(bodies)[stage.housings[0].name]
    if body.skin is None:
        raise SoundError(f"the housing of {stage.name} has no skin: name its outer surface in [import], skin = …")
    return body, body.skin


def _recorded(run: Trace, body: Body) -> np.ndarray | None:
    """(T, 6 + n): motion of the housing, where a trace of `house` has it."""
    rigid = [f"{body.name}{MOTION}{own}" for own in MOTIONS]
    modes = [name for i in range(body.modes) if (name := f"{body.name}{MODE}{i + 1}") in run]
    if not all(name in run for name in rigid):
        return None
    moved, root = [run[name] for name in rigid], math.sqrt(body.total_mass)
    return np.stack([*moved, *(root * run[name] for name in modes)], axis=1)


def _matrix(skin: Skin, patches: int, matrix: PathLike | None, made_of: str) -> Radiation:
    """The radiation matrix of a file where it is of this skin, else made, and kept in the file."""
    key = f"{made_of} {patches}"
    if matrix is not None and Path(matrix).exists():
        found, known = load_radiation(matrix)
        if known == key:
            return found
    found = radiation(skin, count=patches)
    if matrix is not None:
        save_radiation(found, matrix, key)
    return found
