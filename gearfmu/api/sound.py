"""A housing under a finished run, transfer paths to its sensors, and the sound power of its skin."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from gearfmu.api.models import PathLike, assemble, changed_folder, loaded_stage, reduce
from gearfmu.api.results import loaded_trace, stage_and_bodies
from gearfmu.api.settings import Quantity, checked
from gearfmu.body import Body, body_path
from gearfmu.body.sound import kept_radiation, make_radiation, sound_path
from gearfmu.modes.housed import Housed, housed
from gearfmu.modes.housing import Placed, placed_housing
from gearfmu.modes.paths import TransferPaths, paths_of
from gearfmu.modes.rings import stage_rings
from gearfmu.sound import Radiation, SoundError, SoundPower
from gearfmu.stage.assembly.groups import MOTIONS
from gearfmu.stage.assembly.observed import MODE, MOTION
from gearfmu.stage.run.housing import Heard, housing_body, radiated_power
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.forms.general import Stage

HIGHEST = 10e3  # Hz, of the housing's motion; less where the run's step does not resolve it
UNITS = ("m", "m", "m", "rad", "rad", "rad")


def house(trace: Trace | PathLike, housing: PathLike | Stage, torque: Quantity | None = None) -> Trace:
    """A housing under a finished run on rigid ground: its motion, the forces on its seats and mounts, accelerations.

    trace : of the run, or its file or folder. housing : a stage with the same bearings in a housing, as
    "two_stage/stage_housed"; any number of them under one run. torque : on the input, that of the run when None.

    The trace has `bearing.*` (on seats that yield), `mount.*`, `sensor.*` and the motion of the housing, all without
    their means; theory 11 says what it leaves out. Raises SoundError for a run that lost contact or has a housing;
    ModelError for other bearings.
    """
    run = loaded_trace(trace)
    own, _ = stage_and_bodies(run.meta)
    _require_contact(run, own)
    stage = loaded_stage(housing)
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
    patches: int | None = None,
    speed: str | None = None,
    start: Quantity = 0.0,
) -> SoundPower:
    """Sound power that the housing of a run radiates into free air, over frequency, in W; beside it equivalent radiated
    power (ERP). `total()`, `total_a()`, `third_octaves()` give levels and bands.

    trace : a run of a housed stage, or a trace of `house`. housing : its stage, that which the trace names when None.
    matrix : file of the radiation matrix; when None that beside the body, which the reduction makes. Made anew and kept
    where it is missing, of another housing or of other patches.
    patches : boundary elements, 1000 when made; where their edge is over a sixth of a wave's length, power is ERP.
    speed : name of a channel for a waterfall, as "input.gear.w": one spectrum a segment; their mean when None.
    start : time from which sound counts; what the housing did before it is known still.

    Raises SoundError for a stage without a skin and a record without equal steps.
    """
    run = loaded_trace(trace)
    stage, bodies = _housed(run, housing)
    sound = _radiation(stage, housing_body(stage, bodies), matrix, patches)
    return radiated_power(run, stage, bodies, sound, Heard(speed, checked("start", start, "time")))


def transfer_paths(
    trace: Trace | PathLike, sensor: str, housing: PathLike | Stage | None = None, start: Quantity = 0.0
) -> TransferPaths:
    """What every direction of a bearing contributes to the acceleration of a sensor: `share()`, `rms()`, of a third
    octave or of all; the shares of a third octave sum to 1.

    trace, housing : as in `sound_power`. sensor : a direction of a sensor, "top.ay". start : time from which it counts.

    Raises SoundError for an unknown sensor and a record without equal steps.
    """
    run = loaded_trace(trace)
    return paths_of(run, *_housed(run, housing), sensor, checked("start", start, "time"))


def _housed(run: Trace, housing: PathLike | Stage | None) -> tuple[Stage, list[Body]]:
    """The stage of a housing, that which the trace names when None, and its bodies."""
    stage = stage_and_bodies(run.meta)[0] if housing is None else loaded_stage(housing)
    return stage, reduce(stage)


def _radiation(stage: Stage, body: Body, matrix: PathLike | None, patches: int | None) -> Radiation:
    """The radiation matrix of a housing, made and kept where there is none of so many patches."""
    own = sound_path(body_path(stage, body.name, changed_folder(stage)))
    path = own if matrix is None else Path(matrix)
    found = kept_radiation(body, path, patches)
    return found or make_radiation(body, path if os.access(path.parent, os.W_OK) else None, patches)


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
