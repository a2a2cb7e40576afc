"""The stages the scenes run on: variants of the shipped FZG pair, assembled once a process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from evidence.stability.case import STEPS, Case
from gearfmu.body import ReducedBody, load_bodies
from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.spec.stage import StageSpec, load_stage
from gearfmu.spec.tables.flanks import DeviationClass, Eccentricity, ProfileSpec, Wobble
from gearfmu.spec.tables.lead import LeadSpec
from gearfmu.spec.tables.ports import PortSpec
from gearfmu.stage import StageModel, assemble, loaded_te

RELIEVED, PLAIN = "fzg_c/stage_relief", "fzg_c"
SHAFTS = ("pinion", "wheel")
POSITIONS = 16
PROBE = 1e-3  # s


DEVIATIONS: dict[str, Any] = {  # of both gears, each its own draw; a coarse gear
    "deviations": DeviationClass.model_validate({"class": 9, "seed": 1}),
    "profile": ProfileSpec(slope=5e-6, crowning=5e-6),
    "lead": LeadSpec(slope=10e-6, crowning=8e-6),
    "eccentricity": Eccentricity(amount=40e-6, angle=0.5),
    "wobble": Wobble(amount=2e-4),
}


@lru_cache(maxsize=1)
def _bodies() -> list[ReducedBody]:
    return load_bodies(load_stage(PLAIN))


@dataclass(frozen=True)
class Variant:
    """A shipped stage with changes. bearing: stiffness of both bearings, N/m. pitch_error: index deviation of the
    pinion's tooth 0, m. deviating: every kind of deviation at once, DEVIATIONS. ports: of pinion and wheel; None keeps
    those of the stage."""

    stage: str = RELIEVED
    bearing: float | None = None
    pitch_error: float = 0.0
    deviating: bool = False
    ports: tuple[PortSpec, PortSpec] | None = None


@lru_cache(maxsize=8)
def model(variant: Variant) -> StageModel:
    """The assembled stage of a variant."""
    return assemble(_spec(variant), _bodies())


def _spec(variant: Variant) -> StageSpec:
    spec = load_stage(variant.stage)
    gears = []
    for gear in spec.gears:
        changes: dict[str, Any] = {}
        if variant.bearing is not None:
            changes["bearing"] = gear.bearing.model_copy(update={"stiffness": variant.bearing})
        if variant.pitch_error and gear is spec.gears[0]:
            changes["index_deviation"] = {0: variant.pitch_error}
        gears.append(gear.model_copy(update=changes | (DEVIATIONS if variant.deviating else {})))
    ports = spec.ports if variant.ports is None else dict(zip(SHAFTS, variant.ports, strict=True))
    return spec.model_copy(update={"gears": tuple(gears), "ports": ports})


def kernel(stage: StageModel, case: Case, parameters: Mapping[str, float] | None = None) -> Kernel:
    """A fresh instance at the case's level and step."""
    return _instance(stage.blob, case.level, internal_step(stage, case, parameters), dict(parameters or {}))


def internal_step(stage: StageModel, case: Case, parameters: Mapping[str, float] | None = None) -> float:
    """The internal step to ask the kernel for, s; 0 where its default is wanted."""
    if case.h or case.step == "default":
        return case.h
    return _default_step(stage.blob, case.level, tuple(sorted((parameters or {}).items()))) / STEPS[case.step]


@lru_cache(maxsize=32)
def _default_step(blob: bytes, level: str, parameters: tuple[tuple[str, float], ...]) -> float:
    """The step that the kernel takes by itself, s: of 1 ms at rest, a whole number of steps, so up to 1 % below it."""
    probe = _instance(blob, level, 0.0, {name: value for name, value in parameters if not name.endswith("w_start")})
    probe.initialize(0.0)
    probe.step(0.0, PROBE)
    return probe.get("solver.h")


def _instance(blob: bytes, level: str, h: float, parameters: Mapping[str, float]) -> Kernel:
    made = Kernel(blob, parameters)
    made.set("level", made.variables["level"].items.index(level))
    made.set("h", h)
    return made


@lru_cache(maxsize=64)
def mean_te(variant: Variant, torque: float) -> float:
    """Quasi-static transmission error under a torque on the pinion, mean over a pitch, m."""
    return float(np.mean(loaded_te(model(variant), [torque], POSITIONS).te)) if torque else 0.0


def geometry(variant: Variant) -> PairGeometry:
    """Geometry of the variant's pair."""
    return PairGeometry.of(model(variant).spec)
