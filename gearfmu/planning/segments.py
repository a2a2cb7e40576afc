"""The parts of a scene that are planned by themselves.

A scene with a settling time is steady: one part. Any other is run once by the pilot (level fast, all effects), and cut
where a clutch locks or slips, where teeth begin or cease to part, and where the speed has changed by a third. Parts
shorter than SHORTEST join the one before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.scene_run import coupled_run, drive_of
from gearfmu.planning.request import Request
from gearfmu.planning.trials import Window, pilot_choice
from gearfmu.planning.windows import LONGEST, first_window, whole_periods
from gearfmu.report.signals import LOCKED, spans
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel, Trace
from gearfmu.stage.run.limits import largest_torque

BIN = 5e-3  # s: contact is looked at in bins
SHORTEST = 20e-3  # s
SPEED_STEP = 1.35  # by which the input's speed may change within a part
LOOKED_AT = 60e-3  # s of a transient part at most


@dataclass(frozen=True)
class Part:
    """name; start, end: s; kind: "loaded" (steady) or "transient"; window: of the trials; longest: that it may become,
    s; speed: of the input, rad/s."""

    name: str
    start: float
    end: float
    kind: str
    window: Window
    longest: float
    speed: float


def parts(scene: SceneSpec, model: StageModel, request: Request) -> Iterator[Part]:
    """The parts in order of time."""
    torque = 0.5 * largest_torque(model)
    if scene.settle > 0.0:
        speed = scene.start.pinion_speed
        length, settle = first_window(model, request, speed, torque)
        window = Window(max(scene.settle, settle), whole_periods(scene, model, length), settle)
        yield Part("steady", 0.0, scene.duration, "loaded", window, LONGEST, speed)
        return
    trace = _pilot_run(scene, model)
    edges = cuts(trace, model)
    for number, (start, end) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        speed = float(np.mean(np.abs(_speed(trace, model)[(trace.time >= start) & (trace.time <= end)])))
        length, settle = first_window(model, request, speed, torque)
        room = end - start
        settle = min(settle, 0.4 * room)
        longest = room - settle
        length = min(whole_periods(scene, model, max(length, min(LOOKED_AT, room))), longest)
        window = Window(start + settle, length, settle)  # in the part, after settling where it is long enough
        yield Part(f"part {number + 1}", start, end, "transient", window, longest, speed)


def _pilot_run(scene: SceneSpec, model: StageModel) -> Trace:
    """The whole scene by the pilot, recorded as far as cuts need it."""
    meshes = tuple(f"{mesh.name}.open_time" for mesh in model.stage.engagements)
    names = (*meshes, *(v.name for v in model.kernel_variables() if v.name.endswith((LOCKED, ".gear.w"))))
    clutches = tuple(f"drive.{name}{LOCKED}" for name in drive_of(scene, model.stage).watched)
    record = {"record": (*names, *clutches)}
    run = coupled_run(pilot_choice(scene).of(scene.model_copy(update=record)), Source(model))
    run.go()
    return run.recorder.trace({})


def cuts(trace: Trace, model: StageModel) -> list[float]:
    """Times (s) of the edges of all parts, start and end of the trace among them."""
    found = [*_clutch_cuts(trace), *_contact_cuts(trace), *_speed_cuts(trace, model)]
    start, end = float(trace.time[0]), float(trace.time[-1])
    kept = [start]
    for time in sorted(found):
        if time - kept[-1] >= SHORTEST and end - time >= SHORTEST:
            kept.append(time)
    return [*kept, end]


def _clutch_cuts(trace: Trace) -> Iterator[float]:
    for name in trace.channels:
        if name.endswith(LOCKED):
            yield from trace.time[1:][np.diff(trace[name].astype(int)) != 0].tolist()


def _contact_cuts(trace: Trace) -> Iterator[float]:
    """Edges of the spans in which teeth part."""
    lost = np.zeros(trace.time.size, dtype=bool)
    width = max(1, round(BIN / (trace.time[1] - trace.time[0])))
    for name in trace.channels:
        if name.endswith(".open_time"):
            parting = np.concatenate([[0.0], np.diff(trace[name])]) > 0.0
            lost |= np.convolve(parting, np.ones(width), mode="same") > 0
    for start, end in spans(trace.time, lost):
        yield start
        yield end


def _speed_cuts(trace: Trace, model: StageModel) -> Iterator[float]:
    speed = np.abs(_speed(trace, model))
    least, last = 0.05 * float(speed.max()), 0
    for k in range(speed.size):
        low, high = sorted((max(speed[last], least), max(speed[k], least)))
        if high > SPEED_STEP * low:
            yield float(trace.time[k])
            last = k


def _speed(trace: Trace, model: StageModel) -> np.ndarray:
    """Of the rotor of the input, rad/s."""
    stage = model.stage
    values: np.ndarray = trace[f"{stage.rotor_of(stage.ports[model.shafts.input].body)}.gear.w"]
    return values
