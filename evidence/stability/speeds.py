"""Scenes of speed: through the mesh resonance up and down."""

from __future__ import annotations

import numpy as np

from evidence.stability.bench import geometry, kernel, model
from evidence.stability.case import Case, Finding
from evidence.stability.checks import Expected, at_least, finding, statistics
from evidence.stability.loads import RELIEVED, H
from evidence.stability.motion import RPM, UpAndDown, loaded
from evidence.stability.record import Record, run

LOW, HIGH, DURATION = 5000.0, 18000.0, 2.0  # rpm, rpm, s
TORQUE = 15.0  # N·m: so little that tip relief excites far more than the stiffness does
RESONANCE = (11000.0, 14000.0)  # rpm: mesh frequency 2.9 … 3.7 kHz about a mode of mesh and bearings
BINS = 60
LOST = 0.05  # contact-loss share of a bin in which the resonance has jumped
# where h goes to 0: at 0.9 µs, with dashpots that act at changes of contact and without. Their error there is of first
# order in h: 0.6 % of the time on the way down at the default step
EXPECTED = {"open_share_up": Expected(0.057, 0.003), "open_share_down": Expected(0.0955, 0.007)}


def run_up_and_down(case: Case) -> Finding:
    """5 000 to 18 000 rpm in 2 s and back, 15 N·m, for which the tip relief is far too much: contact is lost in the
    mesh resonances, softening ones. Near 3.5 kHz the teeth begin to part at a higher speed on the way up than the one
    at which they stay together again on the way down."""
    pair = geometry(RELIEVED)
    motion = UpAndDown(LOW * RPM, HIGH * RPM, DURATION)
    made = run(kernel(model(RELIEVED), case), loaded(RELIEVED, motion, TORQUE), 2 * DURATION, H)
    up, down = _lost(made, made.time < DURATION), _lost(made, made.time >= DURATION)
    said, facts = [], {}
    for name, lost in (("up", up), ("down", down)):
        facts[f"open_share_{name}"] = float(lost.mean())
        facts[f"jump_{name}_rpm"] = _onset(lost)
        said += at_least(
            f"largest contact-loss share in {1.0 / BINS:.3f} of the run {name}", float(lost.max()), 4 * LOST
        )
    said += statistics(facts, EXPECTED)
    apart = facts["jump_up_rpm"] - facts["jump_down_rpm"]
    said += at_least("distance of the jumps up and down (rpm)", apart, 2.0 * (HIGH - LOW) / BINS)
    return finding(made, pair, said, facts)


def _lost(record: Record, part: np.ndarray) -> np.ndarray:
    """(BINS,) contact-loss share by speed, rising."""
    time, open_time = record.time[part], record["mesh.open_time"][part]
    edges = np.linspace(time[0], time[-1], BINS + 1)
    lost = np.diff(np.interp(edges, time, open_time)) / np.diff(edges)
    return lost if time[0] < DURATION else lost[::-1]


def _onset(lost: np.ndarray) -> float:
    """Lowest speed (rpm) in the resonance at which contact is lost."""
    speed = LOW + (HIGH - LOW) * (np.arange(BINS) + 0.5) / BINS
    seen = (lost > LOST) & (speed > RESONANCE[0]) & (speed < RESONANCE[1])
    return float(speed[seen].min()) if seen.any() else float("nan")
