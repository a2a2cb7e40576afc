"""How long a trial has to look: ten mesh periods, three decay times and some lines of the band; where contact is lost,
whole periods of the torque, doubled until the full model agrees with itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from gearfmu.errors import GearfmuError
from gearfmu.modes.linear import linearised
from gearfmu.planning.judge import FAILED, error, split_half_noise
from gearfmu.planning.request import Request
from gearfmu.planning.search import Bench
from gearfmu.planning.trials import Trial, Window
from gearfmu.spec.scene import SceneSpec
from gearfmu.spec.turning import meshings, turns
from gearfmu.stage import StageModel

MESH_PERIODS, DECAYS, BAND_PERIODS = 10, 3, 4
FAST = 1.0  # level
MODES = 60  # looked through for the slowest decay in the band
LONGEST_DECAY = 0.02  # s
LONGEST = 0.4  # s of a window
QUIET = 0.5  # noise of the full model, in budgets, that a window may have
SETTLE = (5e-3, 20e-3)  # s, least and most
GROWN = 0.1  # of the waveform's budget: what a twin may differ by


@dataclass(frozen=True)
class Noise:
    """split: difference of the halves of the full model's window, budgets; twin: of the same run disturbed before it
    settles (one communication step at level rigid), its levels in budgets; waveform: of the twin, relative. 0 where
    it was not looked at."""

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


def whole_periods(scene: SceneSpec, length: float) -> float:
    """The length (s), rounded up to whole periods of the alternating torques of the scene."""
    loads = [*(scene.shaft_loads or {}).values()] + [*(scene.drivetrain.torques.values() if scene.drivetrain else ())]
    frequencies = [load.alternating.frequency for load in loads if load.alternating is not None]
    if not frequencies:
        return length
    period = 1.0 / min(frequencies)
    return period * math.ceil(length / period - 1e-9)


def quiet_enough(bench: Bench, most: float, steady: bool) -> tuple[Trial, Window, Noise]:
    """The full model over the window and its noise; the bench keeps the last. In steady running with loss of contact
    the window is doubled, up to `most` (s), until its halves agree. A twin is run where contact is lost and where a
    waveform is asked for."""
    while True:
        full, window = bench.full, bench.window
        lost = full.loses_contact
        noise = Noise(split_half_noise(full.signals, bench.request) if steady and lost else 0.0)
        if not lost and bench.request.waveform is None:
            return full, window, noise
        if noise.split <= QUIET or 2 * window.length > most * (1 + 1e-9):
            return full, window, bench_twin(bench, noise)
        bench.widen(replace(window, length=2 * window.length))


def bench_twin(bench: Bench, noise: Noise) -> Noise:
    """The noise with what a twin of the full run says."""
    twin = bench.again(twin=True)
    levels = replace(bench.request, waveform=None, level=bench.request.level or 1.0)
    shapes = replace(bench.request, waveform=1.0, level=None)
    if twin.signals.values.keys() != bench.full.signals.values.keys():
        return replace(noise, twin=FAILED, waveform=FAILED)
    found = [error(twin.signals, bench.full.signals, asked).whole for asked in (levels, shapes)]
    return replace(noise, twin=found[0], waveform=found[1])
