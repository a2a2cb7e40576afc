"""A plan as a value and as plan.toml: settings of every segment, with reasons; plans that were made before."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.files import write_text
from gearfmu.planning.choice import Choice
from gearfmu.stagefile.reading.base import read_toml, toml_value

FORMAT = 1
HEAD = """# Made by `gearfmu plan`: what each segment of a scene is run with for an error budget, and why.
# Run it with `gearfmu run --plan {name}`. Errors are in budgets: 1 is as much as was asked for.
"""


@dataclass(frozen=True)
class Line:
    """One effect of a segment. verdict: "on", "off", a level, a step, a number of slices; by: policy, formula or
    measured; formula: predicted error of the knob as far down as it goes, budgets; error: what one step down changes,
    measured; share: of the price, measured on this stage, that the same step down saves. NaN: not known."""

    effect: str
    verdict: str
    by: str
    reason: str
    formula: float = math.nan
    error: float = math.nan
    share: float = math.nan


@dataclass(frozen=True)
class Point:
    """A measured set on the work–precision chart: words, price as in Segment, bound in budgets, whether it is the
    chosen one."""

    words: str
    price: float
    bound: float
    chosen: bool


@dataclass(frozen=True)
class Segment:
    """A part of the scene from start to end (s) with its choice.

    kind: loaded, contact_loss or transient; window_start, window, settle: where it was measured, and what a state that
    was taken over settled before, s; bound, error: of the chosen set, budgets; safety: what the bound is multiplied by;
    noise: of the full model, budgets; price: processor time of the stage over that of level fast at its default step;
    realtime: processor seconds of the stage per simulated second. price_full, price_default, error_default: of the full
    model and of the outputs that the scene itself records.
    """

    name: str
    start: float
    end: float
    kind: str
    choice: Choice
    window_start: float
    window: float
    settle: float
    bound: float
    error: float
    safety: float
    noise: float
    price: float
    realtime: float
    price_full: float
    price_default: float
    error_default: float
    lines: tuple[Line, ...] = ()
    points: tuple[Point, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def kept(self) -> bool:
        """Whether the bound with its safety is within the budget."""
        return self.bound * self.safety <= 1.0 + 1e-9


@dataclass(frozen=True)
class Plan:
    """scene: name or path; identity: digest of all that decides the plan; step: communication step, s; request: as in
    `Request.plain`; cost: of planning, in runs of the full model over the window; model: hash of the model it was made
    for, empty in plans of former versions."""

    scene: str
    identity: str
    step: float
    request: Mapping[str, Any]
    segments: tuple[Segment, ...]
    cost: float = math.nan
    cpu: float = math.nan
    notes: tuple[str, ...] = field(default=())
    model: str = ""

    def save(self, path: Path) -> Path:
        """Write plan.toml, whole or not at all; returns the path."""
        write_text(path, HEAD.format(name=path.name) + "\n".join(_toml({"format": FORMAT} | asdict(self))) + "\n")
        return path

    @classmethod
    def load(cls, path: Path) -> Plan:
        """Read plan.toml. SpecError when it is none, or of another version."""
        try:
            raw = dict(read_toml(path))
            if raw.pop("format", None) != FORMAT:
                raise ValueError(f"of another format than {FORMAT}")
            segments = tuple(_segment(item) for item in raw.pop("segments"))
            return cls(**raw | {"segments": segments, "notes": tuple(raw.get("notes", ()))})
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            remedy = f"is no plan ({error}): make it again with `gearfmu plan`"
            raise SpecError([Problem(str(path), "", "", remedy)]) from error


def _segment(raw: Mapping[str, Any]) -> Segment:
    choice = Choice(**{**raw["choice"], "off": tuple(raw["choice"]["off"])})
    lines = tuple(Line(**line) for line in raw.get("lines", ()))
    points = tuple(Point(**point) for point in raw.get("points", ()))
    return Segment(**{**raw, "choice": choice, "lines": lines, "points": points, "notes": tuple(raw.get("notes", ()))})


def _toml(table: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Lines of a table: plain values, then tables, then lists of tables."""
    plain = {k: v for k, v in table.items() if not isinstance(v, dict) and not _tables(v)}
    found = [f"{key} = {toml_value(value)}" for key, value in plain.items()]
    for key, value in table.items():
        if isinstance(value, dict):
            found += ["", f"[{prefix}{key}]", *_toml(value, f"{prefix}{key}.")]
        elif _tables(value):
            for item in value:
                found += ["", f"[[{prefix}{key}]]", *_toml(item, f"{prefix}{key}.")]
    return found


def _tables(value: object) -> bool:
    return isinstance(value, (list, tuple)) and bool(value) and isinstance(value[0], dict)


def kept_plan(identity: str) -> Plan | None:
    """The plan that was made before for the same model, scene, outputs, budget and kernel; None where there is none
    that can be read."""
    try:
        return Plan.load(_kept_at(identity))
    except SpecError:
        return None


def keep_plan(plan: Plan) -> Plan:
    """The plan, also kept in $GEARFMU_CACHE/plans or the user's cache folder, where that can be written."""
    try:
        plan.save(_kept_at(plan.identity))
    except OSError:
        pass
    return plan


def _kept_at(identity: str) -> Path:
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(os.environ.get("GEARFMU_CACHE") or caches / "gearfmu") / "plans" / f"{identity[:32]}.toml"
