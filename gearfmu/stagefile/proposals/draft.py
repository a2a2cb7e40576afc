"""A stage in the making: tables of a stage file, and where each of their values comes from."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from typing import Any

from gearfmu.stagefile.checks.gears import rounded_up
from gearfmu.stagefile.reading.files import find_stage, put_at, read_layers, value_at

LOAD_PER_FACE = 4e6  # Pa, K = F_t/(b d₁)·(u + 1)/u: the order of case-hardened industrial gears
LOAD_RULE = "K = F_t/(b d1) (u + 1)/u = 4 N/mm2 of case-hardened gears"
PITCH_SPEED = 20.0  # m/s at the pitch circle
BACKLASH_PER_MODULE = 0.02
STRIP_PER_MODULE = 0.12
TIP_EDGE_PER_MODULE = 0.05
SHAFT_RULE = "a shaft in the bore keeps it round"
_ELEMENT_WIDTH = 1.25  # of the module, at most, across the face
_TWIST = 0.03  # rad of a shaft at torque_max, as of fzg_c
_DAMPING = 5e-6  # s, c/k of a shaft, as of fzg_c


@dataclass(frozen=True)
class Unread:
    """An attribute of the REXS file that no stage file has a place for, or that is not understood."""

    component: str
    attribute: str
    value: str
    unit: str


@dataclass
class Draft:
    """Tables as TOML has them; marks: place ("gears.pinion.teeth") → its origin; unread: everything that was not used;
    notes: sentences for the reader; like: the stage that the rest is from; word: what a value is that nobody gave,
    "assumed" or "proposed"."""

    tables: dict[str, Any]
    marks: dict[str, str] = field(default_factory=dict)
    unread: tuple[Unread, ...] = ()
    notes: list[str] = field(default_factory=list)
    like: str = ""
    word: str = "assumed"

    @classmethod
    def after(cls, stage: str, word: str = "assumed") -> Draft:
        """A draft that assumes (or does what `word` says) of everything what the shipped `stage` says."""
        draft = cls(copy.deepcopy(read_layers(find_stage(stage)).tables), like=stage, word=word)
        draft._mark((), draft.tables, f"{word}, as in {stage}")
        return draft

    def put(self, place: str, value: Any, origin: str) -> None:
        """Write a value, or a whole table, and where it is from."""
        put_at(self.tables, place, value)
        self._mark(tuple(place.split(".")), value, origin)

    def assume(self, place: str, value: Any, why: str) -> None:
        """`put` for a value that nobody gave, with the rule behind it."""
        self.put(place, value, f"{self.word}: {why}")

    def at(self, place: str) -> Any:
        """The value or table at a place."""
        return value_at(self.tables, place.split("."))

    def drop(self, place: str) -> None:
        """Take a field or table out."""
        *way, key = place.split(".")
        table = self.tables
        for step in way:
            table = table.get(step, {})
        table.pop(key, None)

    def assumptions(self) -> dict[str, str]:
        """Places of assumed values that a reader should look at, with the reason."""
        return {place: mark for place, mark in self.marks.items() if mark.startswith(f"{self.word}: ")}

    def put_proportions(self, gear: str, module: float, width: float) -> None:
        """Tip edge and element count across the face of a gear of this module and face width (m), whose flanks are
        nominal and whose body is meshed here."""
        for part in ("tip_relief", "lead", "index_deviation", "import"):
            self.drop(f"{gear}.{part}")
        self.assume(f"{gear}.tip_edge_radius", millimetres(TIP_EDGE_PER_MODULE * module), "0.05 m_n")
        across = max(self.at(f"{gear}.body.mesh")["width"], round(width / (_ELEMENT_WIDTH * module)))
        self.assume(f"{gear}.body.mesh.width", across, "elements of at most 1.25 m_n")

    def put_shafts(self, torques: dict[str, float]) -> None:
        """Shafts and bores of a pair whose gears carry these torques (N·m) at most."""
        for name, torque in torques.items():
            stiffness = rounded_up(torque / _TWIST, 2)
            self.assume(f"ports.{name}.k", f"{stiffness:g} N*m/rad", "twisted by 0.03 rad at torque_max")
            self.assume(f"ports.{name}.c", f"{rounded_up(_DAMPING * stiffness, 2):g} N*m*s/rad", "5 us times k")
            self.assume(f"gears.{name}.bore_coupling", "rigid", SHAFT_RULE)

    def put_limit(self, field: str, known: tuple[float | None, str], usual: tuple[float, str]) -> float:
        """Puts `torque_max` (N·m) or `speed_max` (rad/s), for which the model is made, and returns it: as known, with
        its origin, else the usual one rounded up, with the rule behind it."""
        value = known[0] or rounded_up(usual[0], 2)
        origin = known[1] if known[0] else f"{self.word}: {usual[1]}"
        self.put(field, f"{value:.10g} {'N*m' if field == 'torque_max' else 'rad/s'}", origin)
        return value

    def _mark(self, place: tuple[str, ...], value: Any, origin: str) -> None:
        self.marks[".".join(place)] = origin
        if isinstance(value, dict):
            for key, inner in value.items():
                self._mark((*place, key), inner, origin)


def millimetres(value: float) -> str:
    """A length in m as text for a stage file, to a nanometre."""
    return f"{round(1e3 * value, 6):.10g} mm"


def degrees(angle: float) -> str:
    """An angle in rad as text for a stage file."""
    return f"{round(math.degrees(angle), 9):.10g} deg"


def usual_torque(diameter: float, ratio: float, width: float) -> float:
    """Torque (N·m) on a gear of reference diameter d₁ (m) and face width b (m), its mate u times as large, at the usual
    load K: K b d₁² u / (2 (u + 1))."""
    return LOAD_PER_FACE * width * diameter**2 * ratio / (ratio + 1) / 2
