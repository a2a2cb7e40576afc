"""A case of the suite: one scene at one level with one internal step; and what was found there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

LEVELS = ("fast", "standard", "full")
STEPS = {"default": 1, "half": 2, "quarter": 4}
COMPLETED = "completed"


@dataclass(frozen=True)
class Case:
    """level: of the kernel. step: a name of STEPS, a part of the kernel's default step. h: internal step, s, instead of
    that; 0 for none."""

    level: str
    step: str = "default"
    h: float = 0.0


CASES = (*(Case("fast", step) for step in STEPS), *(Case(level) for level in LEVELS[1:]))  # of every scene


@dataclass(frozen=True)
class Finding:
    """How a case went.

    outcome: "completed", a named outcome with its last good time ("penetration@0.0123"), or "failed" when the run
    reached its end but not as it must; complaints: what is wrong, one sentence each. energy_residual: largest change of
    what the energy balance leaves, over the energy that passed through the ports plus the largest stored energy.
    penetration: largest overlap of the undeformed flanks, m. realtime_factor: CPU seconds per simulated second. facts:
    statistics.
    """

    outcome: str
    h: float
    energy_residual: float
    penetration: float
    realtime_factor: float
    complaints: tuple[str, ...] = ()
    facts: Mapping[str, float] = field(default_factory=dict)
