"""What tells a planned run that it has left what was planned for, and what is put back then."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gearfmu.planning.book import Segment
from gearfmu.planning.choice import Choice
from gearfmu.stage import StageModel, Trace

ENERGY = 0.05  # of the energy that went through or was stored: what a balance may leave over a leg
FLANK_ENDED = 16  # bit of solver.status
FALLBACK = 2
COAST, TIP, CONTACT, BALANCE, FELL_BACK = "coast flank", "tip overlap", "contact lost", "energy", "fallback scheme"


@dataclass(frozen=True)
class Trip:
    """segment, time (s) of the wire in the run, which wire, what was seen, the choice that the run went on with."""

    segment: str
    time: float
    wire: str
    message: str
    answer: str = ""


class Wires:
    """The tripwires of a stage."""

    def __init__(self, model: StageModel) -> None:
        self.meshes = [mesh.name for mesh in model.stage.engagements]

    def look(self, leg: Trace, segment: Segment, choice: Choice) -> Trip | None:
        """The first wire that tripped in a leg, None when it ran as planned."""
        lost = max(float(np.ptp(leg[f"{mesh}.open_time"])) for mesh in self.meshes)
        status = leg["solver.status"].astype(int)
        fresh = int(status[-1] & ~status[0])

        trip = partial(Trip, segment.name, float(leg.time[-1]))
        if lost > 0.0 and "coast_flank" in choice.off:
            return trip(COAST, f"drive flanks parted for {1e3 * lost:.3g} ms: coast flanks may be met")
        if lost > 0.0 and segment.kind == "loaded" and choice == segment.choice:
            return trip(CONTACT, f"a segment planned as loaded lost contact for {1e3 * lost:.3g} ms")
        if fresh & FLANK_ENDED:
            return trip(TIP, "a loaded pair came to the end of its flank, where the tip edge would carry on")
        if fresh & FALLBACK:
            return trip(FELL_BACK, "steps were repeated with the conservative scheme")
        return self._energy(leg, trip)

    def _energy(self, leg: Trace, trip: Callable[[str, str], Trip]) -> Trip | None:
        """What the balance leaves of what there was to balance."""
        moved = max(
            *(float(np.ptp(leg[f"energy.{name}"])) for name in ("work", "dissipated")),
            float(np.abs(leg["energy.stored"]).max()),
        )
        left = float(abs(leg["energy.residual"][-1] - leg["energy.residual"][1]))
        if left <= ENERGY * max(moved, 1e-12):
            return None
        return trip(BALANCE, f"the energy balance leaves {100 * left / moved:.2g} % in one leg")


def answer(choice: Choice, trip: Trip, segment: Segment) -> Choice | None:
    """What the run goes on with: the effect that was missing; for all else every effect of the scene and half the step.
    None when that is what it runs with."""
    own = {COAST: "coast_flank", TIP: "tip_contact"}.get(trip.wire)
    if own in choice.off:
        return choice.with_(own)
    better = replace(choice, off=(), level="fast" if choice.level == "rigid" else choice.level)
    if better == choice or trip.wire != CONTACT:
        better = replace(better, h=0.5 * choice.h)
    return None if better.h < 0.2e-6 else better
