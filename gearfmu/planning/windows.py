"""How long a trial has to look: ten mesh periods, three decay times and some lines of the band; where contact is lost,
whole periods of the torque, widened until the full model agrees with itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from gearfmu.cosim.scene_run import drive_of
from gearfmu.errors import GearfmuError
from gearfmu.modes.linear import linearised
from gearfmu.planning.choice import Choice
from gearfmu.planning.judge import FAILED, error, split_half_noise
from gearfmu.planning.request import Request
from gearfmu.planning.search import Bench
from gearfmu.planning.trials import Task, Trial, Window
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel
from gearfmu.stagefile.forms.turning import meshings, turns

MESH_PERIODS, DECAYS, BAND_PERIODS = 10, 3, 4
FAST = 1.0  # level
MODES = 60  # looked through for the slowest decay in the band
LONGEST_DECAY = 0.02  # s
LONGEST = 0.4  # s of a window
QUIET = 0.5  # noise of the full model, in budgets, that a window may have
SETTLE = (5e-3, 20e-3)  # s, least and most
GROWN, GROWN_LOST = 0.1, 0.5  # of the waveform's budget: what a twin may differ by, without and with loss of contact
WATCHED = 6  # windows in which a waveform with loss of contact has to repeat
SPELL = 16e-3  # s: in every spell of it
MOST_AT_ONCE = 8  # times as long a window may become before it is looked at again


@dataclass(frozen=True)
class Noise:
    """split: difference of the halves of the full model's window, budgets; twin: of the same run disturbed before it
    settles (one communication step at level rigid), its levels in budgets; waveform: of the twin, relative. Where a
    waveform is asked for and contact is lost the twin is the full model at the next larger step, and waveform the
    largest over spells of the window: a disturbance that dies out says nothing about a model that errs all the time. 0
    where it was not looked at."""

    split: float
    twin: float = 0.0
    waveform: float = 0.0


def mesh_frequency(model: StageModel, speed: float) -> float:
    """Of the fastest mesh at a speed (rad/s) of the input, Hz."""
    turning = turns(model.stage, model.shafts.input)
    speeds = {name: speed * float(turning.get(name, Fraction(0))) for name in model.stage.rotors}
    return max(abs(m.relative(speeds)) * m.teeth / (2 * math.pi) for m in meshings(model.stage).values())


def decay_time(model: StageModel, torque: float, band: tuple[float, float]) -> float:
    """The slowest decay time (s) of the stage's modes in the band under `torque` (N·m on the input), at most
    LONGEST_DECAY; 0 where there is none."""
    try:
        kernel = model.kernel(level=FAST)
        kernel.prepare()
        frequency, ratio, *_ = linearised(model, torque, 0.25, kernel).modes(MODES)
    except GearfmuError:
        return LONGEST_DECAY
    inside = (frequency >= band[0]) & (frequency <= band[1])
    if not inside.any():
        return 0.0
    slowest = float(np.max(1.0 / (2 * math.pi * frequency[inside] * np.maximum(ratio[inside], 1e-6))))
    return min(LONGEST_DECAY, slowest)


def first_window(model: StageModel, request: Request, speed: float, torque: float) -> tuple[float, float]:
    """Length of the window (s) of a loaded segment, and how long trials settle before it."""
    meshing = MESH_PERIODS / max(mesh_frequency(model, speed), 1e-9)
    decay = DECAYS * decay_time(model, torque, request.band)
    return max(meshing, decay, BAND_PERIODS / request.band[0]), min(SETTLE[1], max(SETTLE[0], decay))


def whole_periods(scene: SceneSpec, model: StageModel, length: float) -> float:
    """The length (s), rounded up to whole periods of the alternating torques of the scene."""
    frequencies = drive_of(scene, model.stage).frequencies
    if not frequencies:
        return length
    period = 1.0 / min(frequencies)
    return period * math.ceil(length / period - 1e-9)


def quiet_enough(bench: Bench, most: float, steady: bool, looser: Choice) -> tuple[Trial, Window, Noise]:
    """The full model over the window and its noise; the bench keeps the last. In steady running with loss of contact
    the window is widened, up to `most` (s), until its halves agree; for a waveform it is WATCHED times as long at
    least. A twin is run where contact is lost and where a waveform is asked for; looser: the full model at the next
    larger step, which is the twin of a waveform with loss of contact."""
    asked = bench.request
    if steady and bench.full.loses_contact and asked.waveform is not None:
        length = bench.window.length
        bench.widen(replace(bench.window, length=length * max(1, min(WATCHED, most // length))))
    while True:
        full, window = bench.full, bench.window
        lost = full.loses_contact
        split = split_half_noise(full.signals, asked) if steady and lost and asked.level is not None else 0.0
        if not lost and asked.waveform is None:
            return full, window, Noise(split)
        factor = _wider(split, most / window.length)
        if factor == 1:
            return full, window, bench_twin(bench, split, looser if lost and asked.waveform is not None else None)
        bench.widen(replace(window, length=factor * window.length))


def _wider(split: float, room: float) -> int:
    """By how much a window is lengthened: noise falls with its root. A power of two within the room."""
    factor = 1
    while split > QUIET and factor < min(MOST_AT_ONCE, (split / QUIET) ** 2) and 2 * factor <= room * (1 + 1e-9):
        factor *= 2
    return factor


def bench_twin(bench: Bench, split: float, looser: Choice | None) -> Noise:
    """The noise with what a twin of the full run says: the same from a disturbed state, or `looser` where given."""
    if looser is None:
        twin = bench.twin()
    else:
        twin = bench.run(Task(bench.scene, looser, bench.window, bench.request))
    if twin.signals.values.keys() != bench.full.signals.values.keys():
        return Noise(split, FAILED, FAILED)
    levels = replace(bench.request, waveform=None, level=bench.request.level or 1.0)
    shapes = replace(bench.request, waveform=1.0, level=None)
    parts = 1 if looser is None else max(1, round(bench.window.length / SPELL))
    cuts = [(k / parts, (k + 1) / parts) for k in range(parts)]
    far = [error(twin.signals.part(*cut), bench.full.signals.part(*cut), shapes).whole for cut in cuts]
    return Noise(split, error(twin.signals, bench.full.signals, levels).whole, max(far))
