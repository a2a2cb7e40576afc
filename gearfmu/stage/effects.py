"""The effects that a scene may call for: one table, effects.toml. docs/effects.md, `gearfmu effects` and the tests are
made from it.

What an effect costs is measured (evidence/price/effects_cost.py) and lies beside this file in effects_cost.csv.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.reading.base import read_toml

COSTS = "effects_cost.csv"


@dataclass(frozen=True)
class Effect:
    """One effect. title: in words; formula and equation: what it computes, and where docs/theory.md derives it.

    matters: when a scene needs it; off: what the model is without it; code: where it enters the kernel; switch: how to
    turn it off; off_setting: the kernel's parameters that do so, empty where the data of the stage decide; test: the
    test by hand calculation; carried: a planetary set has it, a spur pair does not; of_data: its parameter is there
    where the stage file gives it something to do; kept: why a plan (gearfmu/planning) never leaves it out, "" where the
    error budget decides. -DGK_WITHOUT=<name> builds a kernel that has no code for it.
    """

    name: str
    title: str
    formula: str
    equation: str
    matters: str
    off: str
    code: str
    switch: str
    test: str
    off_setting: Mapping[str, float]
    carried: bool = False
    of_data: bool = False
    kept: str = ""


@dataclass(frozen=True)
class Neglected:
    """A term of the floating frame that is left out: what it is, its size as a formula, why it may be left out."""

    name: str
    formula: str
    why: str


@dataclass(frozen=True)
class Cost:
    """Instructions of an internal step: effect on, off, and in a build without its code (nan: no such build)."""

    effect: str
    on: float
    off: float
    without: float

    @property
    def share(self) -> float:
        """What the effect costs, as part of the step with it."""
        return 1.0 - self.off / self.on

    @property
    def price_of_off(self) -> float:
        """What a step pays for the effect being there and off: off / without − 1."""
        return self.off / self.without - 1.0


DISSIPATION = "it dissipates: no short window shows slow growth without it"


def _effect(name: str, told: dict[str, Any]) -> Effect:
    """The effect that a table of effects.toml tells of; what it leaves out is that of an effect with a boolean
    parameter of its own, effect.<name>."""
    variable, dissipates = f"effect.{name}", told.pop("dissipates", False)
    usual = {
        "switch": f"variable `{variable}`; in a scene `[stage.effects] {name} = false`; `--set {variable}=false`",
        "off_setting": {variable: 0.0},
        "test": f"tests/stage/test_effects.py::test_{name}",
        "kept": DISSIPATION if dissipates else "",
    }
    return Effect(**usual | told, name=name)


_TABLES = read_toml(Path(__file__).with_name("effects.toml"))
NEGLECTED = tuple(Neglected(**term) for term in _TABLES.pop("neglected"))
EFFECTS = tuple(_effect(*entry) for entry in _TABLES.items())


def costs() -> dict[str, Cost]:
    """Measured costs by name of the effect."""
    text = Path(__file__).with_name(COSTS).read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return {r["effect"]: Cost(r["effect"], float(r["on"]), float(r["off"]), float(r["without"])) for r in rows}


def torque_on_flanks_alone(model: StageModel, mesh: str | None = None, positions: int = 24) -> float:
    """Largest input torque (N·m, at most what brings the engagement to its torque_max) at which the flanks of an
    engagement, the first when None, carry alone at these positions of its pitch, statically: up to it tip corners may
    be off. To 1 %."""
    place = place_of(model, mesh)
    kernels = [statics_of(model, **{"effect.tip_contact": on}) for on in (1.0, 0.0)]

    def alone(torque: float) -> bool:
        for i in range(positions):
            at = -place.pitch * i / positions
            on, off = (abs(kernel.transmission(at, torque, place.number).te) for kernel in kernels)
            if off - on > 1e-6 * on:
                return False
        return True

    low, high = 0.0, place.most
    if alone(high):
        return high
    while high - low > 0.01 * high and high > 1e-3 * place.most:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if alone(middle) else (low, middle)
    return low
