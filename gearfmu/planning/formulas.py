"""Expected error of each effect left out, before anything is run: relative errors in the band.

They choose where the search begins, and are listed beside the measured errors; only trial runs decide. An effect
without a formula in `FORMULAS` is solved for quasi-statically: transmission error over a pitch with and without it,
relative to its alternating part.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.errors import GearfmuError
from gearfmu.planning.choice import MODES, SLICED, STEP, Choice, Knob
from gearfmu.planning.request import Request
from gearfmu.planning.trials import Trial
from gearfmu.stage import StageModel
from gearfmu.stage.assembly.blob import read_blob
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import loaded_te

POSITIONS = 16
DECIBEL = 20.0 / math.log(10.0)  # of a small relative error
CERTAIN = 0.1  # of the budget: below it a formula leaves an effect out
UNKNOWN = float("nan")


@dataclass(frozen=True)
class Conditions:
    """Arguments of the formulas: the stage, the request, mean force of the first mesh (N), speed of the input and of a
    carrier (rad/s, 0 without one), mesh frequency (Hz), the full run."""

    model: StageModel
    request: Request
    force: float
    speed: float
    mesh_frequency: float
    full: Trial

    @property
    def torque(self) -> float:
        """On the input, N·m: that of the mean force."""
        return abs(self.force * place_of(self.model, None).lever)

    def budgets(self, relative: float) -> float:
        """A relative error in budgets."""
        request = self.request
        level = DECIBEL * relative / request.level if request.level else 0.0
        return max(level, relative / request.waveform if request.waveform else 0.0)


def predicted(knob: Knob, choice: Choice, known: Conditions) -> float:
    """Error in budgets of the choice against `full`, of this knob alone; NaN where no formula says it."""
    if knob.name == STEP:
        return known.budgets(_step(choice.h, known))
    if knob.name == MODES:
        return known.budgets(_modes(choice.level, known))
    if knob.effect is None:
        return UNKNOWN
    if knob.name in FORMULAS:
        return known.budgets(FORMULAS[knob.name](known))
    settings = {"slices": float(choice.slices)} if knob.name == SLICED else dict(knob.effect.off_setting)
    return known.budgets(_quasi_static(settings, known))


def _step(h: float, known: Conditions) -> float:
    """(ω h)²/12 of the highest frequency of the band: of a trapezoidal rule, an upper bound for dg4."""
    return (2 * math.pi * known.request.band[1] * h) ** 2 / 12


def _modes(level: str, known: Conditions) -> float:
    """(f/f₁)² of the highest frequency of the band and the first mode that is quasi-static: what its inertia would
    add."""
    sections = {name: v for name, v in read_blob(known.model.blob).items() if isinstance(v, np.ndarray)}
    cuts = dict(zip(LEVELS[:3], [1.0, *map(float, sections["limits"][:2])], strict=True))
    if level not in cuts:
        return 0.0
    modes = [v.ravel() / (2 * math.pi) for name, v in sections.items() if re.fullmatch(r"omega\d+", name)]
    above = [float(f[f >= cuts[level]].min()) for f in modes if np.any(f >= cuts[level])]
    return (known.request.band[1] / min(above)) ** 2 if above else 0.0


def _coast_flank(known: Conditions) -> float:
    """None while the smallest force on the drive flanks is well above zero, else all."""
    return 0.0 if known.full.drive > 0.1 and not known.full.loses_contact else 1.0


def _coriolis(known: Conditions) -> float:
    """2 Ω/ω at the mesh frequency: Coriolis against inertia forces of what a carrier carries."""
    return abs(known.speed) / (math.pi * max(known.mesh_frequency, 1e-9))


def _centrifugal(known: Conditions) -> float:
    """m a Ω² of a planet over the force of a mesh."""
    stage = known.model.stage
    if not stage.carriers:
        return UNKNOWN
    places = [(math.hypot(*stage.rotors[stage.rotor_of(gear.name)].axis), gear) for gear in stage.gears]
    distance, planet = max(places, key=lambda place: place[0])
    radius = 0.25 * planet.teeth * planet.normal_module
    mass = 7800.0 * math.pi * radius**2 * planet.face_width  # of a disc of steel: an order of magnitude
    return mass * distance * known.speed**2 / max(abs(known.force), 1e-9)


def _gyroscopic(known: Conditions) -> float:
    """Ω/ω at the mesh frequency: moments of a turning disc against those of its inertia."""
    return abs(known.speed) / (2 * math.pi * max(known.mesh_frequency, 1e-9))


FORMULAS: dict[str, Callable[[Conditions], float]] = {
    "coast_flank": _coast_flank,
    "coriolis": _coriolis,
    "centrifugal": _centrifugal,
    "gyroscopic": _gyroscopic,
}


def _quasi_static(settings: dict[str, float], known: Conditions) -> float:
    """rms of the change of the transmission error over a pitch, its mean left out, over its own alternating part."""
    own: dict[str, Any] = {"slices": float(known.full.choice.slices)}
    try:
        on, off = (loaded_te(known.model, [known.torque], POSITIONS, **(own | more)).te[0] for more in ({}, settings))
    except GearfmuError:
        return UNKNOWN
    return float(np.std(off - on) / max(float(np.std(on)), 1e-15))
