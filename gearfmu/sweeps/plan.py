"""Points of a sweep's grid, and the owner of each key of a point.

A *scene* is run at every point. A *stage* is run alone where its points have a `speed`, else its loaded transmission
error is taken. Keys:

    torque, speed             of the scene's drive and start; of the input of a stage
    stage.<field>             of the stage file: stage.gears.pinion.tip_relief.amount
    duration, step, settle    of a stage that is run alone; `positions`, `pitches` of a transmission error
    anything else             a field of the scene (coupling.step, stage.level), or of a stage alone a parameter of the
                              kernel (level, effect.hertz: docs/variables.md)
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.errors import GearfmuError
from gearfmu.quantities import NUMBER, to_si
from gearfmu.scenefile.scene import SceneSpec, StageChoice, full_key, scene_path, shipped_scenes
from gearfmu.stagefile.reading.base import Quantity, read_toml
from gearfmu.stagefile.reading.files import find_stage, quantity_at, read_layers
from gearfmu.stagefile.stage import stage_class

_RANGE = re.compile(r"\s*([^:\s]+)\s*:\s*([^:\s]+)\s*:\s*(\d+)\s*(\S.*?)?\s*$")

RUN, SIMULATE, TE = "run", "simulate", "te"
OWN = {  # keys of a stage that is computed alone, with their units
    SIMULATE: {"torque": "N*m", "speed": "rad/s", "duration": "s", "step": "s", "settle": "s", "end_speed": "rad/s"},
    TE: {"torque": "N*m", "positions": "", "pitches": ""},
}
NEEDED = {RUN: (), SIMULATE: ("torque", "speed"), TE: ("torque",)}
STAGE = "stage."


class SweepError(GearfmuError):
    """A sweep that cannot be made as asked."""


Values = Mapping[str, Any]


@dataclass(frozen=True)
class Plan:
    """A sweep. subject: file of the scene or stage; what: RUN, SIMULATE or TE; points: values by key, as a file would
    say them or SI numbers; axes: the keys that have more than one value."""

    subject: Path
    what: str
    points: tuple[Values, ...]
    axes: tuple[str, ...]

    def unit(self, key: str) -> str | None:
        """SI unit of a key, "" for a plain number; None where it is no quantity."""
        if key in OWN.get(self.what, {}):
            return OWN[self.what][key]
        quantity = self._quantity(key)
        return None if quantity is None else quantity.unit

    def number(self, key: str, value: object) -> Any:
        """A value of a key in SI, as the table has it; text, switches and numbers without unit as they are."""
        unit = self.unit(key)
        return to_si(value, unit) if unit and isinstance(value, str) else value

    def stage_file(self, values: Values) -> Path:
        """The stage file of a point: the subject, or the one that its scene names."""
        if self.what != RUN:
            return self.subject
        table = read_toml(self.subject).get("stage")
        named = values.get("stage.name") or (table.get("name", "") if isinstance(table, dict) else "")
        return find_stage(str(named)).resolve()

    def _quantity(self, key: str) -> Quantity | None:
        if is_stage_key(self.what, key):
            tables = read_layers(self.stage_file(self.points[0])).tables
            return quantity_at(stage_class(tables), key.removeprefix(STAGE))
        if self.what != RUN:
            return None
        return quantity_at(SceneSpec, full_key(read_toml(self.subject), key, str(self.subject)))


def plan(subject: str | os.PathLike[str], over: Mapping[str, object] | Sequence[Values]) -> Plan:
    """The Plan of a sweep of a scene or stage, by path or shipped name.

    over : values by key, a list each (or one value): their grid, the last key fastest; or the points themselves.
    SweepError where there is no point, where points have different keys or a needed key is missing; SpecError where
    there is no such scene or stage.
    """
    points = _grid(over) if isinstance(over, Mapping) else tuple(dict(point) for point in over)
    if not points or len({frozenset(point) for point in points}) != 1:
        raise SweepError("a sweep needs points, all with the same keys: give values such as torque = 100 N*m, 200 N*m")
    file, scene = _file(subject)
    what = RUN if scene else SIMULATE if "speed" in points[0] else TE
    missing = [key for key in NEEDED[what] if key not in points[0]]
    if missing:
        raise SweepError(f"{subject} is a stage: its points need {' and '.join(missing)}")
    keys = tuple(points[0])
    return Plan(file, what, points, tuple(key for key in keys if len({str(p[key]) for p in points}) > 1) or keys[:1])


def is_stage_key(what: str, key: str) -> bool:
    """Whether a key belongs to the stage file: `stage.` and no field of a scene's own table [stage]."""
    if not key.startswith(STAGE):
        return False
    first, _, rest = key.removeprefix(STAGE).partition(".")
    return what != RUN or first not in StageChoice.model_fields or (first == "contact" and bool(rest))


def split(what: str, values: Values) -> tuple[dict[str, Any], dict[str, Any]]:
    """The values of a point that belong to the stage file, their keys as there, and all others."""
    stage = {key.removeprefix(STAGE): value for key, value in values.items() if is_stage_key(what, key)}
    return stage, {key: value for key, value in values.items() if not is_stage_key(what, key)}


def _grid(over: Mapping[str, Any]) -> tuple[dict[str, Any], ...]:
    one = (str, bytes, Mapping)
    lists = [[v] if isinstance(v, one) or not hasattr(v, "__iter__") else list(v) for v in over.values()]
    return tuple(dict(zip(over, values, strict=True)) for values in itertools.product(*lists)) if over else ()


def _file(subject: str | os.PathLike[str]) -> tuple[Path, bool]:
    """Absolute path of a scene's or stage's file, and whether it is a scene."""
    path = Path(subject)
    if path.is_file() and "coupling" in read_toml(path):
        return path.resolve(), True
    if not path.exists() and str(subject) in shipped_scenes():
        return scene_path(str(subject)).resolve(), True
    return find_stage(subject).resolve(), False


def key_and_values(text: str) -> tuple[str, list[Any]]:
    """("torque", ["100 N*m", "200 N*m"]) from "torque=100, 200 N*m": a list, whose last unit holds for numbers without
    one, or start:end:count, both ends included. SweepError for anything else."""
    key, sign, rest = text.partition("=")
    if not sign or not key.strip() or not rest.strip():
        raise SweepError(f'\'{text}\' is not KEY=VALUES: write torque="100, 200 N*m" or speed="1000:6000:11 rpm"')
    found = _RANGE.match(rest)
    return key.strip(), _range(found, text) if found else _list(rest)


def _range(found: re.Match[str], text: str) -> list[Any]:
    start, end, count, unit = found.groups()
    try:
        values = np.linspace(float(start), float(end), int(count)).tolist()
    except ValueError:
        raise SweepError(f"'{text}': a range is start:end:count, numbers with one unit behind them") from None
    return [f"{value:.15g} {unit}" if unit else value for value in values]


def _list(text: str) -> list[Any]:
    items = [item.strip() for item in text.split(",") if item.strip()]
    last = NUMBER.match(items[-1])
    unit = last[2] if last else ""
    return [_item(item, unit) for item in items]


def _item(text: str, unit: str) -> Any:
    match = NUMBER.match(text)
    if not match:
        return {"true": True, "false": False}.get(text, text)
    number, own = match[1], match[2] or unit
    if own:
        return f"{number} {own}"
    return int(number) if re.fullmatch(r"[+-]?\d+", number) else float(number)
